"""Actions as every reader takes them: what a reporter said is over when it has vanished, whoever it told."""

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, ActorLost, OngoingActions
from engage_hri.schemas.units import Stamp
from engage_hri.services.reports.action_reports import REPORT_GRACE, SILENCED_KEPT, ActionReports, is_proper

ROBOT = "robot"


def stamp(at: float) -> Stamp:
    return Stamp("loop", at)


def began(actor: str, action: str, at: float, target: str = "cup") -> ActionBegan:
    return ActionBegan(actor=actor, action=action, targets=(target,), at=stamp(at))  # type: ignore[arg-type]


def reports() -> ActionReports:
    return ActionReports(ROBOT, REPORT_GRACE, "loop", lambda stamp: stamp.seconds)


def seen(taking: ActionReports, name: str, at: float, actor: str = "ann") -> None:
    """Let a reporter come, find somebody, and tell that they look."""
    taking.take(PeerAlive(participant=name, run=f"{name}-1"), f"engage/v1/alive/{name}", name, f"{name}-1", at)
    for event in (ActorFound(actor=actor, at=stamp(at)), began(actor, "look", at)):
        taking.take(event, keys.PERCEIVED_ACTION, name, f"{name}-1", at)


def test_whoever_was_told_of_by_a_reporter_that_was_killed_is_lost_after_the_grace() -> None:
    taking = reports()
    seen(taking, "camera", 1.0)

    assert taking.take(PeerGone(participant="camera"), "engage/v1/alive/camera", "camera", "camera-1", 2.0) == []
    assert taking.deadline == 2.0 + REPORT_GRACE
    assert taking.advance(5.9) == []
    told = taking.advance(6.0)

    assert [(type(each.observation), each.at) for each in told] == [(ActionEnded, 2.0), (ActorLost, 2.0)]
    assert taking.deadline is None


def test_actions_that_recognition_derives_are_over_when_recognition_is_killed() -> None:
    taking = reports()
    taking.take(PeerAlive(participant="recognition", run="r"), "engage/v1/alive/recognition", "recognition", "r", 0.0)
    taking.take(ActorFound(actor="ann", at=stamp(1.0)), keys.RECOGNIZED_ACTION, "recognition", "r", 1.0)
    taking.take(PeerGone(participant="recognition"), "engage/v1/alive/recognition", "recognition", "r", 2.0)

    assert [type(each.observation) for each in taking.advance(7.0)] == [ActorLost]


def test_what_the_robot_does_is_over_when_its_body_is_killed_but_it_is_never_lost() -> None:
    taking = reports()
    taking.take(PeerAlive(participant="control", run="c"), "engage/v1/alive/control", "control", "c", 0.0)
    taking.take(began(ROBOT, "point", 1.0), keys.ROBOT_ACTION, "control", "c", 1.0)
    taking.take(PeerGone(participant="control"), "engage/v1/alive/control", "control", "c", 2.0)

    assert [type(each.observation) for each in taking.advance(7.0)] == [ActionEnded]


@pytest.mark.parametrize(
    ("key", "message", "proper"),
    [
        (keys.PERCEIVED_ACTION, began("ann", "nod", 1.0), True),
        (keys.PERCEIVED_ACTION, began(ROBOT, "nod", 1.0), False),
        (keys.RECOGNIZED_ACTION, began(ROBOT, "nod", 1.0), False),
        (keys.ROBOT_ACTION, began(ROBOT, "nod", 1.0), True),
        (keys.ROBOT_ACTION, began("ann", "nod", 1.0), False),
        (keys.PERCEIVED_ACTION, ActorLost(actor=ROBOT, at=stamp(1.0)), False),
        (keys.ROBOT_ONGOING, OngoingActions(actor=ROBOT, at=stamp(1.0)), True),
        (keys.ROBOT_ONGOING, OngoingActions(actor="ann", at=stamp(1.0), seen=True), False),
        (keys.perceived_ongoing("camera", "ann"), OngoingActions(actor="ann", at=stamp(1.0), seen=True), True),
        (keys.perceived_ongoing("other", "ann"), OngoingActions(actor="ann", at=stamp(1.0), seen=True), False),
        (keys.perceived_ongoing("camera", "bob"), OngoingActions(actor="ann", at=stamp(1.0), seen=True), False),
    ],
)
def test_nothing_is_believed_of_anybody_but_their_reporter(key: str, message: object, proper: bool) -> None:
    told = reports().take(message, key, "camera", "camera-1", 2.0)

    assert is_proper(message, key, "camera", ROBOT) == proper  # type: ignore[arg-type]
    assert proper or told == []


def test_reporters_that_are_killed_one_after_the_other_are_not_remembered_for_ever() -> None:
    taking = reports()
    for number in range(3 * SILENCED_KEPT):
        name = f"camera-{number}"
        seen(taking, name, 10.0 * number, f"person-{number}")
        taking.take(PeerGone(participant=name), f"engage/v1/alive/{name}", name, f"{name}-1", 10.0 * number + 1)

        assert [type(each.observation) for each in taking.advance(10.0 * number + 9)] == [ActionEnded, ActorLost]

    assert len(taking._reporters) == SILENCED_KEPT
