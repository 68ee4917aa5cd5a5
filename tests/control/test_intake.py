"""What control decides, without bus, body or clock: the ends of behaviors, holds, and ways home."""

from collections.abc import Sequence
from typing import Any

import pytest
from msgspec import Struct

from engage_hri.schemas.behaviors import Gaze, Wait
from engage_hri.schemas.blocks import BodyHeld
from engage_hri.schemas.body import (
    AbortBehavior,
    BehaviorAborted,
    BehaviorOutcome,
    Capabilities,
    GoHome,
    HomeReached,
    PerformBehavior,
)
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.requests import Accepted, Cancel, Refused
from engage_hri.services.control.config import ControlConfig
from engage_hri.services.control.contract.body import Reached, Revocation
from engage_hri.services.control.serving import steps
from engage_hri.services.control.serving.intake import ControlIntake
from engage_hri.services.requests.serving import HoldRequest
from engage_hri.services.runtime.intake import AnswerRequest, Input, PublishMessage

STUCK = Fault(reason="its arm is stuck", service="control")


class Control:
    """An intake at an instant, and what came of the last step."""

    def __init__(self) -> None:
        self.now = 0.0
        self.did: Sequence[Struct] = ()
        self.intake = ControlIntake("robot", ControlConfig(), "loop")
        able = Capabilities(body="mine", types=("gaze", "wait"), parts=("head",))
        self.take(steps.ControlBegan(able=able, covered_for=10.0))

    def take(self, step: steps.ControlStep) -> None:
        self.did = self.intake.take(Input("", step, "", self.now), self.now)

    def until(self, now: float) -> None:
        self.now = now
        self.did = self.intake.advance(now)

    def ask(self, request: Any, *, is_orphaned: bool = False) -> None:
        self.take(steps.RequestHanded(request=request, asked=request.id, is_orphaned=is_orphaned))

    def begin(self, id: str = "r", behavior: str = "b", **named: Any) -> None:
        gaze = Gaze(id=behavior, target="cup")
        self.ask(PerformBehavior(id=id, block="block", behavior=gaze, through="end", requester="realizer", **named))

    def tell(self, sync: str, id: str = "r") -> None:
        self.take(steps.BodyTold(request=id, progress=Reached(sync, self.now, self.now)))

    @property
    def answers(self) -> list[Struct]:
        return [each.answer for each in self.did if isinstance(each, AnswerRequest)]

    @property
    def outcome(self) -> BehaviorOutcome:
        [outcome] = [each for each in self.answers if isinstance(each, BehaviorOutcome)]
        return outcome

    def did_one(self, kind: type[Struct]) -> bool:
        return [type(each) for each in self.did].count(kind) == 1


@pytest.fixture
def control() -> Control:
    return Control()


def test_a_request_is_accepted_with_the_first_that_its_driver_tells(control: Control) -> None:
    control.begin()
    assert control.did_one(steps.BeginBehavior)
    assert control.answers == []

    control.tell("start")
    assert control.answers == [Accepted(id="r")]
    control.tell("ready")
    assert control.answers == []


def test_what_a_driver_does_not_end_is_cut_off_and_given_up_and_ends_once(control: Control) -> None:
    control.begin()
    control.tell("start")
    control.ask(Cancel(id="r", requester="realizer"))
    assert control.intake.deadline == 4.0
    control.until(4.0)
    assert control.did == [steps.LeaveStream("r", is_cut_off=True)]
    control.until(4.5)
    assert control.outcome.status == "failed"
    assert control.did_one(steps.TakeHome)

    control.tell("ready")
    assert control.did == []
    control.take(steps.StreamEnded(request="r", how="broken"))
    assert control.did == []
    assert control.intake.deadline is None


def test_a_driver_that_is_cut_off_and_ends_is_not_given_up(control: Control) -> None:
    control.begin()
    control.ask(Cancel(id="r"))
    control.until(4.0)
    control.take(steps.StreamEnded(request="r"))
    assert control.outcome.status == "aborted"
    assert not control.did_one(steps.TakeHome)

    control.until(9.0)
    assert control.did == []


@pytest.mark.parametrize(("first", "status"), [("relax", "aborted"), ("taken_over", "taken_over")])
def test_of_an_abort_and_a_takeover_the_first_counts(control: Control, first: Revocation, status: str) -> None:
    control.begin()
    abort = AbortBehavior(id="a", block="block", behavior="b", requester="guest")
    takeover = steps.AuthorityRevoked(request="r", how="taken_over")
    if first == "taken_over":
        control.take(takeover)
    control.ask(abort)
    assert control.did_one(steps.RevokeAuthority) == (first == "relax")
    control.take(takeover)
    control.take(steps.StreamEnded(request="r"))

    assert control.outcome.status == status
    assert control.outcome.fault is not None
    assert control.outcome.fault.whose == ("guest" if first == "relax" else "realizer")
    assert control.answers[-1] == BehaviorAborted(id="a")


def test_a_driver_that_breaks_makes_a_failure_of_whatever_end_was_near(control: Control) -> None:
    control.begin()
    control.ask(Cancel(id="r"))
    control.take(steps.StreamEnded(request="r", how="broken", fault=STUCK))

    assert (control.outcome.status, control.outcome.fault) == ("failed", STUCK)
    assert control.did_one(steps.TakeHome)


def test_a_stream_that_tells_what_cannot_be_is_left_and_fails_once_it_is_closed(control: Control) -> None:
    control.begin()
    control.tell("start")
    control.take(steps.BodyTold(request="r", progress=steps.Nonsense("a pear, which is no progress")))
    assert control.did == [steps.LeaveStream("r")]
    control.take(steps.StreamEnded(request="r"))

    assert control.outcome.status == "failed"
    assert "tells a pear" in str(control.outcome.fault)
    assert control.did_one(steps.TakeHome)


def test_the_body_goes_home_after_the_last_behavior_of_a_requester_that_is_lost(control: Control) -> None:
    control.begin("one", "b1")
    control.begin("other", "b2")
    control.ask(Cancel(id="one", requester="realizer", reason="it is gone"), is_orphaned=True)
    assert not control.did_one(steps.TakeHome)
    control.ask(Cancel(id="other", requester="realizer", reason="it is gone"), is_orphaned=True)
    assert control.did_one(steps.TakeHome)
    assert control.did_one(steps.Alert)
    control.take(steps.StreamEnded(request="one"))

    assert control.outcome.status == "lapsed"


def test_who_is_not_heard_is_held_and_who_asked_to_hold_too_goes_on_when_neither_is_so(control: Control) -> None:
    control.begin(held=True)
    assert steps.HoldBehavior("r", is_held=True) in control.did
    control.take(HoldRequest("r", 5.0))
    assert not control.did_one(steps.HoldBehavior)
    held = [each.message for each in control.did if isinstance(each, PublishMessage)]
    assert [len(each.holds) for each in held if isinstance(each, BodyHeld)] == [1]
    control.begin()  # the same request again, without `held`
    assert not control.did_one(steps.HoldBehavior)
    control.take(HoldRequest("r", None))

    assert steps.HoldBehavior("r", is_held=False) in control.did


def test_an_abort_of_two_of_one_name_ends_with_the_last_of_them(control: Control) -> None:
    control.begin("one")
    control.begin("other")
    control.ask(AbortBehavior(id="a", block="block", behavior="b"))
    control.take(steps.StreamEnded(request="other"))
    assert BehaviorAborted(id="a") not in control.answers
    control.take(steps.StreamEnded(request="one"))

    assert control.answers[-1] == BehaviorAborted(id="a")


def test_a_way_home_that_failed_is_alarming_until_one_of_the_whole_body_ends(control: Control) -> None:
    control.ask(GoHome(id="h"))
    assert control.did == [AnswerRequest(Accepted(id="h")), steps.TakeHome("h", (), "h")]
    control.take(steps.HomeEnded(request="h", fault=STUCK))
    assert control.did == [steps.Alert(STUCK), AnswerRequest(Refused(id="h", fault=STUCK))]
    control.take(steps.HomeEnded(parts=("head",)))
    assert control.did == []
    control.take(steps.HomeEnded())
    assert control.did_one(steps.Reassure)
    control.take(steps.HomeEnded())
    assert control.did == []


def test_a_way_home_whose_part_is_taken_is_no_fault_of_the_body(control: Control) -> None:
    control.ask(GoHome(id="h", requester="realizer"))
    control.take(steps.HomeEnded(request="h", fault=Fault(reason="taken", cause="replaced")))

    [refused] = control.answers
    assert isinstance(refused, Refused)
    assert (refused.fault.cause, refused.fault.whose) == ("replaced", "realizer")
    assert not control.did_one(steps.Alert)


def test_a_way_home_that_was_given_up_ends_once(control: Control) -> None:
    control.ask(GoHome(id="h"))
    control.ask(Cancel(id="h"))
    assert control.did_one(steps.StopHome)
    assert len(control.answers) == 1
    control.take(steps.HomeEnded(request="h"))

    assert not any(isinstance(each, HomeReached) for each in control.answers)


def test_what_no_body_is_asked_about_is_refused_before_its_driver_hears_of_it(control: Control) -> None:
    wait = PerformBehavior(id="r", block="block", behavior=Wait(id="w", duration=1.0), through="stroke")
    control.ask(wait)

    [refused] = control.answers
    assert isinstance(refused, Refused)
    assert refused.fault.reason.startswith("no sync point 'stroke'")
    assert not control.did_one(steps.BeginBehavior)
