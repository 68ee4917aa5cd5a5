"""Counts, delays and times between events: Table 2.1 from a log, windows, maintenance; engagement."""

import pytest

from engage_hri.schemas.recognition import ConnectionEvent
from engage_hri.schemas.units import Stamp
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.statistics.engagement import Engagement, next_level, pace
from engage_hri.services.recognition.statistics.published import PublishedStatistics
from engage_hri.services.recognition.statistics.tally import EventTally

KIND = {
    "dg": "directed_gaze", "mfg": "mutual_facial_gaze", "ap": "adjacency_pair", "bc": "backchannel",
}  # fmt: skip
DELAYS = {
    ("dg", "succeeded"): [0.0] * 4 + [0.1] * 6 + [0.65, 0.65, 2.0],
    ("dg", "failed"): [1.5],
    ("mfg", "succeeded"): [0.0, *[0.7] * 8, 0.6, 1.5],
    ("mfg", "failed"): [0.3, *[0.5] * 10, 0.7, 1.8],
    ("ap", "succeeded"): [0.0, *[0.4] * 27, 0.1, 1.1],
    ("ap", "failed"): [0.1, *[0.7] * 11, 1.6, 7.4],
    ("bc", "succeeded"): [None] * 15,
}
"""Made to have the counts, minima, means and maxima of Table 2.1."""


def event(
    id: str, state: str, started: float, delay: float | None = None, after: float = 0.0, **fields: object
) -> ConnectionEvent:
    return ConnectionEvent(
        id=id, kind=KIND[id.split("-")[0]], initiator="robot", responder="human", state=state,  # type: ignore[arg-type]
        at=Stamp("loop", started + after), started=Stamp("loop", started), delay=delay, **fields,  # type: ignore[arg-type]
    )  # fmt: skip


def table_2_1() -> list[ConnectionEvent]:
    """97 events in nine minutes: 5.7 s between starts on average, one gap of 70 s."""
    lives = [(kind, state, delay) for (kind, state), delays in DELAYS.items() for delay in delays]
    between = (96 * 5.7 - 70.0) / 95
    starts = [index * between + (70.0 - between if index > 40 else 0.0) for index in range(97)]
    log = []
    # Kinds are mixed by a stride that is prime to their number.
    for index, start in enumerate(starts):
        kind, state, delay = lives[index * 31 % 97]
        id = f"{kind}-{index}"
        log.append(event(id, "started", start))
        log.append(event(id, state, start, delay, after=delay or 0.0))
        if state == "succeeded":
            log.append(event(id, "completed", start, delay, after=(delay or 0.0) + 0.3))
    return sorted(log, key=lambda change: change.at.seconds)


def test_a_log_made_from_table_2_1_gives_its_numbers():
    tally = EventTally(30.0)
    for change in table_2_1():
        tally.feed(change)
    session = tally.session()
    kinds = {kind.kind: kind for kind in session.kinds}

    def row(kind: str) -> tuple[object, ...]:
        one = kinds[kind]  # type: ignore[index]
        ok = (one.succeeded, one.delay_min, one.delay_mean and round(one.delay_mean, 9), one.delay_max)
        bad = (one.failed, one.failed_delay_min, one.failed_delay_mean and round(one.failed_delay_mean, 9))
        return (*ok, *bad, one.failed_delay_max, one.failure_rate and round(1 - one.failure_rate, 3))

    assert row("directed_gaze") == (13, 0.0, 0.3, 2.0, 1, 1.5, 1.5, 1.5, 0.929)
    assert row("mutual_facial_gaze") == (11, 0.0, 0.7, 1.5, 13, 0.3, 0.6, 1.8, 0.458)
    assert row("adjacency_pair") == (30, 0.0, 0.4, 1.1, 14, 0.1, 1.2, 7.4, 0.682)
    assert row("backchannel") == (15, None, None, None, 0, None, None, None, 0.0)
    assert session.events == 97
    assert session.mtbce == pytest.approx(5.7, abs=1e-9)
    assert session.max_gap == pytest.approx(70.0, abs=1e-9)


def test_neither_optional_nor_preempted_nor_withdrawn_is_a_failure():
    tally = EventTally(30.0)
    for id, state, optional in (
        ("mfg-1", "failed", True), ("mfg-2", "preempted", False), ("mfg-3", "withdrawn", False),
        ("mfg-4", "superseded", False), ("mfg-5", "failed", False), ("mfg-6", "succeeded", True),
    ):  # fmt: skip
        tally.feed(event(id, "started", 1.0, optional=optional))
        tally.feed(event(id, state, 1.0, 0.5, optional=optional))
    (facial,) = [kind for kind in tally.session().kinds if kind.kind == "mutual_facial_gaze"]

    assert (facial.count, facial.succeeded, facial.failed, facial.failure_rate) == (6, 1, 1, 0.5)
    assert (tally.pace(2.0, "robot").failed, tally.pace(2.0, "robot").judged) == (1, 1)


def test_maintenance_glances_are_left_out_of_their_own_mean():
    tally = EventTally(30.0)
    for id, start, cause in (("dg-1", 0.0, "turn"), ("mfg-1", 5.0, "maintenance"), ("dg-2", 10.0, "turn")):
        tally.feed(event(id, "started", start, cause=cause))
    session = tally.session()

    assert (session.mtbce, session.mtbce_without_maintenance) == (5.0, 10.0)
    assert session.last_start_without_maintenance == Stamp("loop", 10.0)


def test_starts_that_become_known_late_fall_into_place():
    tally = EventTally(30.0)
    for id, start in (("dg-1", 0.0), ("dg-2", 10.0), ("bc-1", 9.0), ("dg-3", 12.0)):
        tally.feed(event(id, "started", start))

    assert (tally.session().max_gap, tally.session().mtbce) == (9.0, 4.0)


def test_events_leave_the_recent_window_and_stay_in_the_session():
    tally = EventTally(30.0)
    for id, start in (("dg-1", 0.0), ("dg-2", 10.0), ("dg-3", 20.0)):
        tally.feed(event(id, "started", start))

    assert [tally.recent(now).events for now in (20.0, 29.9, 30.0, 40.0, 50.0)] == [3, 3, 2, 1, 0]
    assert tally.recent(50.0).mtbce is None
    assert tally.session().events == 3


def test_repeated_changes_count_once():
    tally = EventTally(30.0)
    for change in table_2_1():
        tally.feed(change)
        tally.feed(change)

    assert tally.session().events == 97
    assert sum(kind.succeeded + kind.failed for kind in tally.session().kinds) == 97


def test_memory_does_not_grow_with_the_session():
    tally = EventTally(30.0)
    for number in range(5000):
        tally.feed(event(f"dg-{number}", "started", number * 5.0))
        tally.feed(event(f"dg-{number}", "failed", number * 5.0, 1.0))
        tally.recent(number * 5.0)

    assert len(tally._recent) <= 7
    assert len(tally.starts._kept) <= 50
    assert not tally._open


# -- engagement -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("usual", "recent", "open", "expected"),
    [(5.7, None, 0.0, 1.0), (5.7, 3.0, 2.0, 1.0), (5.0, 10.0, 2.0, 0.5), (5.0, 4.0, 20.0, 0.25)],
)
def test_pace_compares_with_the_larger_of_recent_and_open(usual, recent, open, expected):
    assert pace(usual, recent, open) == expected


@pytest.mark.parametrize(
    ("before", "value", "after"),
    [
        ("engaged", 0.46, "engaged"), ("engaged", 0.44, "disengaging"), ("engaging", 0.54, "engaging"),
        ("engaging", 0.56, "engaged"), ("disengaging", 0.21, "disengaging"), ("disengaging", 0.19, "disengaged"),
        ("disengaged", 0.29, "disengaged"), ("disengaged", 0.31, "engaging"),
    ],
)  # fmt: skip
def test_levels_change_only_beyond_the_margin(before, value, after):
    assert next_level(before, value, RecognitionConfig(), in_contact=True, lasts=True) == after


@pytest.mark.parametrize(
    ("before", "lasts", "after"),
    [
        ("unknown", True, "engaging"), ("disengaged", True, "engaging"), ("engaging", False, "engaging"),
        ("engaging", True, "engaged"), ("disengaging", False, "engaged"), ("engaged", False, "engaged"),
    ],
)  # fmt: skip
def test_nobody_is_engaged_who_was_not_engaging_for_a_while(before, lasts, after):
    assert next_level(before, 1.0, RecognitionConfig(), in_contact=True, lasts=lasts) == after


def engagement(starts: list[float], failed: int = 0) -> Engagement:
    tally = EventTally(30.0)
    for number, start in enumerate(starts):
        tally.feed(event(f"dg-{number}", "started", start))
        tally.feed(event(f"dg-{number}", "failed" if number < failed else "succeeded", start, 0.5))
    return Engagement(RecognitionConfig(), tally, "robot")


def test_nobody_comes_back_by_what_the_robot_does():
    config = RecognitionConfig()

    for before in ("disengaging", "disengaged"):
        assert next_level(before, 1.0, config, in_contact=False, lasts=True) == before


def test_nothing_seen_is_unknown():
    assert engagement([]).update(100.0, busy=False).level == "unknown"


def test_silence_weakens_and_then_breaks_engagement_at_foretold_times():
    one = engagement([0.0, 5.7])
    levels, now = [one.update(5.7, busy=False).level], 5.7
    times = []
    while (change := one.next_change(now)) is not None:
        now = change
        levels.append(one.update(now, busy=False).level)
        times.append(round(now, 3))

    assert levels == ["engaging", "engaged", "disengaging", "disengaged"]
    assert times == [7.2, round(5.7 + 5.7 / 0.45 + 0.001, 3), round(5.7 + 5.7 / 0.2 + 0.001, 3)]


def test_failures_lower_the_estimate_and_are_named():
    estimate = engagement([0.0, 3.0, 6.0, 9.0], failed=3).update(9.0, busy=False)

    assert estimate.value == 0.25
    assert "quality 0.25: 3 of 4 recent events failed" in estimate.reasons


def test_who_is_busy_is_not_judged_and_starts_afresh():
    one = engagement([0.0, 5.7])
    before = one.update(5.7, busy=False)
    one.update(5.7, busy=True)
    during = one.update(60.0, busy=True)
    after = one.update(70.0, busy=False)

    assert (during.value, during.level) == (before.value, before.level)
    assert "busy" in during.reasons[0]
    assert (after.level, after.value) == ("engaged", 1.0)


def test_statistics_are_published_for_each_person_and_everybody():
    published = PublishedStatistics("robot", RecognitionConfig())
    published.feed([event("dg-1", "started", 1.0)], set(), 1.0)

    assert [statistics.actor for statistics in published.told(1.0)] == ["", "human"]
    assert published.deadline is not None
    assert published.told(1.5) == []


def test_statistics_are_published_again_when_time_changes_them_and_then_fall_silent():
    published = PublishedStatistics("robot", RecognitionConfig())
    published.feed([event("dg-1", "started", 1.0)], set(), 1.0)
    published.told(1.0)
    seen = []
    while published.deadline is not None:
        now = published.deadline
        seen += [(round(now, 2), one.level, one.recent.events) for one in published.told(now) if one.actor]

    assert seen == [
        (2.5, "engaged", 1), (13.67, "disengaging", 1), (29.5, "disengaged", 1), (31.0, "disengaged", 0)
    ]  # fmt: skip


def test_statistics_are_published_when_somebody_gets_busy():
    published = PublishedStatistics("robot", RecognitionConfig())
    published.feed([], {"human"}, 1.0)

    assert [(statistics.actor, statistics.busy) for statistics in published.told(1.0)] == [
        ("", True),
        ("human", True),
    ]
