"""A person told of by a program: what goes over the bus, and what it refuses."""

import asyncio
import math
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.faults import InputRefused, RunFailed
from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import (
    LONGEST_TEXT,
    ActionBegan,
    ActionEnded,
    ActorFound,
    ActorLost,
    OngoingActions,
    Utterance,
)
from engage_hri.schemas.units import Stamp
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.people.actions import WORD, speaking_time
from engage_hri.services.client.people.perceive import perceive
from engage_hri.services.client.people.perceived_person import BESIDE, SEAT, PerceivedPerson, free_seat
from engage_hri.services.client.robot import connect
from engage_hri.services.runtime.service import Ready, Service, running
from engage_hri.services.simulation.still import show_world
from tests.cli.command import engage

THINGS = World(
    entities=(
        Entity(id="cup", kind="object", position=(0.5, 0.1, 0.7)),
        Entity(id="ball", kind="object", position=(0.5, -0.1, 0.7)),
    )
)


async def idle(bus: Bus, ready: Ready) -> None:
    """A service that is there."""
    ready()
    await asyncio.get_running_loop().create_future()


@asynccontextmanager
async def scene(hub: MemoryHub, world: World = THINGS) -> AsyncIterator[list[Message]]:
    """A world, and recognition that only stands there. Yields what perception tells, as it is told."""
    told: list[Message] = []
    with hub.join("ear").subscribe(keys.PERCEIVED_ACTION, keys.UTTERANCE) as inbox:

        async def listen() -> None:
            async for received in inbox:
                told.append(received.message)

        services: dict[str, Service] = {"recognition": idle, "simulation": partial(show_world, world=world)}
        async with running(hub, services):
            listening = asyncio.create_task(listen())
            yield told
            await asyncio.sleep(0.01)
        listening.cancel()
        await asyncio.wait([listening])


def summed(told: list[Message]) -> list[tuple[Any, ...]]:
    found: list[tuple[Any, ...]] = []
    for each in told:
        match each:
            case ActorFound():
                found.append(("+", each.actor))
            case ActorLost():
                found.append(("-", each.actor))
            case ActionBegan():
                found.append(("+", each.actor, each.action, *each.targets))
            case ActionEnded():
                found.append(("-", each.actor, each.action, *each.targets))
            case Utterance():
                found.append((each.actor, each.text, each.final))
    return found


async def test_everything_that_they_do_has_a_beginning_and_an_end(hub: MemoryHub) -> None:
    async with scene(hub) as told, perceive("ann", hub=hub) as ann:
        await ann.look_at("cup")
        await ann.look_at("robot")
        await ann.nod()
        await ann.point_at("ball")
        await ann.act("cup", to=(0.6, 0.0, 0.7))

    assert summed(told) == [
        ("+", "ann"), ("+", "ann", "look", "cup"), ("-", "ann", "look", "cup"), ("+", "ann", "look", "robot"),
        ("+", "ann", "nod"), ("-", "ann", "nod"), ("+", "ann", "point", "ball"), ("-", "ann", "point", "ball"),
        ("+", "ann", "act", "cup"), ("-", "ann", "act", "cup"), ("-", "ann", "look", "robot"), ("-", "ann"),
    ]  # fmt: skip


async def test_words_come_while_they_are_spoken_and_are_final_a_moment_later(hub: MemoryHub) -> None:
    async with scene(hub) as told, perceive("ann", hub=hub, position=SEAT) as ann:
        await ann.say("yes that one", seconds=3.0, delay=0.5, to="robot")

    words = [each for each in told if isinstance(each, Utterance)]
    assert [(each.text, each.final, each.at.seconds) for each in words] == [
        ("", False, 0.0), ("yes", False, 1.0), ("yes that", False, 2.0), ("yes that one", False, 3.0),
        ("yes that one", True, 3.5),
    ]  # fmt: skip
    assert {(each.id, each.actor, each.began.seconds, each.to) for each in words} == {
        (words[0].id, "ann", 0.0, ("robot",))
    }
    assert words[-1].ended is not None
    assert words[-1].ended.seconds == 3.0
    speech = [(type(each), each.at.seconds) for each in told if isinstance(each, ActionBegan | ActionEnded)]
    assert speech == [(ActionBegan, 0.0), (ActionEnded, 3.0)]


async def test_words_that_are_broken_off_are_what_was_said_of_them(hub: MemoryHub) -> None:
    async with scene(hub) as told, perceive("ann", hub=hub) as ann:
        saying = asyncio.create_task(ann.say("yes that one", seconds=3.0))
        await asyncio.sleep(2.5)
        saying.cancel()
        await asyncio.wait([saying])

    assert summed(told)[-4:] == [
        ("ann", "yes that", False), ("-", "ann", "speak"), ("ann", "yes that", True), ("-", "ann"),
    ]  # fmt: skip


async def test_a_typed_line_is_words_alone(hub: MemoryHub) -> None:
    async with scene(hub) as told, perceive("ann", hub=hub) as ann:
        await asyncio.sleep(2.0)
        await ann.type("hello")

    assert summed(told) == [("+", "ann"), ("ann", "hello", True), ("-", "ann")]
    words = next(each for each in told if isinstance(each, Utterance))
    assert (words.began, words.ended) == (words.at, None)


async def test_words_of_the_next_person_of_a_name_are_no_news_of_what_the_last_one_said(hub: MemoryHub) -> None:
    async with scene(hub) as told:
        for _ in range(2):
            async with perceive("ann", hub=hub, name="desk") as ann:
                await ann.type("hello")
            await asyncio.sleep(1.0)

    first, second = [each.id for each in told if isinstance(each, Utterance)]
    assert first != second


async def test_who_leaves_ends_what_goes_on_and_does_no_more(hub: MemoryHub) -> None:
    async with scene(hub) as told, perceive("ann", hub=hub) as ann:
        ann.begin("speak")
        ann.begin("act", "cup")
        await ann.leave()
        with pytest.raises(RunFailed, match="ann: this person has left"):
            await ann.nod()

    assert summed(told) == [
        ("+", "ann"), ("+", "ann", "speak"), ("+", "ann", "act", "cup"), ("-", "ann", "speak"),
        ("-", "ann", "act", "cup"), ("-", "ann"),
    ]  # fmt: skip


async def test_what_goes_on_is_told_as_a_state(hub: MemoryHub) -> None:
    async with scene(hub), perceive("ann", hub=hub, name="camera") as ann:
        ann.begin("speak")
        with hub.join("late").subscribe(keys.perceived_ongoing("camera", "ann")) as inbox:
            received = await inbox.next(1.0)

    assert received is not None
    assert isinstance(received.message, OngoingActions)
    assert [each.action for each in received.message.actions] == ["speak"]
    assert received.message.seen


# -- the world -------------------------------------------------------------------------------------------------


async def places(hub: MemoryHub) -> dict[str, tuple[float, float, float]]:
    async with connect(hub=hub) as robot:
        return {entity.id: entity.position for entity in (await robot.world()).entities}


async def test_two_people_sit_beside_one_another_in_one_world(hub: MemoryHub) -> None:
    async with scene(hub):
        async with perceive("ann", hub=hub) as ann, perceive("bob", hub=hub):
            await asyncio.sleep(0.1)
            world = await places(hub)
            assert world.keys() == {"cup", "ball", "ann", "ann-hand", "bob", "bob-hand"}
            assert math.dist(world["ann"], world["bob"]) > 0.5
            assert {entity.id for entity in ann.world} == world.keys()
        await asyncio.sleep(1.0)
        assert (await places(hub)).keys() == {"cup", "ball"}


@pytest.mark.parametrize("count", [2, 5])
def test_those_who_sit_down_at_once_sit_beside_one_another_as_near_the_middle_as_they_can(
    count: int,
) -> None:
    seats = [free_seat((), skip) for skip in range(count)]

    apart = [math.dist(one, other) for number, one in enumerate(seats) for other in seats[:number]]
    assert min(apart) == pytest.approx(BESIDE)
    assert max(math.dist(seat, SEAT) for seat in seats) == pytest.approx(BESIDE * (count // 2))


async def test_a_hand_that_does_nothing_lies_before_its_owner(hub: MemoryHub) -> None:
    async with scene(hub), perceive("ann", hub=hub), perceive("bob", hub=hub):
        world = await places(hub)

    for person in ("ann", "bob"):
        (x, y, z), (u, v, w) = world[person], world[f"{person}-hand"]
        assert (0.0 < x - u < 0.5, y == v, 0.3 < z - w < 0.8) == (True, True, True)


def test_words_take_their_time_one_by_one_and_no_speech_takes_none() -> None:
    assert [speaking_time(text) for text in ("", "yes", "put it there")] == pytest.approx([WORD, WORD, 3 * WORD])


async def test_a_person_whom_the_world_has_already_is_not_put_there_again(hub: MemoryHub) -> None:
    ann = Entity(id="ann", kind="person", position=(2.0, 1.0, 1.5))
    async with scene(hub, World(entities=(*THINGS.entities, ann))), perceive("ann", hub=hub):
        assert (await places(hub))["ann"] == (2.0, 1.0, 1.5)
        assert "ann-hand" not in await places(hub)


async def test_a_thing_stays_where_somebody_has_laid_it(hub: MemoryHub) -> None:
    async with scene(hub):
        async with perceive("ann", hub=hub) as ann:
            acting = asyncio.create_task(ann.act("cup", to=(0.7, 0.3, 0.9), seconds=1.0))
            await asyncio.sleep(0.45)
            midway = await places(hub)
            assert midway["ann-hand"] == midway["cup"]
            assert 0.5 < midway["cup"][0] < 0.7
            way = (0.7 - 0.5, 0.3 - 0.1, 0.9 - 0.7)
            done = [(at - began) / far for at, began, far in zip(midway["cup"], (0.5, 0.1, 0.7), way, strict=True)]
            assert done == pytest.approx([done[0]] * 3)  # in a straight line
            await acting
        await asyncio.sleep(10.0)
        assert (await places(hub))["cup"] == (0.7, 0.3, 0.9)


async def test_people_whose_program_was_killed_stay_for_a_grace(hub: MemoryHub) -> None:
    async with scene(hub), perceive("ann", hub=hub, name="camera"):
        hub.kill("camera")
        await asyncio.sleep(3.0)
        assert "ann" in await places(hub)
        await asyncio.sleep(2.0)
        assert (await places(hub)).keys() == {"cup", "ball"}


async def test_without_any_world_there_is_the_person_alone(hub: MemoryHub) -> None:
    async with running(hub, {"recognition": idle}), perceive("ann", hub=hub) as ann:
        assert (await places(hub)).keys() == {"ann", "ann-hand"}
        await ann.look_at("anything")  # nobody knows better
        ann.bring(Entity(id="cup", kind="object", position=(0.5, 0.0, 0.7)))
        await ann.move_to((1.5, 0.2, 1.3))

        assert (await places(hub))["ann"] == (1.5, 0.2, 1.3)
        assert "cup" in await places(hub)


# -- errors ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "deed",
    [
        lambda ann: ann.look_at("cap"),
        lambda ann: ann.point_at("cap"),
        lambda ann: ann.act("cap"),
        lambda ann: ann.act("cap", to=(0.0, 0.0, 0.0)),
    ],
)
async def test_an_unknown_id_is_refused(hub: MemoryHub, deed: Callable[[PerceivedPerson], Any]) -> None:
    async with scene(hub) as told, perceive("ann", hub=hub) as ann:
        with pytest.raises(InputRefused, match=r"ann: the world does not know 'cap' \(did you mean 'cup'"):
            await deed(ann)

    assert summed(told) == [("+", "ann"), ("-", "ann")]


@pytest.mark.parametrize("way", [PerceivedPerson.say, PerceivedPerson.type])
async def test_no_words_and_too_many_are_refused(hub: MemoryHub, way: Callable[..., Any]) -> None:
    async with scene(hub), perceive("ann", hub=hub) as ann:
        with pytest.raises(InputRefused, match="no words"):
            await way(ann, "  ")
        with pytest.raises(InputRefused, match=f"at most.*split|{LONGEST_TEXT} at most"):
            await way(ann, "a" * (LONGEST_TEXT + 1))


@pytest.mark.parametrize("way", [PerceivedPerson.say, PerceivedPerson.type])
async def test_half_a_character_is_refused_in_words(hub: MemoryHub, way: Callable[..., Any]) -> None:
    async with scene(hub), perceive("ann", hub=hub) as ann:
        with pytest.raises(InputRefused, match="ann: the words are not UTF-8"):
            await way(ann, "caf\ud83d")


@pytest.mark.parametrize(
    ("change", "reason"),
    [({"text": "a" * 100_000}, "100000 letters"), ({"text": "\ud83d"}, "not UTF-8"), ({"id": ""}, "not 0"),
     ({"id": "i" * 201}, "not 201")],
)  # fmt: skip
async def test_words_that_nobody_would_read_are_refused_as_they_are_told(
    hub: MemoryHub, change: dict[str, Any], reason: str
) -> None:
    async with scene(hub), perceive("ann", hub=hub) as ann:
        at = Stamp("loop", 0.0)
        with pytest.raises(InputRefused, match=reason):
            ann.tell(Utterance(**{"actor": "ann", "id": "1", "text": "yes", "began": at, "at": at, **change}))


async def test_without_a_robot_it_says_so_after_three_seconds(hub: MemoryHub) -> None:
    with pytest.raises(RunFailed, match=r"no robot 'robot' here within 3.0 s \(`engage up` starts one\)"):
        async with perceive("ann", hub=hub):
            pass

    assert asyncio.get_running_loop().time() == 3.0


@pytest.mark.parametrize("person", ["", "a/b", "@ann", "all", "robot"])
async def test_what_can_be_no_persons_id_is_refused(hub: MemoryHub, person: str) -> None:
    with pytest.raises(InputRefused, match="can't be a person's id"):
        async with perceive(person, hub=hub):
            pass


@pytest.mark.parametrize(
    ("person", "id", "kind"),
    [("cup", "cup", "object"), ("table", "table", "surface"), ("gripper", "gripper-hand", "object"),
     ("bob", "bob-hand", "hand")],
)  # fmt: skip
async def test_a_thing_is_no_person_and_stays_what_it_is(hub: MemoryHub, person: str, id: str, kind: Any) -> None:
    thing = Entity(id=id, kind=kind, owner="eve", position=(0.4, 0.0, 0.7))
    async with scene(hub, World(entities=(*THINGS.entities, thing))) as told:
        with pytest.raises(InputRefused, match=f"'{person}' can't be a person's id: the world has '{id}', of kind"):
            async with perceive(person, hub=hub):
                pass
        assert (await places(hub)).keys() == {"cup", "ball", id}

    assert told == []


async def test_who_comes_does_not_sit_where_an_old_world_says_that_nobody_sits(hub: MemoryHub) -> None:
    async with running(hub, {"recognition": idle}):
        coming = asyncio.create_task(stay(hub, "ann"))
        await asyncio.sleep(0.05)  # a slow process tells of bob only now
        seated = Entity(id="bob", kind="person", position=SEAT)
        hub.join("camera", role="perception").publish(keys.WORLD, World(entities=(*THINGS.entities, seated)))
        await asyncio.sleep(1.0)
        there = await places(hub)
        coming.cancel()
        await asyncio.wait([coming])

    assert there["bob"] == SEAT
    assert there["ann"][:2] == (SEAT[0], -0.6)


async def stay(hub: MemoryHub, name: str) -> None:
    hub.join("first", role="perception").publish(keys.WORLD, THINGS)
    async with perceive(name, hub=hub):
        await asyncio.get_running_loop().create_future()


async def test_keys_of_another_role_are_refused_before_anything_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    engage(capsys)("keys", "init", tmp_path / "keys", "manager=alice", "perception=camera")

    with pytest.raises(InputRefused, match=r"role manager; what people do is told by perception or wizard"):
        async with perceive("ann", keys=str(tmp_path / "keys" / "alice")):
            pass


async def test_a_person_says_who_it_is_the_same_as(hub: MemoryHub) -> None:
    async with running(hub, {"recognition": idle}):
        with hub.join("reader").subscribe(keys.PERCEIVED_ACTION) as told:
            async with perceive("face_3", hub=hub) as face:
                face.same_as("ann")
                face.same_as("face_3")
                face.bring(Entity(id="cup", kind="object", position=(0.5, 0.0, 0.7)))
                for wrong in ("", "a/b", "cup", face.robot):
                    with pytest.raises(InputRefused, match="own id"):
                        face.same_as(wrong)
            found = [(await told.next()).message for _ in range(len(told))]

    assert [(each.actor, each.same_as) for each in found if isinstance(each, ActorFound)] == [
        ("face_3", ""), ("face_3", "ann"), ("face_3", "face_3"),
    ]  # fmt: skip
