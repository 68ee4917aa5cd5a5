"""Statistics messages of each person and of all together: made anew whenever something in them changes."""

from collections import defaultdict
from collections.abc import Iterable, Set
from functools import partial

from engage_hri.schemas.recognition import ConnectionEvent, Statistics
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.bus.deadlines import Deadlines
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.events.machine import PersonForgotten
from engage_hri.services.recognition.statistics.engagement import Engagement
from engage_hri.services.recognition.statistics.tally import EventTally

EVERYBODY = ""


class _ActorStatistics:
    """Counts and estimate of one person, or of all."""

    def __init__(self, config: RecognitionConfig, clock: str) -> None:
        self.tally = EventTally(config.window, clock)
        self.engagement = Engagement(config, self.tally)


class PublishedStatistics:
    """Statistics of all persons. robot: each event counts for the other one of its two. clock: of the stamps."""

    def __init__(self, robot: str, config: RecognitionConfig, clock: str = "loop") -> None:
        self._robot = robot
        self._clock = clock
        self._actors = defaultdict[str, _ActorStatistics](partial(_ActorStatistics, config, clock))
        self._agenda: Deadlines[str] = Deadlines(str)
        self._busy: frozenset[str] = frozenset()

    @property
    def deadline(self) -> Seconds | None:
        """Time at which statistics of an actor next change by the passing of time."""
        return self._agenda.earliest

    def feed(
        self, changes: Iterable[ConnectionEvent | PersonForgotten], busy: Set[str], now: Seconds
    ) -> list[Statistics]:
        """Count changes, in their order. Returns the statistics that are new. busy: persons with a task in hand."""
        touched = set(iter(lambda: self._agenda.due(now), None))
        for change in changes:
            if isinstance(change, PersonForgotten):
                self._actors.pop(change.actor, None)
                self._agenda.clear(change.actor)
                touched.discard(change.actor)
                continue
            for name in (change.person(self._robot), EVERYBODY):
                self._actors[name].tally.feed(change)
                touched.add(name)
        if busy != self._busy:
            touched |= {EVERYBODY, *(busy ^ self._busy)}
            self._busy = frozenset(busy)
        return [self._statistics(actor, now) for actor in sorted(touched)]

    def overall(self, now: Seconds) -> Statistics:
        """Statistics of all together, as they are."""
        return self._statistics(EVERYBODY, now)

    def _statistics(self, actor: str, now: Seconds) -> Statistics:
        one = self._actors[actor]
        busy = bool(self._busy) if actor == EVERYBODY else actor in self._busy
        estimate = one.engagement.update(now, busy=busy)
        statistics = Statistics(
            actor=actor, at=Stamp(self._clock, now), session=one.tally.session(), recent=one.tally.recent(now),
            engagement=estimate.value, level=estimate.level, reasons=estimate.reasons, busy=busy,
        )  # fmt: skip
        changes = (one.tally.next_change, one.engagement.next_change(now))
        self._agenda.set(actor, min((at for at in changes if at is not None), default=None))
        return statistics
