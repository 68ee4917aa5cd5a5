"""Statistics messages of each person and of all together: made anew whenever something in them changes."""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Set
from functools import partial

from engage_hri.schemas.recognition import ConnectionEvent, Statistics
from engage_hri.schemas.units import Probability, Seconds, Stamp
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

    def changes(self, now: Seconds) -> bool:
        """True if an event leaves the recent window now, or the level changes."""
        leaves = self.tally.next_change is not None and self.tally.next_change <= now
        return leaves or self.engagement.changes(now)


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
        self,
        changes: Iterable[ConnectionEvent | PersonForgotten],
        busy: Set[str],
        now: Seconds,
        contacts: Mapping[str, Probability] = {},
    ) -> list[Statistics]:
        """Count changes, in their order. Returns the statistics that are new.

        busy: persons with a task in hand. contacts: how much of a contact there is now, where that has changed.
        """
        due, touched = set(iter(lambda: self._agenda.due(now), None)), set[str]()
        for actor, much in contacts.items():
            if self._actors[actor].engagement.contact.now != much:
                self._actors[actor].engagement.touch(much, now)
                due.add(actor)
        for change in changes:
            if isinstance(change, PersonForgotten):
                self._actors.pop(change.actor, None)
                self._agenda.clear(change.actor)
                touched.discard(change.actor)
                due.discard(change.actor)
                continue
            for name in (change.person(self._robot), EVERYBODY):
                self._actors[name].tally.feed(change)
                touched.add(name)
        if busy != self._busy:
            touched |= {EVERYBODY, *(busy ^ self._busy)}
            self._busy = frozenset(busy)
        # What changes by the passing of time is told if it changes the level, or leaves the recent window.
        touched |= {actor for actor in due if actor in self._actors and self._actors[actor].changes(now)}
        for actor in due - touched:
            self._set_alarm(actor, now)
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
        self._set_alarm(actor, now)
        return statistics

    def _set_alarm(self, actor: str, now: Seconds) -> None:
        one = self._actors[actor]
        changes = (one.tally.next_change, one.engagement.next_change(now))
        self._agenda.set(actor, min((at for at in changes if at is not None), default=None))
