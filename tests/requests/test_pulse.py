"""The pulse is the lease: not renewed is held, and then ended; given up is cancelled until that is answered."""

import asyncio
from itertools import pairwise
from typing import Any

import pytest
from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Wait
from engage_hri.schemas.body import BehaviorOutcome, PerformBehavior
from engage_hri.schemas.faults import EngageError, Fault, ServerRestarted
from engage_hri.schemas.requests import Accepted, Cancel, Heard, KeepAlive, Kept, Request
from engage_hri.schemas.units import Stamp
from engage_hri.services.bus.deadlines import LATE
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.requests.asking import Asking, Patience, PublishCommand, Renew, TellEnd
from engage_hri.services.requests.ends import RequestDesk
from engage_hri.services.requests.serving import Hand, HoldRequest, Serving
from engage_hri.services.requests.serving import PublishAnswer as Answered

MOVES = PerformBehavior(
    id="a", requester="me", life="1", block="b", behavior=Wait(id="w"), through="start", lease=4.0, held_after=0.5
)


def handed(effects: list[Any]) -> list[Request]:
    return [each.request for each in effects if isinstance(each, Hand)]


def pulse(serving: Serving, sent: float, now: float) -> list[Any]:
    kept = Kept("perform_behavior", "a", 0, "start", 4.0)
    return serving.keep_alive(KeepAlive(live=(kept,), at=Stamp("w", sent), requester="me", life="1"), sent, now)


def holds(effects: list[Any]) -> list[float | None]:
    return [each.until for each in effects if isinstance(each, HoldRequest)]


def test_what_is_not_renewed_is_held_goes_on_when_it_is_and_ends_with_its_lease() -> None:
    serving = Serving("control")
    serving.take(MOVES, 10.0)
    serving.answer("a", Accepted(id="a"), 10.0)
    assert holds(pulse(serving, 10.4, 10.4)) == []
    assert holds(serving.tick(10.9 - LATE - 0.01)) == []
    assert holds(serving.tick(10.9 - LATE)) == [14.4]
    assert holds(pulse(serving, 12.0, 12.1)) == [None]
    assert holds(serving.tick(12.5 - LATE)) == [16.0]
    (end,) = handed(serving.tick(16.0))
    assert isinstance(end, Cancel)
    assert end.cause == "unrenewed"


def test_a_renewal_that_was_long_on_its_way_lets_nothing_go_on() -> None:
    serving = Serving("control")
    serving.take(MOVES, 10.0)
    assert holds(serving.tick(10.5 - LATE)) == [14.0]
    assert holds(pulse(serving, 10.6, 11.2)) == []
    assert holds(pulse(serving, 11.1, 11.3)) == [None]


@pytest.mark.parametrize("again", [False, True])
@pytest.mark.parametrize("late", [ms / 1000 for ms in (0, 1, 20, 49, 51, 70, 99, 101, 200, 900)])
def test_a_body_is_held_later_only_by_the_lateness_of_its_server_and_not_for_what_that_hears_first(
    late: float, again: bool
) -> None:
    """`held_after` is 0.5 s. The server looks late once, or each time."""
    serving = Serving("control")
    serving.take(MOVES, 10.0)
    at, told, lateness = 10.0, list[float | None](), [late, late if again else 0.0]
    while not told:
        assert serving.deadline is not None
        at = max(serving.deadline, at) + lateness.pop(0)
        told = holds(serving.tick(at))

    assert at <= 10.5 + (0.0 if late < LATE else 2 * late if again else late) + 1e-9


def test_a_requester_that_goes_holds_it_at_once_and_one_without_held_after_goes_on() -> None:
    serving = Serving("control")
    serving.take(MOVES, 10.0)
    assert holds(serving.requester_gone("me", 10.1)) == [14.0]
    assert holds(serving.requester_there("me", "run", 11.0)) == []
    assert holds(pulse(serving, 11.1, 11.1)) == [None]

    serving = Serving("control")
    serving.take(replace(MOVES, held_after=0.0), 10.0)
    assert holds(serving.requester_gone("me", 10.1)) == []
    assert holds(serving.tick(11.9)) == []


def asked_to_move() -> Asking:
    asking = Asking("me", "1", Patience(lease=4.0))
    asking.server_there("control", "run", 10.0)
    asking.send(keys.BEHAVIOR, MOVES, 10.0)
    return asking


def test_what_is_not_answered_is_sent_again_after_0_3_s_and_twice_as_late_each_time_up_to_a_third_of_its_lease() -> (
    None
):
    asking, sent = Asking("me", "1", Patience()), list[float]()
    asking.server_there("control", "run", 10.0)
    asking.send(keys.BEHAVIOR, replace(MOVES, held_after=0.0), 10.0)
    for hundredth in range(1, 1001):
        at = 10.0 + hundredth / 100
        sent += [at for each in asking.tick(at) if isinstance(each, PublishCommand)]

    assert sent[:5] == pytest.approx([10.3, 10.9, 12.1, 12.1 + 4 / 3, 12.1 + 8 / 3], abs=0.021)


@pytest.mark.parametrize("again", [None, 12.0])
def test_what_has_not_ended_within_the_time_that_it_was_given_is_cancelled_then_and_not_before(again) -> None:
    asking, cancelled = asked_to_move(), list[float]()
    asking.send(keys.BEHAVIOR, MOVES, 10.0, within=3.0)
    asking.hear(Accepted(id="a", requester="me", life="1", kind="perform_behavior"), 10.01, "control")
    for tenth in range(1, 70):
        at = 10.0 + tenth / 10
        if at == again:
            asking.send(keys.BEHAVIOR, replace(MOVES, through="end"), at, within=3.0)
        effects = asking.tick(at)
        cancelled += [at for each in effects if isinstance(each, PublishCommand) and isinstance(each.message, Cancel)]

    assert cancelled[0] == pytest.approx(13.0 if again is None else 15.0)


@pytest.mark.parametrize(
    ("held_after", "longest"), [(0.5, 0.5 / 3), (0.15, 0.05), (0.03, 0.05)], ids=["as usual", "short", "too short"]
)
def test_it_is_renewed_three_times_within_held_after_and_twenty_times_a_second_at_most(
    held_after: float, longest: float
) -> None:
    asking = Asking("me", "1", Patience(lease=4.0))
    asking.server_there("control", "run", 10.0)
    asking.send(keys.BEHAVIOR, replace(MOVES, held_after=held_after), 10.0)
    asking.hear(Accepted(id="a", requester="me", life="1", kind="perform_behavior"), 10.001, "control")
    renewed = []
    for millisecond in range(2, 2001):
        at = 10.0 + millisecond / 1000
        renewed += [at for each in asking.tick(at) if isinstance(each, Renew)]

    assert max(after - before for before, after in pairwise(renewed)) <= longest + 0.0011
    assert len(renewed) < 2.0 / longest + 2


def test_what_is_not_accepted_yet_is_sent_as_often_since_it_may_have_begun() -> None:
    asking, at, sent = asked_to_move(), 10.0, list[float]()
    while at < 12.0:
        at += 0.01
        sent += [at for each in asking.tick(at) if isinstance(each, PublishCommand)]

    assert max(after - before for before, after in pairwise(sent)) <= 0.5 / 3 + 0.011


def test_while_the_server_is_gone_nothing_is_sent_and_what_is_given_up_is_cancelled_until_it_answers() -> None:
    asking = asked_to_move()
    asking.hear(Accepted(id="a", requester="me", life="1", kind="perform_behavior"), 10.01, "control")
    asking.server_gone("control", 11.0)
    during = [each for tenth in range(200) for each in asking.tick(11.0 + tenth / 10)]
    (end,) = during
    assert isinstance(end, TellEnd)
    assert isinstance(end.end, EngageError)
    assert end.end.fault.cause == "gone"

    cancels = list[float]()
    for tenth in range(100):
        effects = asking.server_there("control", "run", 40.0) if not tenth else asking.tick(40.0 + tenth / 10)
        cancels += [40.0 + tenth / 10 for each in effects if isinstance(each, PublishCommand)]
        assert all(isinstance(each.message, Cancel) for each in effects if isinstance(each, PublishCommand))
    assert len(cancels) == pytest.approx(7, abs=1)  # 0.3 s, doubling to 2 s
    outcome = BehaviorOutcome(
        id="a", requester="me", life="1", kind="perform_behavior", block="b", behavior="w", status="aborted",
        at=Stamp("w", 0.0),
    )  # fmt: skip
    asking.hear(outcome, 50.0, "control")
    assert [each for tenth in range(600) for each in asking.tick(50.0 + tenth / 10)] == []


def test_participants_that_come_and_go_are_forgotten() -> None:
    asking = asked_to_move()
    for number in range(1000):
        asking.server_there(f"client-{number}", "run", 11.0)
        asking.server_gone(f"client-{number}", 11.0)
    size = sum(len(each) for each in vars(asking).values() if isinstance(each, dict | set | list))

    assert size < 10


def test_what_is_cancelled_while_the_server_is_gone_is_cancelled_once_when_it_is_back() -> None:
    asking = asked_to_move()
    asking.hear(Accepted(id="a", requester="me", life="1", kind="perform_behavior"), 10.01, "control")
    asking.server_gone("control", 11.0)
    during = [*asking.cancel("a", Fault(reason="no more"), 12.0), *asking.tick(12.5), *asking.tick(14.9)]
    assert during == []
    (cancel,) = asking.server_there("control", "run", 14.95)
    assert isinstance(cancel, PublishCommand)
    assert isinstance(cancel.message, Cancel)


async def test_a_server_that_was_itself_asleep_hears_first_what_came_meanwhile(
    hub: MemoryHub, monkeypatch: pytest.MonkeyPatch
) -> None:
    server, client = hub.join("control", role="control"), hub.join("me", role="realizer")
    holds = list[str]()
    desk = RequestDesk(server, "control", lambda _: None, on_hold=lambda hold: holds.append(hold.name))
    with server.subscribe(*RequestDesk.patterns("control")) as inbox:

        async def take() -> None:
            while len(inbox):
                received = await inbox.next()
                assert received is not None
                desk.take(received)

        client.publish(keys.command(keys.BEHAVIOR, "realizer", "me"), replace(MOVES, life=""))
        await take()
        desk.accept("a")
        await asyncio.sleep(0.4)
        kept = Kept("perform_behavior", "a", 0, "start", 4.0)
        pulse = KeepAlive(live=(kept,), at=client.stamp(), requester="me")
        client.publish(keys.command(keys.keep_alive("control"), "realizer", "me"), pulse)
        monkeypatch.setattr(server, "now", lambda: asyncio.get_running_loop().time() + 0.3)  # as after a long sleep
        await asyncio.sleep(0.11)
        assert holds == []
        await take()
        await asyncio.sleep(0.05)
        assert holds == []
        await asyncio.sleep(1.0)
        assert holds == ["a"]
    desk.close()


@pytest.mark.parametrize("is_heard", [True, False])
def test_what_a_server_has_heard_is_not_begun_again_by_its_next_life(is_heard: bool) -> None:
    asking = asked_to_move()
    if is_heard:
        asking.hear(Heard(id="a", requester="me", life="1", kind="perform_behavior"), 10.01, "control")
    asking.server_gone("control", 10.1)
    effects = asking.server_there("control", "another", 11.0)

    if is_heard:
        (end,) = [each.end for each in effects if isinstance(each, TellEnd)]
        assert isinstance(end, ServerRestarted)
        assert all(isinstance(each.message, Cancel) for each in effects if isinstance(each, PublishCommand))
    else:
        assert [each.message for each in effects if isinstance(each, PublishCommand)] == [asking.request("a")]


def test_a_service_says_that_it_has_begun_what_it_has_not_accepted() -> None:
    serving = Serving("control")
    serving.take(MOVES, 10.0)
    (heard,) = serving.answer("a", Heard(id="a"), 10.0)
    assert isinstance(heard, Answered)
    assert isinstance(heard.answer, Heard)
    serving.answer("a", Accepted(id="a"), 10.0)
    assert serving.answer("a", Heard(id="a"), 10.0) == []
