"""What a session leaves behind, from a handful of messages."""

from typing import Any

import pytest

from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, ActorLost
from engage_hri.schemas.recognition import ConnectionEvent, Statistics, WindowStatistics
from engage_hri.schemas.units import Stamp
from engage_hri.services.study.records import EyeContact, SessionRecord, SessionRecorder


def at(seconds: float) -> Stamp:
    return Stamp("loop", seconds)


def event(id: str, state: str, started: float, when: float, **more: Any) -> ConnectionEvent:
    fields = {"kind": "adjacency_pair", "initiator": "robot", "responder": "human", **more}
    return ConnectionEvent(id=id, state=state, at=at(when), started=at(started), **fields)


def recording(*messages: Any) -> SessionRecorder:
    """Of messages that happen when they say."""
    recording = SessionRecorder("robot")
    for message in messages:
        recording(message, message.at.seconds)
    return recording


def record(made: SessionRecorder, reason: str = "") -> SessionRecord:
    return made.session(session=2, condition="operational", seed=7, reason=reason)


def look(target: str, when: float) -> ActionBegan:
    return ActionBegan(actor="human", action="look", targets=(target,), at=at(when))


def test_the_decision_about_an_event_is_its_outcome():
    made = recording(
        event("e2", "started", 4.0, 4.0, kind="directed_gaze", cause="reference"),
        event("e1", "started", 1.0, 1.0),
        event("e1", "succeeded", 1.0, 2.5, delay=1.5),
        event("e2", "preempted", 4.0, 5.0, kind="directed_gaze", cause="reference"),
        event("e1", "completed", 1.0, 6.0, delay=1.5),
        event("e3", "started", 9.0, 9.0, optional=True),
    )

    rows = made.events(session=2, condition="operational")

    assert [(row.start, row.kind, row.outcome, row.delay, row.optional) for row in rows] == [
        (1.0, "adjacency_pair", "succeeded", 1.5, False),
        (4.0, "directed_gaze", "preempted", None, False),
        (9.0, "adjacency_pair", "open", None, True),
    ]
    assert {(row.session, row.condition) for row in rows} == {(2, "operational")}
    assert record(made).adjacency_pairs_every == 8.0


def test_one_adjacency_pair_has_no_time_between():
    assert record(recording(event("e1", "started", 1.0, 1.0))).adjacency_pairs_every is None


def test_the_last_statistics_about_everybody_count():
    def statistics(actor: str, events: int) -> Statistics:
        return Statistics(actor=actor, at=at(1.0), session=WindowStatistics(events=events), recent=WindowStatistics())

    made = recording(statistics("", 1), statistics("human", 9), statistics("", 2), statistics("human", 10))

    assert record(made).statistics.events == 2


def test_the_task_is_completed_when_the_last_piece_lies():
    made = recording(
        ActorFound(actor="human", at=at(2.0)),
        ActionEnded(actor="human", action="act", targets=("a",), at=at(30.0)),
        ActionEnded(actor="human", action="act", targets=("b",), at=at(52.0)),
        ActionEnded(actor="robot", action="act", at=at(55.0)),
        ActorLost(actor="human", at=at(60.0)),
    )

    assert record(made).completion_time == 50.0
    assert record(made).duration == 60.0
    assert record(made, "not over").completion_time is None
    assert record(made, "not over").finished is False


def test_looks_at_the_face_are_shared_among_the_thirds():
    made = recording(
        ActorFound(actor="human", at=at(10.0)),
        look("robot", 18.0),  # 2 s in the first third, 3 in the second
        look("robot", 19.0),  # told once more: the same look
        look("table", 23.0),
        look("robot", 29.0),  # 1 s in the second, then until they leave
        ActorLost(actor="human", at=at(40.0)),
        look("robot", 41.0),
    )

    assert record(made).eye_contact == EyeContact(first=0.2, second=pytest.approx(0.4), last=pytest.approx(1.0))


def test_a_look_ends_when_it_is_told_to_have_ended():
    made = recording(
        ActorFound(actor="human", at=at(0.0)),
        look("robot", 3.0),
        ActionEnded(actor="human", action="look", targets=("table",), at=at(4.0)),  # of an earlier one: late
        ActionEnded(actor="human", action="look", targets=("robot",), at=at(6.0)),
        ActionBegan(actor="robot", action="look", targets=("human",), at=at(9.0)),
    )

    contact = record(made).eye_contact

    assert contact == EyeContact(first=0.0, second=1.0, last=0.0)
    assert contact is not None
    assert contact.change == 0.0


def test_without_a_person_there_is_nothing_to_tell():
    empty = record(recording())

    assert (empty.eye_contact, empty.completion_time, empty.duration) == (None, None, 0.0)
    assert record(recording(ActorFound(actor="human", at=at(1.0)))).eye_contact is None


def test_a_kind_that_never_came_has_no_numbers():
    assert record(recording()).of("backchannel").count == 0
