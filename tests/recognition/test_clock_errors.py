"""Errors of delays between instants of several clocks. `lab/test_time.py` has them on clocks of machines."""

import asyncio
from functools import partial
from math import inf

import msgspec
import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.perception import ActionBegan
from engage_hri.schemas.recognition import ConnectionEvent, EventOutcome, EventState
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.bus.memory import MemoryBus, MemoryHub
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.perceive.clocks import KEPT, PEOPLE_KEPT, ClockErrors
from engage_hri.services.recognition.service import recognize
from engage_hri.services.recognition.statistics.tally import EventTally
from engage_hri.services.runtime.service import running
from tests.recognition.observations import HUMAN, ROBOT

ERRORS = {"far": 0.02, "farther": 0.3, "new": inf}


def event(state: EventState, delay: Seconds | None, id: str = "1", started: Seconds = 100.0) -> ConnectionEvent:
    stamp = Stamp("own", started)
    return ConnectionEvent(
        id=id, kind="directed_gaze", initiator="robot", responder="ann", state=state, at=stamp, started=stamp,
        delay=delay,
    )  # fmt: skip


def test_both_ends_count_and_nobody_else() -> None:
    errors = ClockErrors("robot")
    for actor, at, error in (("robot", 100.0, 0.02), ("ann", 100.5, 0.3), ("bob", 100.5, 7.0)):
        errors.heard(actor, at, error)
    assert errors.marked(event("succeeded", 0.5)).delay_error == pytest.approx(0.32)


def test_a_delay_keeps_its_error_until_its_event_ends_and_only_what_is_older_is_left_out() -> None:
    errors = ClockErrors("robot")
    errors.heard("ann", 99.0, 5.0)
    errors.heard("ann", 100.5, 0.3)
    assert errors.marked(event("started", None)).delay_error == 0.0
    assert errors.marked(event("succeeded", 0.5)).delay_error == pytest.approx(0.3)
    errors.heard("ann", 101.0, 9.0)
    assert errors.marked(event("completed", 0.5)).delay_error == pytest.approx(0.3)
    assert errors.marked(event("succeeded", 0.5)).delay_error == pytest.approx(9.0)  # another one, with its id


def test_the_answer_to_who_asked_for_an_event_has_the_error_of_that_event() -> None:
    errors = ClockErrors("robot")
    errors.heard("ann", 100.0, 0.25)
    changes = [errors.marked(event("succeeded", 0.5)), errors.marked(event("failed", None, id="2"))]
    outcome = EventOutcome(id="r", event="1", state="succeeded", at=Stamp("own", 100.0), delay=0.5)

    assert errors.marked_as(outcome, changes).delay_error == 0.25
    assert errors.marked_as(msgspec.structs.replace(outcome, delay=None), changes).delay_error == 0.0
    assert errors.marked_as(msgspec.structs.replace(outcome, event="3"), changes).delay_error == 0.0


def test_an_error_that_is_not_known_is_told_as_none() -> None:
    errors = ClockErrors("robot")
    errors.heard("ann", 100.0, inf)
    assert errors.marked(event("succeeded", 0.5)).delay_error is None


def test_what_is_remembered_is_bounded() -> None:
    errors = ClockErrors("robot")
    errors.heard("robot", 0.0, 5.0)
    for second in range(1, 1000):
        errors.heard("robot", float(second), 0.01)
    for number in range(3 * PEOPLE_KEPT):
        errors.heard(f"person-{number}", 1000.0, 0.02)
    assert len(errors._errors) == PEOPLE_KEPT
    assert len(errors._errors["robot"]) <= KEPT + 1
    assert errors.marked(event("failed", 1.0, started=999.0)).delay_error == pytest.approx(0.01)


def test_statistics_tell_the_greatest_error() -> None:
    tally = EventTally(60.0)
    for number, (state, error) in enumerate([("succeeded", 0.01), ("failed", 0.04), ("succeeded", None)]):
        errors = ClockErrors("robot")
        errors.heard("ann", 100.0, inf if error is None else error)
        tally.feed(event("started", None, str(number)))
        tally.feed(errors.marked(event(state, 0.5, str(number))))
    found = {one.kind: one.delay_error for one in tally.session().kinds}
    assert found.pop("directed_gaze") == pytest.approx(0.04)
    assert set(found.values()) == {0.0}


async def test_recognition_tells_the_error_of_the_clocks_of_both(
    hub: MemoryHub, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(MemoryBus, "error", lambda bus, clock: ERRORS.get(clock, 0.0))
    recognition = partial(recognize, config=RecognitionConfig())
    bus = hub.join("teller")
    async with running(hub, {"recognition": recognition}):
        with bus.subscribe(keys.ANY_CONNECTION_EVENT) as events:
            for clock, expected in (("loop", 0.3), ("far", 0.32), ("new", None)):
                bus.publish(keys.PERCEIVED_ACTION, _look(HUMAN, "farther", bus.now(), ROBOT))
                bus.publish(keys.ROBOT_ACTION, _look(ROBOT, clock, bus.now(), HUMAN))
                told = [(await events.next()).message for _ in range(2)]
                assert [one.state for one in told] == ["started", "succeeded"]
                assert told[0].delay_error == 0.0
                assert told[1].delay_error == (expected and pytest.approx(expected))
                await asyncio.sleep(1.0)
                bus.publish(keys.ROBOT_ACTION, _look(ROBOT, clock, bus.now()))
                bus.publish(keys.PERCEIVED_ACTION, _look(HUMAN, "farther", bus.now()))
                assert (await events.next()).message.delay_error == told[1].delay_error
                await asyncio.sleep(2.0)


def _look(actor: str, clock: str, at: Seconds, *targets: str) -> ActionBegan:
    return ActionBegan(actor=actor, action="look", at=Stamp(clock, at), targets=targets)
