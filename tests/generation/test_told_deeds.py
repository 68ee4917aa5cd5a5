"""Further ways in which a gaze or a service can be missing: what is told is what came, and no more."""

import asyncio
from collections.abc import AsyncIterator
from typing import Any

import pytest

from engage_hri import perceive
from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Speech
from engage_hri.schemas.blocks import SyncPointProgress
from engage_hri.schemas.body_faults import BodyFault
from engage_hri.schemas.faults import OutcomeUnknown
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.recognition import ConnectionEvent
from engage_hri.schemas.summary import Summary, summary
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.language_models import perform_call, stream
from engage_hri.services.client.performing import PerformFailed
from engage_hri.services.client.robot import Robot
from engage_hri.services.commandline.shell import roster
from engage_hri.services.commandline.shell.config import load
from engage_hri.services.runtime.service import running
from tests.generation.test_chosen_again import cup, robot
from tests.random_cases import share_of

WORDS = "one two three four five six seven eight nine ten " * 3
SAY = {"say": "Here is what I found for you today."}
OUT_OF_SIGHT = {
    "behind the back": (-1.0, 0.0, 1.2),
    "behind to the left": (-0.8, 0.9, 1.3),
    "behind to the right": (-1.5, -0.7, 1.6),
    "in the head": (0.02, 0.0, 1.12),
    "between the neck and the eyes": (0.05, 0.0, 1.15),
    "straight above": (0.0, 0.0, 2.4),
    "at the feet": (0.02, 0.0, 0.2),
}
FAULTS = {
    "overheated from the start": BodyFault(kind="overheated", part="head"),
    "overheated before it is there": BodyFault(kind="overheated", part="head", before="stroke"),
    "overheated as it sets out": BodyFault(kind="overheated", part="head", before="stroke_start"),
}


async def seen(hub: MemoryHub, found: list[Any]) -> None:
    with hub.join("reader").subscribe(keys.FEEDBACK, keys.ANY_CONNECTION_EVENT) as inbox:
        async for received in inbox:
            found.append(received.message)


async def performed(
    hub: MemoryHub, parts: list[dict[str, Any]], *, ann_at: Any = (1.2, 0.0, 1.2), cup_at: Any = (0.5, 0.2, 0.8),
    fault: BodyFault | None = None,
) -> tuple[Summary, list[Any]]:  # fmt: skip
    """Perform a call. Returns what is told of it, and all feedback and connection events."""
    found: list[Any] = []
    async with robot(hub) as (client, _), perceive("ann", hub=hub, position=ann_at) as ann:
        ann.bring(cup(*cup_at))
        await ann.look_at(ann.robot)
        if fault is not None:
            await client.switch_on(fault)
        reading = asyncio.create_task(seen(hub, found))
        await asyncio.sleep(1.0)
        told = await perform_call(client, {"turn_status": "full", "parts": parts, "addressee": "ann"})
        await asyncio.sleep(3.0)
        reading.cancel()
    return told, found


def judged_without_a_look(found: list[Any]) -> list[tuple[str, str]]:
    """Events of the robot that a person "answered" although the gaze that they are about never came."""
    came = {each.behavior for each in found if isinstance(each, SyncPointProgress) and each.sync == "stroke"}
    gazes = {"turn-gaze-event": ["turn-gaze"], "refer-1-event": ["refer-1-gaze", "refer-1-point"]}
    return [
        (each.kind, each.state)
        for each in found
        if isinstance(each, ConnectionEvent)
        and each.state in ("succeeded", "failed", "completed")
        and each.behavior in gazes
        and not came & {*gazes[each.behavior]}
    ]


@pytest.mark.parametrize("place", OUT_OF_SIGHT.values(), ids=OUT_OF_SIGHT)
async def test_eyes_that_cannot_be_met_are_not_met(hub: MemoryHub, place: tuple[float, float, float]) -> None:
    told, found = await performed(hub, [SAY], ann_at=place)

    assert (told.status, told.said) == ("done", SAY["say"])
    assert told.eye_contact is None
    assert judged_without_a_look(found) == []


@pytest.mark.parametrize("place", OUT_OF_SIGHT.values(), ids=OUT_OF_SIGHT)
async def test_a_thing_that_cannot_be_looked_at_was_not_looked_at(
    hub: MemoryHub, place: tuple[float, float, float]
) -> None:
    told, found = await performed(hub, [{"refer": "cup"}, SAY], cup_at=place)

    assert told.status == "done"
    assert [(each.by, each.looked) for each in told.references] == [("words alone", None)]
    assert judged_without_a_look(found) == []


@pytest.mark.parametrize("fault", FAULTS.values(), ids=FAULTS)
async def test_a_head_that_fails_meets_no_eyes(hub: MemoryHub, fault: BodyFault) -> None:
    told, found = await performed(hub, [SAY], fault=fault)

    assert (told.said, told.eye_contact) == (SAY["say"], None)
    # The event begins with the head's motion. A person who looks at the robot already shares it until that fails.
    shared = [each for each in found if isinstance(each, ConnectionEvent) and each.behavior == "turn-gaze-event"]
    assert {each.state for each in shared} <= {"started", "withdrawn", "succeeded", "completed"}
    assert all(each.duration == 0.0 for each in shared if each.state == "completed")


# -- whoever performs it dies --------------------------------------------------------------------------------------


async def asked(client: Robot, how: str) -> str:
    """Say something long, by one of the ways there are. Returns the status that is told."""
    if how == "a tool call":
        return (await perform_call(client, {"turn_status": "full", "parts": [{"say": WORDS}]})).status

    async def pieces() -> AsyncIterator[str]:
        yield WORDS + "."

    return summary(*await stream(client, pieces(), id="s")).status


@pytest.mark.parametrize("how", ["a tool call", "a stream"])
@pytest.mark.parametrize("service", ["generation", "realizer"])
@pytest.mark.parametrize("after", [2.0, 0.5, 6.0][: share_of(3, 3)])
@pytest.mark.parametrize("is_back", [False, True])
async def test_what_died_while_it_spoke_leaves_the_rest_unknown(
    hub: MemoryHub, how: str, service: str, after: float, *, is_back: bool
) -> None:
    async with robot(hub, service) as (client, life), perceive("ann", hub=hub):
        await asyncio.sleep(1.0)
        speaking = asyncio.create_task(asked(client, how))
        await asyncio.sleep(after)
        await life.aclose()
        if not is_back:
            assert await speaking == "unknown"
            return
        config = load(settings=["simulation.human=none"])
        async with running(hub, {service: roster.service(service, config)}):
            assert await speaking == "unknown"


@pytest.mark.parametrize("service", ["generation", "realizer"])
async def test_the_outcome_of_a_fragment_is_unknown_too(hub: MemoryHub, service: str) -> None:
    async with robot(hub, service) as (client, life), perceive("ann", hub=hub):
        await asyncio.sleep(1.0)
        fragment = TurnFragment(id="f", turn_status="full", behaviors=(Speech(id="s", text=WORDS),))
        speaking = asyncio.create_task(client.perform(fragment))
        await asyncio.sleep(2.0)
        await life.aclose()
        with pytest.raises((PerformFailed, OutcomeUnknown), match=f"{service} has not been seen for") as failed:
            await speaking

    # Where generation itself has gone there is no outcome: nobody could tell one.
    assert isinstance(failed.value, OutcomeUnknown) or failed.value.outcome.status == "unknown"
    assert isinstance(failed.value, OutcomeUnknown) is (service == "generation")


@pytest.mark.parametrize("is_back", [False, True])
async def test_an_answer_that_nobody_will_tell_is_not_waited_for(hub: MemoryHub, *, is_back: bool) -> None:
    async with robot(hub, "generation") as (client, life), perceive("ann", hub=hub) as ann:
        await ann.look_at(ann.robot)
        await asyncio.sleep(1.0)
        began = client.now()
        call = {"turn_status": "full", "parts": [{"say": "Which one?"}]}
        performing = asyncio.create_task(perform_call(client, call, await_answer=True))
        await asyncio.sleep(2.0)
        await life.aclose()
        if is_back:
            config = load(settings=["simulation.human=none"])
            await asyncio.sleep(0.3)
            await life.enter_async_context(running(hub, {"generation": roster.service("generation", config)}))
        told = await performing
        took = client.now() - began

    assert (told.status, told.said, told.answer) == ("done", "Which one?", None)
    assert told.problems == ("the answer is not known: the service that was to tell it has gone or was restarted",)
    assert took < 3.0


async def test_a_phrase_is_told_as_it_was_heard(hub: MemoryHub) -> None:
    told, _ = await performed(hub, [{"refer": "cup", "phrases": ["**the cup**"]}, {"say": "please"}])

    assert (told.said, [each.phrase for each in told.references]) == ("the cup please", ["the cup"])
