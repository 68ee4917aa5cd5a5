"""References that are chosen again before their words begin, and what is told of them: whole robots in memory."""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable, Iterable
from contextlib import AsyncExitStack, asynccontextmanager
from typing import Any

import pytest

from engage_hri import perceive
from engage_hri.schemas.body_faults import BodyFault
from engage_hri.schemas.summary import Referred, Summary, summary
from engage_hri.schemas.world import Entity
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.language_models import perform_call, stream
from engage_hri.services.client.robot import Robot, connect
from engage_hri.services.commandline.shell import roster
from engage_hri.services.commandline.shell.config import load
from engage_hri.services.runtime.service import running
from tests.generation import deeds
from tests.random_cases import share_of

Happens = Callable[[Any, Robot], Awaitable[None]]
CALL = {
    "turn_status": "full",
    "parts": [
        {"say": "Please take this very nice"},
        {"refer": "cup", "certainty": "high"},
        {"say": "from the table."},
    ],
}


def cup(*position: float) -> Entity:
    return Entity(id="cup", kind="object", position=position, category="cup")  # type: ignore[arg-type]


@asynccontextmanager
async def robot(
    hub: MemoryHub, *left_out: str, settings: Iterable[str] = ()
) -> AsyncIterator[tuple[Robot, AsyncExitStack]]:
    config = load(settings=["simulation.human=none", *settings])
    names = [name for name in (*roster.ROBOT, "simulation") if name not in left_out]
    services = {name: roster.service(name, config) for name in names}
    async with running(hub, services), connect(hub=hub) as client, AsyncExitStack() as others:
        for name in left_out:
            await others.enter_async_context(running(hub, {name: roster.service(name, config)}))
        yield client, others


async def performed(hub: MemoryHub, happens: Happens, call: dict[str, Any] = CALL) -> Summary:
    async with robot(hub) as (client, _), perceive("ann", hub=hub) as ann:
        ann.bring(cup(0.5, 0.2, 0.8))
        await ann.look_at(ann.robot)
        await asyncio.sleep(1.0)
        performing = asyncio.create_task(perform_call(client, call))
        await happens(ann, client)
        return await performing


async def test_nothing_happens_and_the_robot_points(hub: MemoryHub) -> None:
    async def nothing(ann: Any, client: Robot) -> None: ...

    told = await performed(hub, nothing)

    assert told.said == "Please take this very nice this from the table."
    assert [(each.by, each.phrase) for each in told.references] == [("pointing", "this")]


@pytest.mark.parametrize("delay", [0.6, 0.05, 0.3, 0.9, 1.2][: share_of(5, 3)])
@pytest.mark.parametrize("place", [(-1.0, 0.2, 0.8), (-0.5, 0.6, 0.8)])
async def test_a_reference_whose_object_goes_out_of_reach_is_made_without_the_hand(
    hub: MemoryHub, delay: float, place: tuple[float, float, float]
) -> None:
    async def moves(ann: Any, client: Robot) -> None:
        await asyncio.sleep(delay)
        ann.bring(cup(*place))

    told = await performed(hub, moves)

    assert told.status == "done"
    (made,) = told.references
    assert made.by in ("words alone", "a look")
    assert made.phrase == "the cup"
    assert told.said == "Please take this very nice the cup from the table."


async def test_an_object_that_comes_to_another_place_within_reach_is_pointed_at_there(hub: MemoryHub) -> None:
    async def moves(ann: Any, client: Robot) -> None:
        await asyncio.sleep(0.5)
        ann.bring(cup(0.45, -0.2, 0.8))

    told = await performed(hub, moves)

    assert [each.by for each in told.references] == ["pointing"]


@pytest.mark.parametrize("part", ["left_arm", "head"])
async def test_a_reference_is_chosen_again_if_the_body_breaks_off_its_gesture(hub: MemoryHub, part: str) -> None:
    before = "stroke_start" if part == "left_arm" else "stroke"

    async def breaks(ann: Any, client: Robot) -> None:
        await client.switch_on(BodyFault(kind="overheated", part=part, before=before))

    told = await performed(hub, breaks)

    assert told.status == "done"
    assert [each.phrase for each in told.references] == ["the cup"]
    assert told.said == "Please take this very nice the cup from the table."


async def test_punctuation_that_was_said_with_its_phrase_is_not_said_again_with_the_rest(hub: MemoryHub) -> None:
    async def breaks(ann: Any, client: Robot) -> None:
        await asyncio.sleep(2.0)  # "this," is said by then
        await client.switch_on(BodyFault(kind="overheated", part="left_arm", before="stroke_start"))

    refer = {"refer": "cup", "certainty": "high"}
    says = ("Please take", ",", "and put the other things around", "on the table.")
    first, comma, between, last = ({"say": each} for each in says)
    call = {"turn_status": "full", "parts": [first, refer, comma, between, refer, last]}
    told = await performed(hub, breaks, call)

    assert told.said == "Please take this, and put the other things around it on the table."


async def test_words_that_have_begun_are_said_and_a_warning_tells_that_nothing_was_shown(hub: MemoryHub) -> None:
    async def breaks(ann: Any, client: Robot) -> None:
        await client.switch_on(BodyFault(kind="overheated", part="left_arm", before="stroke"))

    told = await performed(hub, breaks)

    assert [(each.by, each.phrase, each.looked) for each in told.references] == [("a look", "this", None)]
    assert "refer-2: 'this' was said, but the point at cup did not come" in told.problems


async def test_a_turn_ends_once_its_addressee_has_left_and_says_so(hub: MemoryHub) -> None:
    async def leaves(ann: Any, client: Robot) -> None:
        await asyncio.sleep(0.6)
        await ann.leave()

    call = {"turn_status": "full", "parts": [{"say": "one two three four five six seven eight nine ten " * 3}]}
    told = await performed(hub, leaves, call)

    assert told.status == "interrupted"
    assert told.cut_short
    assert any("ann has left" in each for each in told.problems), told.problems


@pytest.mark.parametrize("service", ["generation", "realizer"])
async def test_what_a_service_that_died_was_doing_is_unknown_and_not_refused(hub: MemoryHub, service: str) -> None:
    async with robot(hub, service) as (client, life), perceive("ann", hub=hub):
        await asyncio.sleep(1.0)
        call = {"turn_status": "full", "parts": [{"say": "one two three four five six seven eight nine ten " * 3}]}
        performing = asyncio.create_task(perform_call(client, call))
        await asyncio.sleep(3.0)
        await life.aclose()
        told = await performing

    assert told.status == "unknown"
    assert told.said.startswith("one two three") is (service == "realizer")


@pytest.mark.parametrize("dies_after", [0.2, 1.0, 2.5])
@pytest.mark.parametrize("answers", [True, False])
async def test_who_was_asked_has_answered_though_the_realizer_died_after_the_question(
    hub: MemoryHub, dies_after: float, *, answers: bool
) -> None:
    async with robot(hub, "realizer") as (client, life), perceive("ann", hub=hub) as ann:
        await ann.look_at(ann.robot)
        await asyncio.sleep(1.0)
        call = {"turn_status": "full", "parts": [{"say": "Which one do you like?"}]}
        performing = asyncio.create_task(perform_call(client, call, await_answer=True))
        await asyncio.sleep(2.0 + dies_after)
        await life.aclose()
        if answers:
            await ann.say("the blue one")
        told = await performing

    assert (told.status, told.answer) == ("done", "speak" if answers else "none")
    assert [each.text for each in told.heard] == ["the blue one"] * answers


async def test_whether_a_turn_is_answered_of_which_the_realizer_died_is_not_known(hub: MemoryHub) -> None:
    async with robot(hub, "realizer") as (client, life), perceive("ann", hub=hub) as ann:
        await ann.look_at(ann.robot)
        await asyncio.sleep(1.0)
        call = {"turn_status": "full", "parts": [{"say": "one two three four five six seven eight nine ten " * 3}]}
        performing = asyncio.create_task(perform_call(client, call, await_answer=True))
        await asyncio.sleep(3.0)
        await life.aclose()
        told = await performing

    assert (told.status, told.answer) == ("unknown", None)


async def test_a_stream_whose_first_fragment_is_refused_is_refused(hub: MemoryHub) -> None:
    async def pieces() -> AsyncIterator[str]:
        yield "Hello there."

    async with (
        robot(hub) as (client, _),
        perceive("ann", hub=hub),
        perceive("bob", hub=hub, position=(1.0, 1.0, 1.3)),
    ):
        await asyncio.sleep(1.0)
        outcomes = await stream(client, pieces(), id="s")

    told = summary(*outcomes)
    assert told.status == "refused"
    assert not told.cut_short


@pytest.mark.parametrize("seed", range(share_of(12)))
def test_an_independent_reader_of_the_robot_finds_no_difference(seed: int) -> None:
    assert deeds.run(seed) == []


def test_the_reader_finds_what_is_told_wrongly() -> None:
    place, eyes = (0.5, 0.0, 0.8), (0.0, 0.0, 1.2)
    reader = deeds.Reader()
    for message in (
        {"type": "world", "entities": [{"id": "cup", "position": place}, {"id": "hat", "position": (0.5, 0.4, 0.8)}]},
        {"type": "robot_state", "gaze": {"origin": eyes, "axis": (0.780869, 0.0, -0.624695)}},
        {"type": "block_progress", "progress": "start", "block": "f"},
        {"type": "sync_point_progress", "block": "f", "behavior": "r-gaze", "sync": "stroke"},
        {"type": "word_spoken", "block": "f", "behavior": "r-phrase", "word": "this"},
        {"type": "block_progress", "progress": "end", "block": "f", "status": "done"},
    ):
        reader.take(message, 1.0)

    def told(object: str = "cup", by: str = "a look", said: str = "this", status: Any = "done") -> list[str]:
        references = (Referred(object=object, phrase="this", by=by),)
        result = Summary(status=status, said=said, references=references)
        return deeds.compared("t", result, ["f"], reader, {("f", "r"): object}, 0.0, 2.0)

    assert told() == []
    assert [len(told(by="pointing")), len(told(said="this one")), len(told(status="failed"))] == [1, 1, 1]
    assert told(object="hat") == ["t: r: a look, but 32 degrees off hat"]
    assert (
        len(deeds.compared("t", Summary(status="done", said="this"), ["f"], reader, {("f", "r"): "cup"}, 0.0, 2.0))
        == 1
    )
