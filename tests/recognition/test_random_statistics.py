"""Statistics and engagement of random streams equal what their definitions give of the log, at every moment."""

from collections.abc import Iterator
from unittest import mock

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engage_hri.schemas.recognition import ConnectionEvent, EngagementLevel, Statistics
from engage_hri.schemas.units import Seconds
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.events.machine import Effect
from engage_hri.services.recognition.events.session import Session
from engage_hri.services.recognition.statistics import published
from engage_hri.services.recognition.statistics.engagement import ENGAGES_AFTER, JUST_AFTER, next_level
from engage_hri.services.recognition.statistics.published import PublishedStatistics
from tests.random_cases import share_of
from tests.recognition import recomputed
from tests.recognition.observations import ROBOT, world
from tests.recognition.test_random_streams import ACTORS, Stream, streams


@pytest.fixture(autouse=True, scope="module")
def each_change_at_once() -> Iterator[None]:
    """The definitions say what holds at each moment; the service tells it a little later."""
    with mock.patch.object(published, "TOLD_EVERY", 0.0):
        yield


CONFIG = RecognitionConfig(window=5.0, reference_mtbce=0.8)
"""A window that random streams outlast, and a pace that they fall short of."""


class Replay:
    """A stream through session and published as the service runs them, with all that was published."""

    def __init__(self) -> None:
        self.log: list[ConnectionEvent] = []
        self.told: dict[str, Statistics] = {}
        self.busy: set[str] = set()
        self._session = Session(ROBOT, CONFIG)
        self._published = PublishedStatistics(ROBOT, CONFIG)
        self._now: Seconds = 0.0
        self._session.feed(world(*ACTORS), 0.0)

    def run(self, stream: Stream) -> Iterator[tuple[Seconds, list[Statistics]]]:
        """Each moment at which something happened, and what was published then. Now never runs backwards."""
        for at, observation in stream:
            yield from self._until(at)
            self._now = max(self._now, at)
            yield self._now, self._tell(self._session.feed(observation, at))
        yield from self._until(self._now + 40.0)

    def _until(self, end: Seconds) -> Iterator[tuple[Seconds, list[Statistics]]]:
        while (due := self.deadline) is not None and due <= end:
            self._now = max(self._now, due)
            yield self._now, self._tell(self._session.advance(self._now))

    @property
    def deadline(self) -> Seconds | None:
        times = (self._session.deadline, self._published.deadline)
        return min((at for at in times if at is not None), default=None)

    def _tell(self, effects: list[Effect]) -> list[Statistics]:
        # As the service does: what is told again is not counted again.
        events = [effect for effect in effects if isinstance(effect, ConnectionEvent) and not effect.retold]
        self.log += events
        self.busy = set(self._session.busy)
        self._published.feed(events, self.busy, self._now)
        told = self._published.told(self._now)
        self.told.update((statistics.actor, statistics) for statistics in told)
        return told


@settings(max_examples=share_of(15), deadline=None)
@given(streams)
def test_what_was_published_last_is_true_of_the_log_at_every_moment(stream):
    replay = Replay()
    for now, told in replay.run(stream):
        assert all(statistics.at.seconds == now for statistics in told)
        for actor in ("", *ACTORS):
            lives = recomputed.lives(replay.log, actor)
            if lives:
                statistics = replay.told[actor]
                assert recomputed.alike(statistics.session, recomputed.statistics(lives))
                recent = recomputed.of_window(lives, now, CONFIG.window)
                assert recomputed.alike(statistics.recent, recomputed.statistics(recent))


class Judge:
    """What the estimate of one actor (or all) must be: a fold over the moments at which it was published."""

    def __init__(self, actor: str) -> None:
        self.actor = actor
        self.value: float | None = None
        self.level: EngagementLevel = "unknown"
        self._engaging_since = float("-inf")
        self._busy = False
        self._busy_until = float("-inf")

    def look(self, replay: Replay, now: Seconds) -> None:
        busy = bool(replay.busy) if self.actor == "" else self.actor in replay.busy
        if self._busy and not busy:
            self._busy_until = now
        if not (self._busy and busy):
            value = self.at(replay, now)
            if value is not None:
                before, self.level = self.level, self._level(value, now)
                self.value = value
                if self.level == "engaging" != before:
                    self._engaging_since = now
        self._busy = busy

    def at(self, replay: Replay, now: Seconds) -> float | None:
        return recomputed.engagement(recomputed.lives(replay.log, self.actor), now, self._busy_until, CONFIG)

    def foresees(self, replay: Replay, now: Seconds) -> EngagementLevel:
        """The level at `now` if nothing happens until then."""
        value = self.at(replay, now)
        return self.level if value is None or self._busy else self._level(value, now)

    def _level(self, value: float, now: Seconds) -> EngagementLevel:
        return next_level(
            self.level, value, CONFIG, in_contact=True, lasts=now >= self._engaging_since + ENGAGES_AFTER
        )


@settings(max_examples=share_of(25), deadline=None)
@given(streams)
def test_the_estimate_follows_its_definition_and_no_level_changes_in_silence(stream):
    replay = Replay()
    judges = {actor: Judge(actor) for actor in ("", *ACTORS)}
    for now, told in replay.run(stream):
        for statistics in told:
            judge = judges[statistics.actor]
            judge.look(replay, now)
            assert recomputed.alike(statistics.engagement, judge.value)
            assert statistics.level == judge.level
        if replay.deadline is not None and (before_next := replay.deadline - 2 * JUST_AFTER) >= now:
            for moment in ((now + before_next) / 2, before_next):
                assert all(judge.foresees(replay, moment) == judge.level for judge in judges.values())


@settings(max_examples=25, deadline=None)
@given(streams, st.integers(1, 6))
def test_statistics_do_not_depend_on_how_changes_are_grouped(stream, size):
    """Several changes at once leave the same counts as one after the other."""
    replay = Replay()
    for _ in replay.run(stream):
        pass
    together = PublishedStatistics(ROBOT, CONFIG)
    told: dict[str, Statistics] = {}
    end = max((change.at.seconds for change in replay.log), default=0.0)
    for first in range(0, len(replay.log), size):
        together.feed(replay.log[first : first + size], set(), end)
        for statistics in together.told(end):
            told[statistics.actor] = statistics

    assert all(recomputed.alike(told[actor].session, replay.told[actor].session) for actor in told)
