"""Recognition again, over a recording: the same events, to the last bit of their delays."""

import asyncio
import random
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import pytest
from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Event
from engage_hri.schemas.faults import InputRefused
from engage_hri.schemas.participants import Step, Taken
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, ActorLost
from engage_hri.schemas.recognition import ConnectionEvent, RequestEvent
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.bus.samples import Received
from engage_hri.services.client.people.perceived_person import PerceivedActions
from engage_hri.services.commandline.shell.config import Config
from engage_hri.services.commandline.study.again import SentMessage, again
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.intake import Content
from engage_hri.services.recognition.service import recognize
from engage_hri.services.recording.disk import read
from engage_hri.services.recording.reading import Recording
from engage_hri.services.requests.ends import Requester
from engage_hri.services.runtime.intake import content_of
from engage_hri.services.runtime.service import serve
from engage_hri.services.tangram.people.config import SimulationConfig
from tests.recording.runs import recording_to, tangram

PEOPLE = ("ann", "bob", "cleo")
THINGS = ("cup", "plate")


def told(said: Sequence[SentMessage]) -> list[ConnectionEvent]:
    return [each.message for each in said if isinstance(each.message, ConnectionEvent)]


def test_the_anchor_scenario_gives_the_same_events(task: Recording) -> None:
    lives = {life.service: life for life in again(task)}
    life = lives.pop("recognition")

    assert life.lack.is_nothing
    assert len(life.live) > 200
    assert told(life.live) == told(life.again)
    assert lives.keys() == {"control", "generation", "realizer"}
    for other in lives.values():
        assert (other.is_same, other.lack.is_nothing) == (True, True)
        assert other.steps > 1000


async def test_raw_perception_gives_the_same_events(tmp_path: Path) -> None:
    await tangram(tmp_path / "a.mcap", Config(simulation=SimulationConfig(human="appendix-b", perception="raw")))

    life = next(
        life for life in again(read(tmp_path / "a.mcap"), services=("recognition",)) if life.service == "recognition"
    )

    assert life.lack.is_nothing
    assert len(life.live) > 100
    assert told(life.live) == told(life.again)


async def act(hub: MemoryHub, seed: int, seconds: float) -> None:
    """Three people and a robot who do all sorts of things."""
    chance = random.Random(seed)
    camera, control, realizer = hub.join("camera", "perception"), hub.join("control", "control"), hub.join("realizer")
    people, loop = PerceivedActions(camera), asyncio.get_running_loop()
    things = [Entity(id=name, kind="object", position=(0.5, 0.1, 0.8)) for name in THINGS]
    faces = [Entity(id=name, kind="person", position=(1.2, 0.0, 1.3)) for name in PEOPLE]
    camera.publish(keys.WORLD, World(entities=(*things, *faces), at=camera.stamp()))
    for bus in (camera, control, realizer):
        bus.declare_alive()
    async with Requester(realizer) as requests:
        until, number = loop.time() + seconds, 0
        while loop.time() < until:
            number += 1
            who, what = chance.choice(PEOPLE), chance.choice(["look", "look", "speak", "nod", "point"])
            targets = (chance.choice([*THINGS, "robot"]),) if what in ("look", "point") else ()
            kind = ActionBegan if chance.random() < 0.6 else ActionEnded
            match chance.randrange(8):
                case 0:
                    people.tell(ActorFound(actor=who, at=camera.stamp()))
                case 1 if chance.random() < 0.2:
                    people.tell(ActorLost(actor=who, at=camera.stamp()))
                case 2:
                    told = kind(
                        actor="robot", action=what, at=control.stamp(), targets=targets and (chance.choice(PEOPLE),),
                        behavior="b:1",
                    )  # fmt: skip
                    control.publish(keys.ROBOT_ACTION, told)
                case 3:
                    event = Event(id=f"e{number}", kind="directed_gaze", responder=who, objects=("cup",))
                    request = RequestEvent(id=f"r{number}", block="b", event=event, at=realizer.stamp())
                    requests.send(keys.EVENT, request)
                case _:
                    people.tell(kind(actor=who, action=what, at=camera.stamp(), targets=targets))
            await asyncio.sleep(chance.choice([0.0, 0.05, 0.3, 1.0]))
    for bus in (camera, control, realizer):
        await bus.leave()


async def run(hub: MemoryHub) -> "asyncio.Task[None]":
    task = asyncio.create_task(serve(hub, "recognition", partial(recognize, config=RecognitionConfig())))
    await asyncio.sleep(0)
    return task


@pytest.mark.parametrize("seed", range(3))
async def test_three_people_and_a_restart_in_the_middle_give_the_same_events(tmp_path: Path, seed: int) -> None:
    async with MemoryHub() as hub, recording_to(tmp_path / "a.mcap", hub):
        recognition = await run(hub)
        acting = asyncio.create_task(act(hub, seed, 120.0))
        await asyncio.sleep(60.0)
        recognition.cancel()
        await asyncio.wait([recognition])
        await asyncio.sleep(5.0)
        recognition = await run(hub)
        await acting
        await asyncio.sleep(20.0)
        recognition.cancel()
        await asyncio.wait([recognition])

    before, after = again(read(tmp_path / "a.mcap"))

    for life in (before, after):
        assert life.lack.is_nothing
        assert life.is_same
        assert len(life.live) > 30
        assert len({event.person("robot") for event in told(life.live)}) == 3
    assert {event.state for event in told(before.live)} >= {"started", "succeeded", "failed", "completed"}


async def test_the_file_of_a_killed_recorder_gives_the_same_events_as_far_as_it_goes(tmp_path: Path) -> None:
    sizes = []
    async with MemoryHub() as hub, recording_to(tmp_path / "a.mcap", hub):
        recognition = await run(hub)
        acting = asyncio.create_task(act(hub, 7, 60.0))
        for _ in range(10):
            await asyncio.sleep(6.1)
            sizes.append((tmp_path / "a.mcap").stat().st_size)
        await acting
        recognition.cancel()
        await asyncio.wait([recognition])

    data = (tmp_path / "a.mcap").read_bytes()
    longest = 0
    for size in sizes:
        (tmp_path / "cut.mcap").write_bytes(data[: size - 17])
        for life in again(read(tmp_path / "cut.mcap")):
            assert life.lack.is_nothing
            assert life.is_same
            longest = max(longest, len(life.live))
    assert longest > 30


async def test_a_recording_that_begins_in_the_middle_says_that_it_lacks_what_was_before(tmp_path: Path) -> None:
    async with MemoryHub() as hub:
        recognition = await run(hub)
        acting = asyncio.create_task(act(hub, 3, 150.0))
        await asyncio.sleep(30.0)
        async with recording_to(tmp_path / "a.mcap", hub):
            await acting
        recognition.cancel()
        await asyncio.wait([recognition])

    [life] = again(read(tmp_path / "a.mcap"))

    assert life.lack.before > 10
    assert (life.lack.gaps, life.lack.messages) == (0, 0)
    assert len(life.again) > 10
    first = min(one.at.seconds for one in told(life.live))
    changes = {one.message for pair in life.other_words for one in (pair.live, pair.again) if one is not None}
    later = [one for one in told(life.live) if one.started.seconds > first + 60.0]
    assert len(later) > 10
    assert not changes & set(later)


async def test_a_message_that_is_missing_is_counted(tmp_path: Path) -> None:
    recording = await _short(tmp_path)
    place = next(n for n in range(len(recording)) if recording.key(n) == keys.PERCEIVED_ACTION)
    received = recording.received

    recording.received = lambda n: None if n == place else received(n)  # type: ignore[method-assign]
    [life] = again(recording)

    assert life.lack.messages == 1


async def test_other_settings_give_other_events(tmp_path: Path) -> None:
    recording = await _short(tmp_path)

    [life] = again(recording, ["recognition.directed_gaze_limit=0.01"])

    assert not life.is_same
    failed = [event for event in told(life.again) if event.kind == "directed_gaze" and event.state == "failed"]
    assert len(failed) > len(
        [one for one in told(life.live) if one.kind == "directed_gaze" and one.state == "failed"]
    )


async def _short(tmp_path: Path) -> Recording:
    async with MemoryHub() as hub, recording_to(tmp_path / "a.mcap", hub):
        recognition = await run(hub)
        await act(hub, 5, 60.0)
        recognition.cancel()
        await asyncio.wait([recognition])
    return read(tmp_path / "a.mcap")


async def test_nothing_is_told_while_nobody_listens() -> None:
    async with MemoryHub() as hub:
        recognition = await run(hub)
        await act(hub, 1, 20.0)
        watcher = hub.join("watcher")
        assert not watcher.is_heard(keys.taken("recognition"))
        inbox = watcher.subscribe(keys.ANY_TAKEN)
        await act(hub, 2, 20.0)
        recognition.cancel()
        await asyncio.wait([recognition])
        inbox.close()

        told = [one.message async for one in inbox if isinstance(one.message, Taken)]
        assert all(taken.first > 20 for taken in told)
        assert len(told) > 2


async def test_a_step_that_took_something_else_is_noticed_and_named(tmp_path: Path) -> None:
    recording = await _short(tmp_path)
    received, changed = recording.received, set[tuple[str, int]]()

    def other(place: int) -> Received | None:
        found = received(place)
        if found is not None and isinstance(began := found.message, ActionBegan) and began.action == "look":
            changed.add((found.life, found.number))
            return replace(found, message=replace(began, action="nod"))
        return found

    recording.received = other  # type: ignore[method-assign]
    [life] = again(recording)

    first = life.differences[0].step
    assert life.lack.is_nothing
    assert (first.life, first.number) in changed


@pytest.mark.parametrize("content", [{"type": "nothing_we_know"}, "text", 7, [1]])
def test_a_step_that_took_what_nobody_knows_is_refused_in_words(content: object) -> None:
    step = Step(now=1.5, key=keys.WORLD, content=content)

    with pytest.raises(InputRefused, match=r"step at 1\.500 s.*does not know"):
        content_of(step, Content)
