"""Statistics of each person and of all together: counted as events come, made when somebody reads them.

What is counted is cheap, a message of it is not, and people read numbers that change once a second at most. So `feed`
counts, and `told` makes the messages that are due: at once if a level changes or somebody gets busy, or if nothing
has been told of that actor for `TOLD_EVERY`; what changes sooner is told together when that time is over. Who needs
the numbers of the end only, as after a replay, asks for them then (`overall`), and none are made before.
"""

from collections import defaultdict
from collections.abc import Collection, Mapping, Set
from functools import partial
from math import inf, isfinite

from engage_hri.schemas.recognition import ConnectionEvent, HeadHabit, PersonContact, Statistics
from engage_hri.schemas.units import Probability, Seconds, Stamp
from engage_hri.services.bus.deadlines import Deadlines
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.events.machine import PersonForgotten
from engage_hri.services.recognition.statistics.engagement import Engagement
from engage_hri.services.recognition.statistics.tally import EventTally

TOGETHER = ""
"""Stands for all people, in statistics."""
TOLD_EVERY: Seconds = 1.0
"""Least time between two messages of one actor, unless the level changes or somebody gets busy. Decision 0182."""


class _ActorStatistics:
    """Counts and estimate of one person, or of all."""

    def __init__(self, config: RecognitionConfig, clock: str, robot: str) -> None:
        self.tally = EventTally(config.window, clock)
        self.engagement = Engagement(config, self.tally, robot)
        self.head: HeadHabit | None = None
        self.told_at: Seconds = -inf
        self.is_new = False
        """True if something has changed since it was told."""
        self.is_urgent = False
        """True if that is to be told at once."""
        self.leaves: Seconds = inf
        """Time at which the next event leaves the recent window that was told."""
        self.held_until: Seconds = inf
        """Time until which contact is what it was in a former life, unless something tells of it before."""

    def look(self, now: Seconds) -> None:
        """Take what changes by the passing of time."""
        if self.held_until <= now:
            self.engagement.touch(None, self.held_until)
            self.held_until = inf
        news = self.engagement.news(now)
        self.is_new = self.is_new or self.leaves <= now or news == "value"
        self.is_urgent = self.is_urgent or news == "level"

    def is_due(self, now: Seconds) -> bool:
        return self.is_urgent or (self.is_new and now >= self.told_at + TOLD_EVERY)

    def next_look(self, now: Seconds) -> Seconds | None:
        """Time at which it next changes by itself, or what has changed is to be told."""
        sooner = self.told_at + TOLD_EVERY if self.is_new else self.leaves
        changes = [sooner, self.held_until, self.engagement.next_change(now)]
        return min((at for at in changes if at is not None and at < inf), default=None)


class PublishedStatistics:
    """Statistics of all persons. robot: each event counts for the other one of its two. clock: of the stamps."""

    def __init__(self, robot: str, config: RecognitionConfig, clock: str = "loop") -> None:
        self._robot = robot
        self._clock = clock
        self._config = config
        self._actors = defaultdict[str, _ActorStatistics](partial(_ActorStatistics, config, clock, robot))
        self._changed: set[str] = set()
        """Actors of whom something has come in since `told` was last called."""
        self._agenda: Deadlines[str] = Deadlines(str)
        self._busy: frozenset[str] = frozenset()
        self._held_busy: dict[str, Seconds] = {}
        """Persons who were busy in a former life, each until when that holds unless something tells of it before."""

    @property
    def deadline(self) -> Seconds | None:
        """Time at which `told` has something to do, though nothing has come in."""
        return None if self._agenda.look == inf else self._agenda.look

    def feed(
        self,
        changes: Collection[ConnectionEvent | PersonForgotten],
        busy: Set[str],
        now: Seconds,
        contacts: Mapping[str, Probability | None] = {},
        heads: Mapping[str, HeadHabit] = {},
        here: Mapping[str, bool] = {},
    ) -> None:
        """Count changes, in their order.

        busy: persons with a task in hand. contacts: how much of a contact there is now, where that may have changed.
        heads: what is known of people's heads, where that has changed. here: who has come, and (false) who has left.
        """
        if busy == self._busy and not (changes or contacts or heads or here or self._held_busy):
            return
        for actor, head in heads.items():
            self._actors[actor].head, self._actors[actor].is_new = head, True
            self._changed.add(actor)
        for actor, much in contacts.items():
            one = self._actors[actor]
            one.held_until = inf
            if one.engagement.contact.now != much:
                one.engagement.touch(much, now)
                self._changed.add(actor)
        for actor, is_here in here.items():
            self._actors[actor].engagement.comes_or_leaves(now, is_here=is_here)
            self._changed.add(actor)
        for change in changes:
            if isinstance(change, PersonForgotten):
                self._actors.pop(change.actor, None)
                self._agenda.clear(change.actor)
                self._changed.discard(change.actor)
                continue
            for name in (change.person(self._robot), TOGETHER):
                one = self._actors[name]
                one.tally.feed(change)
                one.is_new = True
                self._changed.add(name)
        if self._held_busy:
            self._held_busy = {id: until for id, until in self._held_busy.items() if id not in busy and now < until}
            busy = busy | self._held_busy.keys()
        if busy != self._busy:
            self._get_busy(frozenset(busy), now)

    def resume(self, former: Statistics, now: Seconds) -> None:
        """Go on from the numbers of a former life: contacts and tasks until something tells of them.

        If nothing does within the window of the recent statistics, they are over by then.
        """
        name, until = former.actor, now + self._config.window
        one = self._actors[name]
        one.tally.resume(former.session)
        one.head = former.head
        one.engagement.resume(former)
        one.held_until = until
        if former.busy and name != TOGETHER:
            self._held_busy[name] = until
            self._busy |= {name}
        one.is_new = True
        self._changed.add(name)

    def remember(self, event: ConnectionEvent) -> None:
        """Take an event of the recent window of a former life, as it last was."""
        for name in (event.person(self._robot), TOGETHER):
            self._actors[name].tally.remember(event)

    def join(self, other: str, kept: str, now: Seconds) -> None:
        """Count the events of a person as those of `kept`, too. The estimate goes on from who is the more engaged."""
        if other not in self._actors:
            return
        one = self._actors.pop(other)
        self._agenda.clear(other)
        self._changed.discard(other)
        if (before := self._actors.get(kept)) is not None:
            if not one.engagement.is_above(before.engagement):
                before.engagement.touch(one.engagement.contact.now, now)
                one, before = before, one
            one.tally.join(before.tally)
            one.head = one.head or before.head
        self._actors[kept] = one
        one.is_new = one.is_urgent = True
        self._changed.add(kept)

    def resume_event(self, event: ConnectionEvent) -> None:
        """Take an event that goes on from a former life, which has counted its start."""
        for name in (event.person(self._robot), TOGETHER):
            self._actors[name].tally.resume_event(event)

    def _get_busy(self, busy: frozenset[str], now: Seconds) -> None:
        """Freeze the estimate of who has got busy, and of all, as it is now; or let it go."""
        changed, self._busy = {TOGETHER, *(busy ^ self._busy)}, busy
        for actor in changed:
            one = self._actors[actor]
            one.is_urgent = True
            if self._is_busy(actor):
                one.engagement.update(now, busy=True)
            else:
                one.engagement.get_free(now)
        self._changed |= changed

    def _is_busy(self, actor: str) -> bool:
        return bool(self._busy) if actor == TOGETHER else actor in self._busy

    def told(self, now: Seconds) -> list[Statistics]:
        """Make the statistics that are to be told by now."""
        due = set(iter(lambda: self._agenda.due(now), None))
        looked_at, self._changed = due | self._changed, set()
        told = []
        for actor in sorted(looked_at):
            one = self._actors[actor]
            one.look(now)
            if one.is_due(now):
                told.append(self.statistics(actor, now))
                one.told_at, one.is_new, one.is_urgent = now, False, False
                one.leaves = inf if (leaves := one.tally.next_change(now)) is None else leaves
            self._agenda.set(actor, one.next_look(now))
        return told

    def overall(self, now: Seconds) -> Statistics:
        """Statistics of all together, as they are."""
        return self.statistics(TOGETHER, now)

    def statistics(self, actor: str, now: Seconds) -> Statistics:
        """Statistics of an actor, as they are."""
        one = self._actors[actor]
        busy = self._is_busy(actor)
        engagement = one.engagement
        estimate = engagement.update(now, busy=busy)
        contact = PersonContact(
            now=engagement.contact.now, share=engagement.contact.share(now), ended=self._stamp(engagement.apart_since)
        )
        return Statistics(
            actor=actor, at=Stamp(self._clock, now), session=one.tally.session(), recent=one.tally.recent(now),
            engagement=estimate.value, level=estimate.level, reasons=estimate.reasons, busy=busy,
            busy_until=self._stamp(engagement.busy_until), level_since=self._stamp(engagement.level_since),
            contact=contact, head=one.head,
        )  # fmt: skip

    def _stamp(self, at: Seconds) -> Stamp | None:
        return Stamp(self._clock, at) if isfinite(at) else None
