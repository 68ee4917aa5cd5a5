"""The transition tables as data: complete, closed, drawn in the docs; and what an undefined transition does."""

from collections.abc import Iterable
from pathlib import Path
from typing import get_args

import pytest

from engage_hri.schemas.behaviors import EventKind
from engage_hri.schemas.recognition import ENDINGS
from engage_hri.services.recognition.config import RecognitionConfig, Sensing
from engage_hri.services.recognition.events import adjacency_pair, backchannel, directed_gaze, mutual_facial_gaze
from engage_hri.services.recognition.events.limits import LimitClock
from engage_hri.services.recognition.events.machine import (
    DECISIONS,
    IDLE,
    EventWriter,
    OngoingEvent,
    TransitionRow,
    UndefinedTransition,
    table,
)
from engage_hri.services.recognition.events.shared_gaze import SharedGaze
from engage_hri.services.reports import action_reports

TABLES = {
    "directed gaze": directed_gaze.TABLE, "mutual facial gaze": mutual_facial_gaze.TABLE,
    "adjacency pair": adjacency_pair.TABLE, "backchannel": backchannel.TABLE,
}  # fmt: skip
PAGE = Path(__file__).parents[2] / "docs" / "recognition.md"
every_table = pytest.mark.parametrize("rows", TABLES.values(), ids=TABLES)


@every_table
def test_every_state_can_be_reached_and_left(rows):
    reachable, frontier = {IDLE}, [IDLE]
    while frontier:
        state = frontier.pop()
        for row in rows.values():
            if row.state == state and row.next not in reachable:
                reachable.add(row.next)
                frontier.append(row.next)

    assert {row.state for row in rows.values()} == reachable
    assert all(any(row.state == state and row.next != state for row in rows.values()) for state in reachable)


@every_table
def test_every_way_back_to_idle_ends_the_event_and_no_other_does(rows):
    """An event that was never told of (undecided speech) may vanish; told ones end with their row."""
    told = {IDLE: False}
    for _ in rows:
        for row in rows.values():
            if row.state in told and row.next != IDLE:
                told[row.next] = told.get(row.next, False) or told[row.state] or "started" in row.publishes
    for row in rows.values():
        begins_now = told[row.state] or "started" in row.publishes
        ends = [state for state in row.publishes if state in ENDINGS]
        assert len(ends) == (1 if row.next == IDLE and begins_now else 0), row


@every_table
def test_every_state_says_what_happens_when_the_person_has_gone(rows):
    for state in {row.state for row in rows.values()} - {IDLE, adjacency_pair.INTERRUPTED}:
        assert (state, "person_gone") in rows


@every_table
def test_no_row_decides_twice(rows):
    assert all(sum(state in DECISIONS for state in row.publishes) <= 1 for row in rows.values())


@every_table
def test_the_documentation_shows_the_tables_as_they_are(rows):
    assert diagram(rows.values()) in PAGE.read_text()


def diagram(rows: Iterable[TransitionRow]) -> str:
    """The table as a Mermaid state diagram."""
    lines = ["stateDiagram-v2", f"    [*] --> {IDLE}"]
    for row in rows:
        published = f" / {', '.join(row.publishes)}" if row.publishes else ""
        lines.append(f"    {row.state} --> {row.next} : {row.given}{published}")
    return "\n".join(lines) + "\n"


def test_two_rows_for_one_input_are_a_mistake():
    with pytest.raises(ValueError, match="two rows"):
        table(TransitionRow(IDLE, "speaks", "a"), TransitionRow(IDLE, "speaks", "b"))


@pytest.mark.parametrize("gaze", [directed_gaze.DirectedGaze, mutual_facial_gaze.MutualFacialGaze])
def test_every_name_that_a_shared_gaze_gives_stands_in_its_table(gaze: type[SharedGaze]):
    robot, human, together = gaze.ROBOT_WAITS, gaze.HUMAN_WAITS, gaze.TOGETHER
    ways = {(row.state, row.given): row.next for row in gaze.TABLE.values()}

    coming = ways[IDLE, "robot_asks"]
    assert ways[coming, gaze.ROBOT_BEGINS] == robot
    assert ways[IDLE, gaze.HUMAN_BEGINS] == human
    assert ways[coming, f"{gaze.ROBOT_BEGINS}_{together}"] == together
    assert ways[IDLE, f"{gaze.HUMAN_BEGINS}_{together}"] == together
    assert ways[IDLE, f"{gaze.HUMAN_BEGINS}_in_vain"] == IDLE
    assert ways[robot, gaze.HUMAN_JOINS] == ways[human, gaze.ROBOT_JOINS] == together
    assert {state for state, _ in ways} == {IDLE, coming, robot, human, together}


def gaze() -> mutual_facial_gaze.MutualFacialGaze:
    machine = mutual_facial_gaze.MutualFacialGaze(EventWriter("loop"))
    event = OngoingEvent(kind="mutual_facial_gaze", initiator="robot", responder="human", started=1.0)
    machine.robot_begins(event, LimitClock(1.0, 1.9), robot_on=False, look=None)
    return machine


def test_an_undefined_transition_raises_and_changes_nothing():
    machine = gaze()

    with pytest.raises(UndefinedTransition, match="MutualFacialGaze: no 'robot_answers' in state 'robot_waiting'"):
        machine.step("robot_answers", 2.0)
    assert (machine.state, len(machine._writer.effects)) == ("robot_waiting", 1)


def test_ids_count_by_kind_and_carry_the_session():
    writer = EventWriter("loop", "3f2-")
    kinds: tuple[EventKind, ...] = ("directed_gaze", "backchannel", "directed_gaze")
    for kind in kinds:
        writer.publish(OngoingEvent(kind=kind, initiator="robot", responder="human", started=0.0), "started", 0.0)

    assert [event.id for event in writer.take()] == ["3f2-dg-1", "3f2-bc-1", "3f2-dg-2"]  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("setting", "value", "reason"),
    [
        ("directed_gaze_limit", 0.0, "directed_gaze_limit must be positive"),
        ("engaged_from", 0.2, "engaged_from must be at least 0.1 above disengaged_below"),
    ],
)
def test_bad_configuration_is_refused(setting, value, reason):
    with pytest.raises(ValueError, match=reason):
        RecognitionConfig(**{setting: value})


@pytest.mark.parametrize(("value", "reason"), [(0.0, "must be positive"), (89.0, "must be less than 89 degrees")])
def test_a_gaze_cone_that_cannot_be_is_refused(value, reason):
    with pytest.raises(ValueError, match=f"sensing.gaze_half_angle {reason}"):
        Sensing(gaze_half_angle=value)


# -- reporters -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("standing", get_args(action_reports.Standing))
def test_the_table_of_reporters_is_total(standing: action_reports.Standing):
    timers: dict[action_reports.Standing, action_reports.Given] = {"away": "grace_over", "back": "caught_up"}
    given = {"gone", "alive", "reborn", *([timers[standing]] if standing in timers else [])}

    assert {one for state, one in action_reports.TABLE if state == standing} == given


def test_the_documentation_shows_the_table_of_reporters_as_it_is():
    lines = ["stateDiagram-v2", "    [*] --> here"]
    for (state, given), row in action_reports.TABLE.items():
        lines.append(f"    {state} --> {row.next} : {given}{f' / {row.effect}' if row.effect else ''}")

    assert "\n".join(lines) + "\n" in PAGE.read_text()


def test_every_standing_is_left_for_here():
    for standing in get_args(action_reports.Standing):
        for _ in range(3):
            standing = action_reports.TABLE[standing, "alive"].next
            standing = action_reports.TABLE.get((standing, "caught_up"), action_reports.TABLE[standing, "alive"]).next
        assert standing == "here"
