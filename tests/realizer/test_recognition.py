"""What the realizer asks recognition for, and tells it, whenever recognition comes, goes, or cannot be heard."""

import asyncio

import pytest

from engage_hri.schemas.behaviors import Event, Speech, TurnSignal
from engage_hri.schemas.recognition import EventOutcome, RequestEvent
from engage_hri.services.bus.deadlines import LATE
from engage_hri.services.bus.interface import Bus
from engage_hri.services.requests.ends import RequestDesk
from engage_hri.services.runtime.service import running
from tests.realizer.fake_body import FakeBody, Script
from tests.realizer.stage import FakeRecognition, Stage, after, block, stage
from tests.standing_still import stand_still

EVENT = Event(id="e", kind="backchannel", responder="human", limit=2.0)
WAITING = block((EVENT, Speech(id="s", text="so")), after("e:end", "s:start"))
ENDED = block((TurnSignal(id="x", turn="t1", signal="ended", actor="human"),))


def source(seen: Stage) -> tuple[float, str]:
    """When the event was decided, and who said so."""
    (end,) = [each for each in seen.progress() if (each.behavior, each.sync) == ("e", "end")]
    return end.time, end.source


# -- connection events ---------------------------------------------------------------------------------------------


async def test_recognition_that_comes_back_knows_nothing_of_an_event_and_the_clock_decides_it_at_once() -> None:
    async with stage(recognition=FakeRecognition({"e": None})) as seen:
        pending = seen.ask(WAITING)
        await asyncio.sleep(0.5)
        seen.hub.kill("recognition")
        await asyncio.sleep(0.25)
        again = FakeRecognition({"e": 0.25})
        async with running(seen.hub, {"recognition": again.serve}):
            await pending.outcome

    assert source(seen) == (0.75, "clock")
    assert again.events == []


class Slow(FakeRecognition):
    """Says half a second later what it has seen."""

    async def _decide(self, bus: Bus, desk: RequestDesk, request: RequestEvent) -> None:
        await asyncio.sleep(0.5)
        seen = bus.stamp(bus.now() - 0.5)
        desk.end(EventOutcome(id=request.id, event="e1", state="succeeded", at=seen))


async def test_an_event_is_decided_when_recognition_says_it_was_and_not_when_that_is_heard() -> None:
    async with stage(recognition=Slow()) as seen:
        await seen.perform(WAITING)

    assert source(seen) == (0.0, "body")
    assert seen.times()["s:start"] == 0.5


async def test_an_event_that_is_not_decided_in_the_time_that_recognition_has_promised_is_asked_for_no_more() -> None:
    recognition = FakeRecognition({"e": None})
    async with stage(recognition=recognition) as seen:
        await seen.perform(WAITING)

    assert source(seen) == (12.0, "clock")
    assert recognition.cancelled == ["r-b/e"]


async def test_a_recognizer_that_promises_nothing_has_thirty_seconds() -> None:
    recognition = FakeRecognition({"e": None})
    recognition.within = None
    async with stage(recognition=recognition) as seen:
        await seen.perform(WAITING)

    assert source(seen) == (30.0, "clock")


@pytest.mark.parametrize("spoken", [1.0, 11.0, 13.0, 40.0, 200.0])
async def test_the_promised_time_counts_from_the_last_deed_of_the_robot(spoken: float) -> None:
    """However long it speaks: only then the turn is over, and the answer is waited for."""
    recognition = FakeRecognition({"e": None})
    said, then = Speech(id="s", text="so"), Speech(id="t", text="what now")
    async with stage(FakeBody(estimates={"s": (spoken,)}, scripts={"s": Script((spoken,))}), recognition) as seen:
        await seen.perform(block((EVENT, said, then), after("e:end", "t:start")))

    assert seen.times()["s:end"] == spoken
    assert source(seen) == (spoken + 12.0, "clock")
    assert recognition.cancelled == ["r-b/e"]


# -- turns ---------------------------------------------------------------------------------------------------------


async def test_who_comes_later_is_not_told_of_a_turn_that_is_long_over() -> None:
    late = FakeRecognition()
    async with stage() as seen:
        await seen.perform(ENDED)
        async with running(seen.hub, {"recognition": late.serve}):
            await asyncio.sleep(60.0)

    assert late.signals == []


@pytest.mark.parametrize("is_cut", [True, False])
async def test_who_is_there_is_told_of_a_turn_also_if_the_link_was_cut_just_then(*, is_cut: bool) -> None:
    recognition = FakeRecognition()
    async with stage(recognition=recognition) as seen:
        if is_cut:
            seen.hub.partition("recognition")
        await seen.perform(ENDED)
        assert len(recognition.signals) == (0 if is_cut else 1)
        seen.hub.heal()
        await asyncio.sleep(60.0)

    assert [each.signal.signal for each in recognition.signals] == ["ended"]
    assert {each.block for each in recognition.signals} == {"b"}


@pytest.mark.parametrize(("came", "by"), [(0.5 * LATE, "body"), (2.0 * LATE, "clock")])
async def test_a_decision_that_came_while_the_realizer_stood_still_is_heard_first(came: float, by: str) -> None:
    """It is promised for 12.0; the realizer stands still from 11.9 to 12.5."""
    async with stage(recognition=FakeRecognition({"e": 12.5 + came})) as seen:
        asyncio.get_running_loop().call_at(asyncio.get_running_loop().time() + 11.9, stand_still, 12.5)
        await seen.perform(WAITING)

    assert source(seen)[1] == by
