"""The statistics message of each person and of all together: made anew whenever something in it changes."""

from collections.abc import Iterable, Set

from schemas.recognition import ConnectionEvent, Statistics
from schemas.units import Seconds, Stamp
from services.recognition.config import RecognitionConfig
from services.recognition.engagement import Engagement
from services.recognition.statistics import Tally

EVERYBODY = ""


class _Standing:
    def __init__(self, config: RecognitionConfig, clock: str) -> None:
        self.tally = Tally(config.window, clock)
        self.engagement = Engagement(config, self.tally)
        self.due: Seconds | None = None


class Standings:
    """robot: whoever else takes part in an event is the person it counts for. clock: of the stamps."""

    def __init__(self, robot: str, config: RecognitionConfig, clock: str = "loop") -> None:
        self._robot = robot
        self._config = config
        self._clock = clock
        self._standings: dict[str, _Standing] = {EVERYBODY: _Standing(config, clock)}
        self._busy: frozenset[str] = frozenset()

    @property
    def deadline(self) -> Seconds | None:
        """When somebody's statistics change by the passing of time."""
        return min((one.due for one in self._standings.values() if one.due is not None), default=None)

    def feed(self, events: Iterable[ConnectionEvent], busy: Set[str], now: Seconds) -> list[Statistics]:
        """Count what happened; the statistics that are new. busy: persons with a task in hand."""
        touched = {actor for actor, one in self._standings.items() if one.due is not None and one.due <= now}
        for event in events:
            for name in (event.person(self._robot), EVERYBODY):
                self._standing(name).tally.feed(event)
                touched.add(name)
        if busy != self._busy:
            touched |= {EVERYBODY, *(busy ^ self._busy)}
            self._busy = frozenset(busy)
        return [self._statistics(actor, now) for actor in sorted(touched)]

    def overall(self, now: Seconds) -> Statistics:
        """Of all together, as they are."""
        return self._statistics(EVERYBODY, now)

    def _standing(self, actor: str) -> _Standing:
        if actor not in self._standings:
            self._standings[actor] = _Standing(self._config, self._clock)
        return self._standings[actor]

    def _statistics(self, actor: str, now: Seconds) -> Statistics:
        one = self._standing(actor)
        busy = bool(self._busy) if actor == EVERYBODY else actor in self._busy
        estimate = one.engagement.update(now, busy=busy)
        statistics = Statistics(
            actor=actor, at=Stamp(self._clock, now), session=one.tally.session(), recent=one.tally.recent(now),
            engagement=estimate.value, level=estimate.level, reasons=estimate.reasons, busy=busy,
        )  # fmt: skip
        changes = (one.tally.next_change, one.engagement.next_change(now))
        one.due = min((at for at in changes if at is not None), default=None)
        return statistics
