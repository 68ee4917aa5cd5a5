"""Engagement as published, over time: the pause of Table 2.1, tasks, failures that are forgotten, several people."""

from itertools import pairwise

import pytest
from msgspec.structs import replace

from engage_hri.schemas.perception import ActorLost
from engage_hri.schemas.recognition import ConnectionEvent, Statistics
from engage_hri.schemas.units import Probability, Seconds
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.statistics.published import PublishedStatistics
from tests.recognition.heard_log import HeardLog
from tests.recognition.observations import ROBOT, stamp, world
from tests.recognition.test_statistics import event, table_2_1

PAUSE: Seconds = 70.0
TASK_AFTER: Seconds = 2.0


class Told:
    """What published publish of one actor (empty: all), each message at its time."""

    def __init__(self, actor: str = "human", **config: object) -> None:
        self.messages: list[Statistics] = []
        self._actor = actor
        self._published = PublishedStatistics("robot", RecognitionConfig(**config))  # type: ignore[arg-type]
        self._busy: set[str] = set()

    def happens(
        self, *events: ConnectionEvent, at: Seconds | None = None, contact: Probability | None = None
    ) -> None:
        now = events[0].at.seconds if at is None else at
        self.until(now)
        self._feed(list(events), now, contact)

    def contact(self, at: Seconds, much: Probability) -> None:
        self.until(at)
        self._feed([], at, much)

    def busy(self, at: Seconds, *persons: str) -> None:
        self.until(at)
        self._busy = set(persons)
        self._feed([], at)

    def until(self, now: Seconds) -> None:
        while self._published.deadline is not None and self._published.deadline <= now:
            self._feed([], self._published.deadline)

    def _feed(self, events: list[ConnectionEvent], now: Seconds, contact: Probability | None = None) -> None:
        contacts = {} if contact is None else {"human": contact}
        self._published.feed(events, self._busy, now, contacts)
        self.messages += [statistics for statistics in self._published.told(now) if statistics.actor == self._actor]

    @property
    def levels(self) -> list[tuple[float, str]]:
        """Changes of the level and when they were told."""
        changes: list[tuple[float, str]] = []
        for message in self.messages:
            if not changes or changes[-1][1] != message.level:
                changes.append((round(message.at.seconds, 3), message.level))
        return changes


def replayed(*, busy: bool) -> tuple[Told, Seconds, Seconds]:
    """A log as Table 2.1 has it, with the person busy in the pause of 70 s or not; when the pause began and ended."""
    log = table_2_1()
    starts = sorted(change.started.seconds for change in log if change.state == "started")
    begin, end = next((a, b) for a, b in pairwise(starts) if b - a > PAUSE - 0.01)
    told = Told()
    for change in log:
        if busy and change.started.seconds == end and change.state == "started":
            told.busy(begin + TASK_AFTER, "human")
            told.busy(end - 1.0)
        told.happens(change)
    return told, begin, end


def in_pause(told: Told, begin: Seconds, end: Seconds) -> list[Statistics]:
    return [message for message in told.messages if begin + TASK_AFTER <= message.at.seconds < end]


def test_the_pause_of_table_2_1_is_no_disengagement_of_who_is_busy():
    told, begin, end = replayed(busy=True)
    before = [message for message in told.messages if message.at.seconds <= begin + TASK_AFTER][-1]
    pause = in_pause(told, begin, end)

    assert before.level == "engaged"
    assert {message.level for message in pause} == {"engaged"}
    assert {message.engagement for message in pause if message.busy} == {before.engagement}


def test_the_same_pause_of_who_is_not_busy_is_a_disengagement():
    told, begin, end = replayed(busy=False)

    assert [level for at, level in told.levels if begin < at < end - 0.01] == ["disengaging", "disengaged"]
    assert min(message.engagement for message in in_pause(told, begin, end)) < 0.2


def test_a_task_freezes_the_estimate_of_its_beginning():
    """Not the one that was published last."""
    told = Told()
    told.happens(event("dg-1", "started", 0.0))
    told.busy(11.4, "human")
    told.until(100.0)

    assert {message.engagement for message in told.messages if message.busy} == {5.7 / 11.4}


def test_after_a_task_the_recent_pace_counts_again_once_the_window_holds_nothing_else():
    """No event happens at that moment, and none leaves the window."""
    told = Told(window=30.0)
    told.happens(event("dg-1", "started", 0.0))
    told.busy(1.0, "human")
    told.busy(100.0)
    told.happens(event("dg-2", "started", 101.0))
    told.happens(event("dg-3", "started", 129.0))
    told.until(130.0)

    assert told.messages[-1].at.seconds == 130.0
    assert told.messages[-1].engagement == pytest.approx(5.7 / 28.0)
    assert told.levels[-2:] == [(129.0, "engaged"), (130.0, "disengaging")]


def test_failures_are_forgotten_when_they_leave_the_window():
    told = Told(window=30.0)
    for number in range(3):
        told.happens(event(f"mfg-{number}", "started", float(number)))
        told.happens(event(f"mfg-{number}", "failed", float(number), 0.5), at=number + 0.5)
    for number in range(3, 12):
        told.happens(event(f"dg-{number}", "started", number * 3.0))
        told.happens(event(f"dg-{number}", "succeeded", number * 3.0, 0.0))
    forgotten = next(message for message in told.messages if message.at.seconds == 32.0)

    assert told.levels[:2] == [(0.0, "engaging"), (0.5, "disengaged")]
    assert "0 of 8 recent events failed" in forgotten.reasons[1]
    assert forgotten.level == "engaged"


def test_whoever_is_busy_freezes_the_estimate_of_all_but_not_of_the_others():
    everybody, bob = Told(""), Told("human")
    for told in (everybody, bob):
        told.happens(event("dg-1", "started", 0.0))
        told.busy(2.0, "ann")
        told.until(60.0)

    assert everybody.levels == [(0.0, "engaging"), (1.5, "engaged")]
    assert [level for _, level in bob.levels] == ["engaging", "engaged", "disengaging", "disengaged"]


def test_who_has_left_is_disengaged_in_time_and_comes_back_as_the_same_person():
    told = Told()
    told.happens(event("dg-1", "started", 0.0))
    told.until(3600.0)
    told.happens(event("dg-2", "started", 3600.0))
    told.until(3605.0)

    assert [level for _, level in told.levels[:4]] == ["engaging", "engaged", "disengaging", "disengaged"]
    assert told.levels[4:] == [(3600.0, "engaging"), (3601.5, "engaged")]
    assert told.messages[-1].session.events == 2


def test_what_the_robot_did_not_answer_lowers_nothing():
    told = Told()
    for name, (initiator, responder) in {"dg-1": ("human", "robot"), "dg-2": ("robot", "human")}.items():
        told.happens(replace(event(name, "started", 0.0), initiator=initiator, responder=responder))
        failed = replace(event(name, "failed", 0.0, 1.9), initiator=initiator, responder=responder)
        told.happens(failed, at=1.9)
        assert told.messages[-1].engagement == (1.0 if initiator == "human" else 0.0)


def test_optional_failures_lower_nothing():
    told = Told()
    told.happens(event("mfg-1", "started", 0.0, optional=True))
    told.happens(event("mfg-1", "failed", 0.0, 1.9, optional=True), at=1.9)

    assert told.messages[-1].engagement == 1.0


def looking(*looks: tuple[Seconds, Seconds], until: Seconds = 12.0) -> list[tuple[float, str]]:
    """Levels of somebody who looks at the robot from, until these times, each look an event."""
    told = Told()
    told.contact(0.0, 0.0)
    for number, (begin, end) in enumerate(looks):
        told.happens(event(f"mfg-{number}", "started", begin), contact=1.0)
        told.contact(end, 0.0)
    told.until(until)
    return told.levels[:3]


def test_who_comes_is_engaging_before_engaged_also_when_nothing_else_happens():
    assert looking((3.0, 12.0)) == [(0.0, "disengaged"), (3.0, "engaging"), (4.5, "engaged")]


def test_a_first_look_of_all_is_no_engagement_yet():
    told = Told()
    told.contact(3.0, 1.0)
    told.until(8.0)

    assert told.levels == [(3.0, "engaging"), (4.5, "engaged")]


def test_a_look_in_passing_engages_nobody():
    assert looking((3.0, 3.4)) == [(0.0, "disengaged"), (3.0, "engaging")]


def test_who_looks_again_is_engaged_if_the_first_look_was_a_while_ago():
    assert looking((3.0, 3.4), (6.0, 12.0))[2] == (7.0, "engaged"), "the share of contact has grown again"
    assert looking((3.0, 3.4), (4.0, 12.0))[2] == (4.5, "engaged")


@pytest.mark.parametrize("is_told", [True, False])
def test_who_has_left_is_disengaged_as_soon_as_that_is_known(*, is_told: bool):
    """A face that is back soon had not left: that it has is known after two seconds."""
    log = HeardLog(4.0)
    log.take(world("ann"), 0.0)
    log.found("ann", 0.0)
    log.begins("ann", "look", 1.0, ROBOT)
    log.until(12.0)
    log.take(ActorLost(actor="ann", at=stamp(12.0), left=is_told), 12.0)
    log.until(20.0)
    log.found("ann", 20.0)
    log.begins("ann", "look", 20.5, ROBOT)
    log.until(30.0)

    told = [each for each in log.told if isinstance(each, Statistics) and each.actor == "ann"]
    levels = [each for before, each in pairwise(told) if before.level != each.level]
    assert [each.level for each in levels] == ["engaged", "disengaged", "engaging", "engaged"]
    assert levels[1].at.seconds == pytest.approx(14.0, abs=0.01)
    assert (levels[1].engagement, levels[1].reasons) == (0.0, ("has left",))
