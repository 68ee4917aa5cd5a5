"""Sessions drawn from Table 2.1, heard by the real recognition: it finds exactly what was drawn, and the table."""

import random
from functools import cache
from itertools import pairwise
from statistics import mean, median

import pytest

from engage_hri.schemas.recognition import ConnectionEvent
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.events.session import Session
from engage_hri.services.recognition.statistics.tally import EventTally
from tests.tangram.people.human_session import Pace, Planned, draw, observations
from tests.tangram.people.table_2_1 import EVENTS, LONGEST_GAP, MTBCE, TABLE
from tests.tangram.people.table_session import exactly

SEEDS = 200


def recognized(plan: tuple[Planned, ...], resolution: str = "object") -> list[ConnectionEvent]:
    """Every change that recognition tells of the session."""
    session = Session("robot", RecognitionConfig(gaze_resolution=resolution))  # type: ignore[arg-type]
    effects = [effect for seen, at in observations(plan) for effect in session.feed(seen, at)]
    effects += session.advance(plan[-1].over + LONGEST_GAP + 20.0)
    return [effect for effect in effects if isinstance(effect, ConnectionEvent)]


def lives(changes: list[ConnectionEvent]) -> list[list[ConnectionEvent]]:
    """The changes of each event, by start."""
    by_id: dict[str, list[ConnectionEvent]] = {}
    for change in changes:
        by_id.setdefault(change.id, []).append(change)
    return sorted(by_id.values(), key=lambda life: life[0].started.seconds)


@cache
def sessions() -> tuple[tuple[tuple[Planned, ...], list[ConnectionEvent]], ...]:
    """Plans, and what was recognized of them."""
    plans = (draw(random.Random(seed)) for seed in range(SEEDS))
    return tuple((plan, recognized(plan)) for plan in plans)


def decided(kind: str, state: str) -> list[ConnectionEvent]:
    return [change for _, changes in sessions() for change in changes if (change.kind, change.state) == (kind, state)]


def longest_gap(plan: tuple[Planned, ...]) -> float:
    return max(after.start - before.start for before, after in pairwise(plan))


def test_every_event_that_was_drawn_is_recognized_as_it_was_drawn_and_no_other():
    for plan, changes in sessions():
        found = lives(changes)

        assert len(found) == len(plan) == EVENTS
        for planned, (started, decision, *rest) in zip(plan, found, strict=True):
            assert (started.kind, started.initiator) == (planned.kind, planned.initiator)
            assert started.started.seconds == pytest.approx(planned.start)
            assert decision.state == ("succeeded" if planned.succeeds else "failed")
            assert decision.delay == (None if planned.delay is None else pytest.approx(planned.delay))
            assert [change.state for change in rest] == (["completed"] if planned.succeeds else [])


def test_the_coarse_resolution_recognizes_the_same():
    plan = draw(random.Random(1))
    found = lives(recognized(plan, "table"))

    assert [life[1].state for life in found] == ["succeeded" if it.succeeds else "failed" for it in plan]


def test_two_hundred_seeds_have_the_mean_time_between_events():
    means = []
    for _, changes in sessions():
        tally = EventTally(30.0)
        for change in changes:
            tally.feed(change)
        means.append(tally.session().mtbce or 0.0)

    assert mean(means) == pytest.approx(MTBCE, abs=0.3)


@pytest.mark.parametrize("kind", TABLE)
def test_two_hundred_seeds_have_the_success_rates(kind: str):
    succeeded, failed = len(decided(kind, "succeeded")), len(decided(kind, "failed"))

    assert succeeded + failed == SEEDS * TABLE[kind].count  # type: ignore[index]
    assert succeeded / (succeeded + failed) == pytest.approx(TABLE[kind].success, abs=0.03)  # type: ignore[index]


@pytest.mark.parametrize("state", ["succeeded", "failed"])
@pytest.mark.parametrize("kind", [kind for kind in TABLE if kind != "backchannel"])
def test_delays_lie_as_in_the_table(kind: str, state: str):
    row = TABLE[kind]  # type: ignore[index]
    expected = row.delays if state == "succeeded" else row.failed_delays
    delays = [change.delay or 0.0 for change in decided(kind, state)]

    assert mean(delays) == pytest.approx(expected.mean, abs=0.05)
    assert min(delays) == pytest.approx(expected.least, abs=0.05)
    assert expected.least - 1e-9 <= min(delays) <= max(delays) <= expected.most + 1e-9


def test_both_people_begin_events():
    begun = [planned for plan, _ in sessions() for planned in plan]

    assert 0.25 < mean(planned.initiator == "human" for planned in begun) < 0.5


def test_a_busy_listener_makes_a_gap_of_seventy_seconds_typical():
    gaps = [longest_gap(plan) for plan, _ in sessions()]

    assert median(gaps) == pytest.approx(LONGEST_GAP, abs=10.0)
    assert mean(gap >= LONGEST_GAP for gap in gaps) > 0.25


def test_without_the_busy_regime_the_same_pace_never_pauses_for_so_long():
    """Pauses that give the same mean time between events."""
    plans = [draw(random.Random(seed), Pace(detailed=0.0, pause=3.5)) for seed in range(SEEDS)]

    assert mean((plan[-1].start - plan[0].start) / (EVENTS - 1) for plan in plans) == pytest.approx(MTBCE, abs=0.3)
    assert max(map(longest_gap, plans)) < LONGEST_GAP / 2


def test_a_busy_listener_acts_and_answers_little():
    answers = []
    for plan, _ in sessions():
        tasks = [(planned.decided, planned.task_until) for planned in plan if planned.task_until is not None]
        during = [planned for planned in plan if any(begin < planned.start < end for begin, end in tasks)]
        answers += [planned.succeeds for planned in during]

        assert all(planned.by_explainer for planned in during)
    assert len(answers) > 50
    assert mean(answers) < 0.35


def test_a_session_depends_on_its_seed_alone():
    assert draw(random.Random(7)) == draw(random.Random(7)) != draw(random.Random(8))


def test_the_table_itself_as_a_session_gives_its_numbers_exactly():
    tally = EventTally(30.0)
    for change in recognized(exactly()):
        tally.feed(change)
    session = tally.session()
    rows = {row.kind: row for row in session.kinds}

    def delays(*values: float | None) -> tuple[float | None, ...]:
        return tuple(value if value is None else round(value, 6) for value in values)

    for kind, row in TABLE.items():
        one = rows[kind]
        assert (one.succeeded, one.failed) == (row.succeeded, row.failed)
        if kind == "backchannel":
            continue
        ok, bad = row.delays, row.failed_delays
        assert delays(one.delay_min, one.delay_mean, one.delay_max) == (ok.least, ok.mean, ok.most)
        assert delays(one.failed_delay_min, one.failed_delay_mean, one.failed_delay_max) == (
            bad.least, bad.mean, bad.most,
        )  # fmt: skip
    assert session.events == EVENTS
    assert session.mtbce == pytest.approx(MTBCE, abs=1e-9)
    assert session.max_gap == pytest.approx(LONGEST_GAP, abs=1e-9)
