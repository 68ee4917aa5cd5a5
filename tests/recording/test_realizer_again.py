"""The realizer again, over a recording: what it commands and tells is the same, to the last bit in virtual time."""

import asyncio
import random
from functools import partial
from pathlib import Path
from typing import cast

import pytest
from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.blocks import Block, BlockOutcome, PerformBlock, SteerPerformance, SteerRobot
from engage_hri.schemas.body import PerformBehavior, SyncPointReached
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus.interface import Received
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.commandline.study.again import Compared, again, distance, told
from engage_hri.services.control.config import ControlConfig, Variability
from engage_hri.services.control.service import embody
from engage_hri.services.realizer.config import RealizerConfig
from engage_hri.services.realizer.service import realize
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.service import recognize
from engage_hri.services.recording.disk import read
from engage_hri.services.recording.reading import Recording
from engage_hri.services.requests.ends import Requester
from engage_hri.services.runtime import ledger
from engage_hri.services.runtime.service import running, serve
from engage_hri.services.runtime.virtual_time import run_virtual
from tests.random_cases import share_of
from tests.realizer.fake_body import FakeBody
from tests.realizer.stage import stage
from tests.realizer.test_plan_growth import tied_at_random
from tests.recording.runs import recording_to

SEEN = World(entities=(Entity(id="a", kind="object", position=(0.5, 0.1, 0.8)),))
ONLY = ("realizer",)


def test_the_anchor_scenario_is_performed_the_same(task: Recording) -> None:
    [life] = again(task, services=ONLY)

    assert life.lack.is_nothing
    assert life.steps > 1000
    assert (life.other_words, life.furthest) == ((), 0.0)
    assert told(life, "a", has_other_settings=False)[0].endswith("again the same, to the last bit")


async def story(path: Path, seed: int) -> None:
    """Random blocks of two requesters, some held, stopped or replaced, on a body with a will; and a second life."""
    chance = random.Random(seed)
    control = ControlConfig(variability=Variability(seed=seed))
    async with MemoryHub() as hub, recording_to(path, hub):
        services = {
            "control": partial(embody, config=control), "recognition": partial(recognize, config=RecognitionConfig()),
        }  # fmt: skip
        camera = hub.join("camera", "perception")
        camera.publish(keys.WORLD, SEEN)
        async with running(hub, services):
            for life in range(2):
                realizer = asyncio.create_task(serve(hub, "realizer", partial(realize, config=RealizerConfig())))
                client = hub.join(f"client{life}", "wizard")
                client.declare_alive()
                async with Requester(client) as requests:
                    for number in range(12):
                        id = f"b{life}-{number}"
                        made = tied_at_random(chance.randrange(1, 8), chance)
                        composition = chance.choice(("MERGE", "MERGE", "APPEND", "REPLACE"))
                        block = Block(
                            id=id, behaviors=made.behaviors, constraints=made.constraints, composition=composition
                        )
                        requests.send(keys.BLOCK, PerformBlock(id=f"r-{id}", block=block))
                        await asyncio.sleep(chance.choice((0.0, 0.2, 1.0, 3.0)) + chance.random() / 97)
                        to = chance.choice(("hold", "continue", "stop"))
                        if chance.random() < 0.4:
                            requests.send(keys.BLOCK, SteerPerformance(id=f"s-{id}", block=id, to=to))
                        elif chance.random() < 0.2:
                            requests.send(keys.ROBOT, SteerRobot(id=f"s-{id}", to=to))
                    requests.send(keys.ROBOT, SteerRobot(id=f"go-{life}", to="continue"))
                    await asyncio.sleep(8.0)
                realizer.cancel()
                await asyncio.wait([realizer])
                await client.leave()


def of_story(tmp_path: Path, seed: int) -> Recording:
    run_virtual(story(tmp_path / "a.mcap", seed))
    return read(tmp_path / "a.mcap")


@pytest.mark.parametrize("seed", range(share_of(4)))
def test_random_blocks_are_performed_the_same_in_both_lives(tmp_path: Path, seed: int) -> None:
    lives = again(of_story(tmp_path, seed), services=ONLY)

    assert len(lives) == 2
    for life in lives:
        messages = [one.live or one.again for one in life.other_words]
        assert life.lack.is_nothing
        assert life.steps > 50
        assert life.furthest == 0.0
        # Instants that are equal on a virtual clock: a command may be void before it is sent.
        assert len(messages) <= 2
        assert all(said is not None and isinstance(said.message, PerformBehavior) for said in messages)


def first_difference(recording: Recording) -> Compared:
    return again(recording, services=ONLY)[0]


def test_a_report_of_the_body_that_is_missing_or_came_earlier_is_noticed(tmp_path: Path) -> None:
    recording = of_story(tmp_path, 1)
    received = recording.received
    kinds = [type(getattr(received(number), "message", None)) for number in range(len(recording))]
    place = [number for number, kind in enumerate(kinds) if kind is SyncPointReached][10]

    def without(number: int) -> Received | None:
        return None if number == place else received(number)

    def earlier(number: int) -> Received | None:
        found = received(number)
        if number != place or found is None:
            return found
        message = cast(SyncPointReached, found.message)
        at = replace(message.at, seconds=message.at.seconds - 0.2)
        return replace(found, message=replace(message, at=at, arrived=at))

    recording.received = without  # type: ignore[method-assign]
    assert first_difference(recording).lack.messages == 1
    assert first_difference(recording).other_words
    recording.received = earlier  # type: ignore[method-assign]
    assert first_difference(recording).furthest > 0.01


def test_other_settings_make_it_do_something_else(tmp_path: Path) -> None:
    [life, _] = again(of_story(tmp_path, 2), ["realizer.blocks=1"])

    assert life.other_words


@pytest.mark.parametrize(
    ("one", "other", "expected"),
    [
        ({"a": [1.0, "x"]}, {"a": (1.25, "x")}, 0.25),
        ({"a": 1}, {"b": 1}, float("inf")),
        ([1, 2], [1], float("inf")),
        (True, 1, 0.0),
        ("x", "y", float("inf")),
        (None, 0.0, float("inf")),
    ],
)
def test_what_differs_in_more_than_numbers_is_infinitely_far(one: object, other: object, expected: float) -> None:
    assert distance(one, other) == expected


@pytest.mark.contained
async def test_a_ledger_that_cannot_be_told_keeps_no_block_from_being_performed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    tried = []

    def broken(outputs: object) -> str:
        tried.append(outputs)
        raise ZeroDivisionError("no ledger")

    monkeypatch.setattr(ledger, "fingerprint", broken)
    monkeypatch.setattr(ledger, "PORTION", 1)
    async with stage(FakeBody()) as seen:
        with seen.hub.join("watcher").subscribe(keys.ANY_TAKEN):
            outcome = await seen.ask(tied_at_random(6, random.Random(1))).outcome

    assert isinstance(outcome, BlockOutcome)
    assert outcome.status == "done"
    assert tried
