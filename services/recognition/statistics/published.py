"""The statistics message of each person and of all together: made anew whenever something in it changes."""

from collections.abc import Iterable, Set

from engage_hri.schemas.recognition import ConnectionEvent, Statistics
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.events.machine import Forgotten
from engage_hri.services.recognition.statistics.engagement import Engagement
from engage_hri.services.recognition.statistics.tally import Tally
from engage_hri.services.requests.deadlines import Deadlines

EVERYBODY = ""


class _OfOne:
    def __init__(self, config: RecognitionConfig, clock: str) -> None:
        self.tally = Tally(config.window, clock)
        self.engagement = Engagement(config, self.tally)


class PublishedStatistics:
    """robot: whoever else takes part in an event is the person it counts for. clock: of the stamps."""

    def __init__(self, robot: str, config: RecognitionConfig, clock: str = "loop") -> None:
        self._robot = robot
        self._config = config
        self._clock = clock
        self._published: dict[str, _OfOne] = {EVERYBODY: _OfOne(config, clock)}
        self._agenda: Deadlines[str] = Deadlines(str)
        self._busy: frozenset[str] = frozenset()

    @property
    def deadline(self) -> Seconds | None:
        """When somebody's statistics change by the passing of time."""
        return self._agenda.earliest

    def feed(self, changes: Iterable[ConnectionEvent | Forgotten], busy: Set[str], now: Seconds) -> list[Statistics]:
        """Count what happened, in its order; the statistics that are new. busy: persons with a task in hand."""
        touched = set(iter(lambda: self._agenda.due(now), None))
        for change in changes:
            if isinstance(change, Forgotten):
                self._published.pop(change.actor, None)
                self._agenda.clear(change.actor)
                touched.discard(change.actor)
                continue
            for name in (change.person(self._robot), EVERYBODY):
                self._statistics_of(name).tally.feed(change)
                touched.add(name)
        if busy != self._busy:
            touched |= {EVERYBODY, *(busy ^ self._busy)}
            self._busy = frozenset(busy)
        return [self._statistics(actor, now) for actor in sorted(touched)]

    def overall(self, now: Seconds) -> Statistics:
        """Of all together, as they are."""
        return self._statistics(EVERYBODY, now)

    def _statistics_of(self, actor: str) -> _OfOne:
        if actor not in self._published:
            self._published[actor] = _OfOne(self._config, self._clock)
        return self._published[actor]

    def _statistics(self, actor: str, now: Seconds) -> Statistics:
        one = self._statistics_of(actor)
        busy = bool(self._busy) if actor == EVERYBODY else actor in self._busy
        estimate = one.engagement.update(now, busy=busy)
        statistics = Statistics(
            actor=actor, at=Stamp(self._clock, now), session=one.tally.session(), recent=one.tally.recent(now),
            engagement=estimate.value, level=estimate.level, reasons=estimate.reasons, busy=busy,
        )  # fmt: skip
        changes = (one.tally.next_change, one.engagement.next_change(now))
        self._agenda.set(actor, min((at for at in changes if at is not None), default=None))
        return statistics
