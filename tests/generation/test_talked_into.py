"""People who speak into the robot's turn, and people who are out of sight for a moment: whole robots in memory."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager

import pytest

from engage_hri import perceive
from engage_hri.schemas.summary import Summary, summary
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.language_models import perform_call, stream
from engage_hri.services.client.robot import Robot, connect
from engage_hri.services.commandline.shell import roster
from engage_hri.services.commandline.shell.config import load
from engage_hri.services.runtime.service import running
from tests.random_cases import share_of

LONG = "Here I tell you a story that takes a while, of seven pieces, and of a cat that really wanted to be a boat."
LONG_FRAGMENT = {
    "id": "f",
    "turn_status": "full",
    "behaviors": [{"type": "speech", "id": "s", "text": LONG}],
}
ASKED = "Which one of them do you like best?"


@asynccontextmanager
async def robot(hub: MemoryHub, *settings: str) -> AsyncIterator[Robot]:
    config = load(settings=["simulation.human=none", *settings])
    services = {name: roster.service(name, config) for name in (*roster.ROBOT, "simulation")}
    async with running(hub, services), connect(hub=hub) as client:
        yield client


def call(text: str, **more: object) -> dict[str, object]:
    return {"turn_status": "full", "parts": [{"say": text}], **more}


# -- words take the floor ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "line",
    [
        "stop",
        "wait",
        "Halt!",
        "no",
        "attends un peu",
        "待って",
        "стой",
        "Can I ask you something first?",
    ],
)
async def test_a_typed_line_stops_the_robot_and_is_its_answer(hub: MemoryHub, line: str) -> None:
    async with robot(hub) as client, perceive("ann", hub=hub) as ann:
        await ann.look_at(ann.robot)
        await asyncio.sleep(1.0)
        performing = asyncio.create_task(perform_call(client, call(LONG), await_answer=True))
        await asyncio.sleep(1.5)
        typed = client.now()
        await ann.type(line)
        told = await performing
        spoke_on = client.now() - typed

    assert (told.status, told.answer) == ("interrupted", "speak")
    assert [each.text for each in told.heard] == [line]
    assert spoke_on < 4.0


@pytest.mark.parametrize("line", ["okay", "yes, yes", "mhm", "genau"])
async def test_typed_words_of_a_listener_let_the_robot_go_on(hub: MemoryHub, line: str) -> None:
    async with robot(hub) as client, perceive("ann", hub=hub) as ann:
        await ann.look_at(ann.robot)
        await asyncio.sleep(1.0)
        performing = asyncio.create_task(perform_call(client, call(LONG), await_answer=False))
        await asyncio.sleep(1.5)
        await ann.type(line)
        told = await performing

    assert told.status == "done"


@pytest.mark.parametrize(
    ("words", "seconds", "stops"),
    [
        ("stop", 0.35, True),
        ("no no no", 0.5, True),
        ("wait a second", 0.7, True),
        ("that is wrong", 0.6, True),
        ("warte mal", 0.5, True),
        ("mhm", 0.4, False),
        ("mhm", 0.7, False),
        ("yes yes okay", 1.2, False),
        ("okay", 0.5, False),
        ("ja genau", 0.9, False),
        ("うん うん", 0.9, False),
    ],
)
async def test_words_decide_and_not_their_length(hub: MemoryHub, words: str, seconds: float, *, stops: bool) -> None:
    async with robot(hub) as client, perceive("ann", hub=hub) as ann:
        await ann.look_at(ann.robot)
        await asyncio.sleep(1.0)
        performing = asyncio.create_task(perform_call(client, call(LONG)))
        await asyncio.sleep(1.5)
        await ann.say(words, seconds=seconds)
        told = await performing

    assert told.status == ("interrupted" if stops else "done")


@pytest.mark.parametrize(("words", "stops"), [("stop", True), ("uh-huh", False)])
@pytest.mark.parametrize("index", [2, 3])
async def test_words_decide_in_whichever_turn_of_the_robot(
    hub: MemoryHub, words: str, index: int, *, stops: bool
) -> None:
    async with robot(hub) as client, perceive("ann", hub=hub) as ann:
        await ann.look_at(ann.robot)
        await asyncio.sleep(1.0)
        await perform_call(client, call("Well,", turn_index=2))
        performing = asyncio.create_task(perform_call(client, call(LONG, turn_index=index)))
        await asyncio.sleep(1.5)
        await ann.say(words, seconds=0.35)
        told = await performing

    assert told.status == ("interrupted" if stops else "done")
    assert [(each.text, each.reading) for each in told.interjections] == [
        (words, "interruption" if stops else "backchannel")
    ]


@pytest.mark.parametrize("first", ["held", "spoken into"])
async def test_what_a_manager_holds_does_not_go_on_after_an_interjection(hub: MemoryHub, first: str) -> None:
    async with robot(hub) as client, perceive("ann", hub=hub) as ann:
        await ann.look_at(ann.robot)
        await asyncio.sleep(1.0)
        performing = asyncio.create_task(client.perform(LONG_FRAGMENT))
        await asyncio.sleep(1.5)
        if first == "held":
            await client.hold("f")
            await ann.say("uh-huh", seconds=0.5)
        else:
            saying = asyncio.create_task(ann.say("uh-huh", seconds=0.5))
            await asyncio.sleep(0.2)
            await client.hold("f")
            await saying
        await asyncio.sleep(12.0)
        is_over = performing.done()
        await client.resume("f")
        told = await performing

    assert not is_over
    assert told.status == "done"


@pytest.mark.parametrize(("seconds", "stops"), [(0.6, False), (1.1, False), (1.7, True)])
async def test_where_no_words_come_while_somebody_speaks_the_seconds_of_voice_decide(
    hub: MemoryHub, seconds: float, *, stops: bool
) -> None:
    async with robot(hub) as client, perceive("ann", hub=hub) as ann:
        await ann.look_at(ann.robot)
        await asyncio.sleep(1.0)
        performing = asyncio.create_task(perform_call(client, call(LONG), await_answer=True))
        await asyncio.sleep(1.5)
        await ann.say("yes yes okay", seconds=seconds, partial=False)
        told = await performing

    assert told.status == ("interrupted" if stops else "done")
    assert [each.text for each in told.heard] == ["yes yes okay"]


# -- one act, and two judges of it ---------------------------------------------------------------------------------


@pytest.mark.parametrize("barge_in", [0.5, 0.75, 0.8, 0.85, 1.0])
@pytest.mark.parametrize("after", [1.73, 0.4, 1.1, 2.6][: share_of(4, 4)])
@pytest.mark.parametrize("has_words", [True, False])
async def test_who_interrupts_has_answered_wherever_the_threshold_stands(
    hub: MemoryHub, barge_in: float, after: float, *, has_words: bool
) -> None:
    async with robot(hub, f"generation.barge_in={barge_in}") as client, perceive("ann", hub=hub) as ann:
        await ann.look_at(ann.robot)
        await asyncio.sleep(1.0)
        performing = asyncio.create_task(perform_call(client, call(LONG), await_answer=True))
        await asyncio.sleep(after)
        if has_words:
            await ann.say("no not that one please", seconds=1.6)
        else:
            ann.begin("speak")
            await asyncio.sleep(1.6)
            ann.end("speak")
        told = await performing

    assert (told.status, told.answer) == ("interrupted", "speak")
    assert bool(told.heard) is has_words


# -- out of sight for a moment -------------------------------------------------------------------------------------


async def lost(hub: MemoryHub, gaps: list[tuple[float, float]], answer_at: float = 5.0) -> Summary:
    """Ask somebody who is out of sight at some times (since when, for how long) and then answers."""
    async with robot(hub) as client, AsyncExitStack() as stack:
        life = await stack.enter_async_context(AsyncExitStack())
        ann = await life.enter_async_context(perceive("ann", hub=hub))
        await ann.look_at(ann.robot)
        await asyncio.sleep(1.0)
        began = client.now()
        performing = asyncio.create_task(perform_call(client, call(ASKED, within=6), await_answer=True))
        for since, seconds in gaps:
            await asyncio.sleep(began + since - client.now())
            await life.aclose()
            await asyncio.sleep(seconds)
            life = await stack.enter_async_context(AsyncExitStack())
            ann = await life.enter_async_context(perceive("ann", hub=hub))
            await ann.look_at(ann.robot)
        await asyncio.sleep(began + answer_at - client.now())
        await ann.say("the blue one")
        return await performing


@pytest.mark.parametrize(
    "gaps",
    [
        [(0.3, 1.0)], [(1.2, 1.5)], [(2.0, 1.8)], [(2.6, 0.7)], [(2.9, 1.8)], [(3.2, 1.2)], [(0.5, 0.4), (2.5, 0.6)],
        [(1.0, 1.5), (3.0, 1.5)], [(0.4, 0.3), (1.2, 0.3), (2.2, 0.3), (3.3, 0.3)], [(0.1, 1.8), (2.5, 1.8)],
    ],
)  # fmt: skip
async def test_who_is_out_of_sight_for_up_to_two_seconds_can_still_answer(
    hub: MemoryHub, gaps: list[tuple[float, float]]
) -> None:
    told = await lost(hub, gaps)

    assert (told.status, told.answer) == ("done", "speak")
    assert [each.text for each in told.heard] == ["the blue one"]


async def test_who_is_gone_for_longer_has_left(hub: MemoryHub) -> None:
    told = await lost(hub, [(2.0, 6.0)], answer_at=9.0)

    assert told.answer == "none"


# -- while nobody has written the next piece -----------------------------------------------------------------------


@pytest.mark.parametrize("how", ["typed", "said"])
@pytest.mark.parametrize("after", [2.0, 3.0, 4.5])
async def test_who_speaks_while_the_writer_thinks_is_heard(hub: MemoryHub, how: str, after: float) -> None:
    read_on = False

    async def pieces() -> AsyncIterator[str]:
        nonlocal read_on
        yield "One moment please. "
        await asyncio.sleep(8.0)
        read_on = True
        yield "Here it is. "

    async with robot(hub) as client, perceive("ann", hub=hub) as ann:
        await ann.look_at(ann.robot)
        await asyncio.sleep(1.0)
        began = client.now()
        streaming = asyncio.create_task(stream(client, pieces(), id="s"))
        await asyncio.sleep(after)
        await (ann.type("wait, which one?") if how == "typed" else ann.say("wait, which one?", seconds=1.2))
        told = summary(*await streaming)
        took = client.now() - began

    assert (told.status, told.said) == ("interrupted", "One moment please.")
    assert [each.text for each in told.heard] == ["wait, which one?"]
    assert any("ann took the floor" in each for each in told.problems), told.problems
    assert took < 8.0
    assert not read_on


async def test_a_writer_who_is_silent_for_too_long_is_told_so(hub: MemoryHub) -> None:
    async def pieces() -> AsyncIterator[str]:
        yield "One moment please. "
        await asyncio.sleep(20.0)
        yield "Here it is. "

    async with robot(hub) as client, perceive("ann", hub=hub) as ann:
        await ann.look_at(ann.robot)
        await asyncio.sleep(1.0)
        told = summary(*await stream(client, pieces(), id="s"))

    assert told.status == "interrupted"
    assert any("silence for 10 s" in each for each in told.problems), told.problems


# -- the robot's own "uh-huh" --------------------------------------------------------------------------------------


@pytest.mark.parametrize("parts", [[{"say": "uh-huh"}], [{"gesture": "nod"}], [{"gesture": "nod"}, {"say": "mhm"}]])
@pytest.mark.parametrize("delay", [0.3, 0.0, 1.0, 3.0][: share_of(4, 4)])
async def test_an_announced_sign_of_the_robot_answers_nobody(
    hub: MemoryHub, parts: list[dict[str, str]], delay: float
) -> None:
    async with robot(hub) as client, perceive("ann", hub=hub) as ann:
        with client.connection_events("ann", ("adjacency_pair", "backchannel")) as events:
            await ann.look_at(ann.robot)
            await asyncio.sleep(1.0)
            await ann.say("could you tell me which one you like", seconds=2.0)
            await asyncio.sleep(delay)
            told = await perform_call(client, {"turn_status": "backchannel", "parts": parts})
            states = []
            while (event := await events.next(0.3)) is not None:
                states.append((event.kind, event.initiator, event.state))

    assert told.status == "done"
    assert [state for kind, who, state in states if (kind, who) == ("adjacency_pair", "ann")][:1] == ["started"]
    assert ("adjacency_pair", "ann", "succeeded") not in states
    assert ("backchannel", "ann", "succeeded") in states
