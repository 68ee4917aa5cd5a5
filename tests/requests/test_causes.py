"""Ends name what happened and whose it was: as far as who misses somebody can know."""

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Wait
from engage_hri.schemas.body import DescribeBody, PerformBehavior
from engage_hri.schemas.faults import Cause, EngageError, Fault, NoReply
from engage_hri.schemas.fragments import PerformFragment, TurnFragment
from engage_hri.schemas.requests import Accepted, Cancel
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.deadlines import LATE, Sight
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.requests.asking import Asking, Effect, Patience, PublishCommand, TellEnd
from engage_hri.services.requests.serving import Hand, HoldRequest, Serving

PLEASE = PerformFragment(
    id="a", requester="me", life="1", lease=5.0,
    fragment=TurnFragment(id="a", addressee="ann", turn_index=1, turn_status="full"),
)  # fmt: skip


def ended(serving: Serving, at: float) -> Fault:
    """What the service is told of the end, by the clock."""
    (cancel,) = [
        each.request for each in serving.tick(at) if isinstance(each, Hand) and isinstance(each.request, Cancel)
    ]
    return cancel.fault("a")


def accepted(unlinked_at: float = float("-inf")) -> Serving:
    serving = Serving("generation", sight=Sight("generation", lambda: unlinked_at))
    serving.requester_there("me", "r1", 9.0)
    serving.take(PLEASE, 10.0, "p")
    serving.answer("a", Accepted(id="a"), 10.0)
    return serving


@pytest.mark.parametrize(
    ("unlinked_at", "cause", "whose"),
    [(float("-inf"), "gone", "me"), (5.0, "gone", "me"), (11.0, "unlinked", "router"), (12.9, "unlinked", "router")],
)
def test_a_requester_that_is_missed_is_gone_unless_the_server_itself_had_no_router(
    unlinked_at: float, cause: Cause, whose: str
) -> None:
    serving = accepted(unlinked_at)
    serving.requester_gone("me", 11.0)
    fault = ended(serving, 13.01)

    assert (fault.cause, fault.whose) == (cause, whose)
    assert fault.reason.startswith("me has not been seen for 2.0 s")


def test_a_server_that_stood_still_itself_hears_first_and_says_so() -> None:
    serving = accepted()
    serving.requester_gone("me", 11.0)

    assert serving.tick(19.0) == []  # what came meanwhile is heard first
    fault = ended(serving, 19.0 + LATE)
    assert (fault.cause, fault.whose) == ("frozen", "generation")


def test_a_requester_that_began_another_life_and_one_that_does_not_renew_are_told_apart() -> None:
    reborn, lapsed = accepted(), accepted()
    (hand,) = reborn.requester_there("me", "r2", 11.0)
    assert isinstance(hand, Hand)
    assert isinstance(hand.request, Cancel)

    assert (hand.request.cause, hand.request.whose) == ("restarted", "me")
    fault = ended(lapsed, 15.01)
    assert (fault.cause, fault.whose) == ("unrenewed", "me")
    assert fault.reason.startswith("me has not renewed it for 5.0 s")


MOVES = PerformBehavior(
    id="a", requester="me", life="1", block="b", behavior=Wait(id="w"), through="start", lease=4.0, held_after=0.5
)  # fmt: skip


def held(unlinked_at: float, *, leaves: bool) -> Fault:
    """The reason of a hold, about half a second after the last renewal, or when the requester leaves."""
    serving = Serving("control", sight=Sight("control", lambda: unlinked_at))
    serving.requester_there("me", "r1", 9.0)
    serving.take(MOVES, 10.0)
    (hold,) = serving.requester_gone("me", 10.3) if leaves else serving.tick(10.5 - LATE)
    assert isinstance(hold, HoldRequest)
    assert hold.why is not None
    return hold.why


@pytest.mark.parametrize(
    ("unlinked_at", "leaves", "cause", "whose", "told"),
    [
        (2.0, False, "unrenewed", "me", "me has not renewed it for 0.4 s: it, its machine or the network"),
        (2.0, True, "gone", "me", "me has not been seen for 0.3 s: it, its machine or the network"),
        (10.2, False, "unlinked", "router", "me has not renewed it for 0.4 s: control has had no router"),
        (10.2, True, "unlinked", "router", "me has not been seen for 0.3 s: control has had no router"),
    ],
)
def test_a_hold_says_what_has_happened_and_whose_it_was(
    unlinked_at: float, leaves: bool, cause: Cause, whose: str, told: str
) -> None:
    why = held(unlinked_at, leaves=leaves)

    assert (why.cause, why.whose, why.service) == (cause, whose, "control")
    assert why.reason.startswith(told)


def asked(unlinked_at: Seconds, within: Seconds | None = None) -> Asking:
    """A requester whose fragment generation has accepted, at 10.1. unlinked_at: when it last had no router."""
    asking = Asking("me", "1", Patience(), Sight("me", lambda: unlinked_at))
    asking.server_there("generation", "r1", 9.0)
    asking.send(keys.FRAGMENT, PLEASE, 10.0, within=within)
    asking.hear(Accepted(id="a", requester="me", life="1", kind="perform_fragment"), 10.1, "generation")
    return asking


def ticked(asking: Asking) -> list[Effect]:
    """What it does until 15.01, each thing on time: it did not stand still."""
    effects: list[Effect] = []
    while asking.deadline is not None and asking.deadline <= 15.01:
        effects += asking.tick(asking.deadline)
    return effects


@pytest.mark.parametrize(
    ("unlinked_at", "cause", "whose"), [(2.0, "gone", "generation"), (13.0, "unlinked", "router")]
)
def test_a_server_that_is_missed_is_gone_unless_the_requester_itself_had_no_router(
    unlinked_at: float, cause: Cause, whose: str
) -> None:
    asking = asked(unlinked_at)
    asking.server_gone("generation", 11.0)
    (end,) = [each for each in ticked(asking) if isinstance(each, TellEnd)]
    assert isinstance(end.end, EngageError)

    assert (end.end.fault.cause, end.end.fault.whose) == (cause, whose)


def test_what_follows_from_an_end_has_its_cause_and_tells_it() -> None:
    lost = Fault(reason="x has not been seen", where="b", line=3, cause="gone", whose="x", service="realizer")

    assert lost.at("a").cause == "gone"
    assert str(lost.at("a")) == "a, line 3: x has not been seen"
    assert str(lost.following("b failed", "a")) == "a: b failed: x has not been seen"
    assert lost.following("b failed", "a").whose == "x"
    cancel = Cancel(id="a", requester="me", reason=lost.reason, cause=lost.cause, whose=lost.whose)
    assert (cancel.fault("a").cause, cancel.fault("a").whose) == ("gone", "x")
    assert (Cancel(id="a", requester="me").fault("a").cause, Cancel(id="a", requester="me").fault("a").whose) == (
        "cancelled",
        "me",
    )


async def test_a_question_without_an_answer_tells_how_long_it_has_waited_and_for_whom() -> None:
    hub = MemoryHub("robot")
    bus, control = hub.join("me"), hub.join("control")
    with pytest.raises(NoReply, match=r"no reply from control within 5 s: it is not there") as absent:
        await bus.query(keys.DESCRIBE, DescribeBody(), 5.0)
    control.declare_alive()
    with pytest.raises(NoReply, match=r"within 2\.5 s: it is there, but does not answer") as silent:
        await bus.query(keys.DESCRIBE, DescribeBody(), 2.5)

    assert [(each.value.fault.cause, each.value.fault.whose) for each in (absent, silent)] == [
        ("gone", "control"),
        ("silent", "control"),
    ]


@pytest.mark.parametrize(
    ("unlinked_at", "cause", "whose"), [(2.0, "late", "generation"), (13.0, "unlinked", "router")]
)
def test_what_takes_too_long_is_cancelled_for_its_server_unless_the_requester_itself_had_no_router(
    unlinked_at: float, cause: Cause, whose: str
) -> None:
    asking = asked(unlinked_at, within=5.0)
    published = [each for each in ticked(asking) if isinstance(each, PublishCommand)]
    (cancel,) = [each.message for each in published if isinstance(each.message, Cancel)]

    assert (cancel.cause, cancel.whose) == (cause, whose)
    assert cancel.reason.startswith("it has taken too long")
