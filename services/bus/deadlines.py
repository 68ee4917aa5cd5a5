"""Waits for others: when each is due, whether lateness counts, and who is gone and forgotten. Pure.

Everybody here waits for others: for an answer, a renewal, a person who was there. Three things go wrong with that.
A process that stood still itself, or had no router, takes all others for late: it would end what goes well, and say
that it was their fault (`Sight`, `Silences`). A wait that is looked for among all others takes the longer the more
there are (`Deadlines`). And a robot in a lobby meets thousands of people, clients and programs, each under a name
that never comes again: whoever keeps something of each grows for ever (`Absent`).
"""

import heapq
from collections.abc import Callable, Collection, Hashable, Iterator
from itertools import count
from math import inf
from typing import Any, Generic, TypeVar

from engage_hri.schemas.faults import ROUTER, Cause, Fault
from engage_hri.schemas.units import Seconds

SLACK: Seconds = 0.5
"""Time between the loss of a link and the news who is not seen for that: they come from different threads."""
NEVER: Seconds = -inf
LATE: Seconds = 0.05
"""Lateness from which on this process did not look, and the time for what came meanwhile to be heard."""
STANDSTILL: Seconds = 1.0
"""Lateness from which on this process, or its machine, counts as having stood still: others have missed it."""
UNSEEN = "it, its machine or the network has ended, stands still or is late"


class Sight:
    """View that one participant has of the others. name: its own.

    unlinked_at: tells when it last had no router. woke_at: when it last looked late. asleep_at: when it last stood
    still. slept: seconds for which it has stood still in all.
    """

    __slots__ = ("asleep_at", "name", "slept", "unlinked_at", "woke_at")

    def __init__(self, name: str, unlinked_at: Callable[[], Seconds] = lambda: NEVER) -> None:
        self.name = name
        self.unlinked_at = unlinked_at
        self.woke_at = self.asleep_at = NEVER
        self.slept: Seconds = 0.0

    def look(self, now: Seconds, due: Seconds) -> bool:
        """Take in the time. due: when this was to happen. True: this comes so late that others are heard first."""
        late = now - max(due, self.woke_at)
        if late >= STANDSTILL:
            self.asleep_at = now
            self.slept += late
        if is_late := late > LATE:
            self.woke_at = now
        return is_late

    def misses(self, whose: str, where: str, since: Seconds, now: Seconds, advice: str = "") -> Fault:
        """Fault of something that ends because somebody is not seen. since: time since which it is not."""
        what = f"{whose} has not been seen for {now - since:.1f} s"
        return self.fault(what, UNSEEN, "gone", whose, where, since, advice)

    def unrenewed(self, whose: str, where: str, since: Seconds, now: Seconds) -> Fault:
        """Fault of something that ends because who has asked for it has not renewed it. since: when it did."""
        what = f"{whose} has not renewed it for {now - since:.1f} s"
        return self.fault(what, UNSEEN, "unrenewed", whose, where, since)

    def restarted(self, whose: str, where: str, advice: str = "") -> Fault:
        """Fault of something that ends because somebody has begun another life."""
        reason = f"{whose} was restarted"
        return Fault(reason=reason, where=where, cause="restarted", whose=whose, advice=advice, service=self.name)

    def fault(
        self, what: str, why: str, cause: Cause, whose: str, where: str, since: Seconds, advice: str = ""
    ) -> Fault:
        """Fault of something that has not come by now; one's own, or the router's, if that was so since `since`.

        what: what has not come, in words. why, cause, whose, advice: as it is if neither is so.
        """
        if self.asleep_at >= since - SLACK:
            why, cause, whose = f"{self.name} itself, or its machine, stood still", "frozen", self.name
        elif self.unlinked_at() >= since - SLACK:
            why, cause, whose = f"{self.name} has had no router", "unlinked", ROUTER
        reason = f"{what}: {why}" if why else what
        return Fault(reason=reason, where=where, cause=cause, whose=whose, advice=advice, service=self.name)


K = TypeVar("K", bound=Hashable)
OUTDATED = 64
"""Outdated entries that are always tolerated."""


class Deadlines(Generic[K]):
    """One deadline at most for each name. Setting, clearing and asking for the earliest take logarithmic time.

    order: sort key of names that have equal deadlines; without it the one that was set first comes first.
    look: when to call `due`, the earliest deadline; infinite if there is none.
    """

    def __init__(self, order: Callable[[K], Any] | None = None) -> None:
        self.look = inf
        self._at: dict[K, Seconds] = {}
        self._heap: list[tuple[Seconds, Any, int, K]] = []
        """Entries, outdated ones too: these go when they reach the top, or when they outnumber the others by far.
        So the top is never outdated."""
        self._order = order
        self._count = count()

    def clear(self, name: K) -> None:
        """Remove the deadline of `name`, if it has one."""
        if self._at.pop(name, None) is not None:
            self._settle()

    def set(self, name: K, at: Seconds | None) -> None:
        """Give `name` this deadline instead of any other; None removes it."""
        if at is None:
            self.clear(name)
        elif self._at.get(name) != at:
            self._at[name] = at
            changes_look = at <= self.look or self._heap[0][-1] == name
            heapq.heappush(self._heap, (at, self._order and self._order(name), next(self._count), name))
            if len(self._heap) > OUTDATED + 4 * len(self._at):
                self._heap = [entry for entry in self._heap if self._at.get(entry[-1]) == entry[0]]
                heapq.heapify(self._heap)
            if changes_look:
                self._settle()

    def _settle(self) -> None:
        """Drop outdated entries from the top."""
        heap, at = self._heap, self._at
        while heap and at.get(heap[0][-1]) != heap[0][0]:
            heapq.heappop(heap)
        self.look = heap[0][0] if heap else inf

    def __getitem__(self, name: K) -> Seconds | None:
        return self._at.get(name)

    def __iter__(self) -> Iterator[K]:
        return iter(self._at)

    @property
    def earliest(self) -> Seconds | None:
        """The earliest deadline; None if there is none."""
        return self._heap[0][0] if self._heap else None

    @property
    def first(self) -> K | None:
        """The name that has the earliest deadline; None if there is none."""
        return self._heap[0][-1] if self._heap else None

    def due(self, now: Seconds) -> K | None:
        """Remove the earliest deadline that has come and return its name; None if none has come."""
        earliest = self.earliest
        if earliest is None or earliest > now:
            return None
        name = heapq.heappop(self._heap)[-1]
        del self._at[name]
        self._settle()
        return name


class Silences(Deadlines[K]):
    """Deadlines of what others are to do.

    Time for which this process stood still does not count against them, and what came meanwhile is heard first: such
    a deadline is put off, once. is_own: deadlines that are no others'.
    """

    def __init__(
        self,
        sight: Sight,
        order: Callable[[K], Any] | None = None,
        is_own: Callable[[K], bool] = lambda name: False,
    ) -> None:
        super().__init__(order)
        self._sight = sight
        self._is_own = is_own
        self._slept: dict[K, Seconds] = {}
        """For each that can still be put off: for how long this process had stood still when it was set."""
        self._kept: dict[K, Seconds] = {}
        """For each that `keep` has set: what was asked for."""

    def clear(self, name: K) -> None:
        super().clear(name)
        self._slept.pop(name, None)
        self._kept.pop(name, None)

    def set(self, name: K, at: Seconds | None) -> None:
        if at is not None and at != self[name]:
            self._slept[name] = self._sight.slept
        super().set(name, at)

    def keep(self, name: K, at: Seconds | None, now: Seconds) -> None:
        """Set a deadline that is computed anew again and again: as long as it comes out the same, it stays put off.

        If it has passed when it first comes out so, it is due now: nobody has stood still meanwhile.
        """
        if at is None:
            self.clear(name)
        elif at != self._kept.get(name):
            self.set(name, max(at, now))
            self._kept[name] = at

    def standing(self, name: K, at: Seconds) -> Seconds:
        """The deadline that stands for `at`: later, if `keep` has it and it was put off."""
        kept = self[name] if self._kept.get(name) == at else None
        return at if kept is None else kept

    def due(self, now: Seconds) -> K | None:
        while (at := self.earliest) is not None and at <= now:
            self._sight.look(now, at)
            name = super().due(now)
            assert name is not None
            before = self._slept.pop(name, None)
            later = now
            if before is not None and not self._is_own(name):
                later = max(at + self._sight.slept - before, self._sight.woke_at + LATE)
            if later <= now:
                self._kept.pop(name, None)
                return name
            super().set(name, later)
        return super().due(now)


FORGOTTEN_AFTER: Seconds = 600.0
"""Time for which somebody who has gone, or a request that has ended, is remembered: the bound of all that runs long.
The same name then means somebody new."""


class Absent(Generic[K]):
    """The names of those who are not there, with the time since when; whoever left first comes first.

    Leaving, coming back and forgetting take constant time each, however many have gone.
    """

    def __init__(self) -> None:
        self._since: dict[K, Seconds] = {}

    def __len__(self) -> int:
        return len(self._since)

    def __contains__(self, name: K) -> bool:
        return name in self._since

    def leaves(self, name: K, now: Seconds) -> None:
        """Note that somebody has left, or has given a sign from elsewhere: it counts as absent since now."""
        self._since.pop(name, None)
        self._since[name] = now

    def comes(self, name: K) -> None:
        """Note that somebody is there; nothing changes for who was."""
        self._since.pop(name, None)

    def latest(self) -> Iterator[tuple[K, Seconds]]:
        """All, with the time since when; whoever left last comes first."""
        return ((name, self._since[name]) for name in reversed(self._since))

    def forgotten(self, now: Seconds) -> list[K]:
        """Remove and return those who have been absent for so long."""
        gone = []
        for name, since in self._since.items():
            if since + FORGOTTEN_AFTER > now:
                break
            gone.append(name)
        for name in gone:
            del self._since[name]
        return gone


class Acquaintances:
    """The people of whom something is known: those whose face is in the world, and all others by their last sign."""

    def __init__(self) -> None:
        self._seen: frozenset[str] = frozenset()
        self._absent: Absent[str] = Absent()

    def see(self, people: Collection[str], now: Seconds) -> None:
        """Take the people in the world: nobody is forgotten who is in it."""
        seen = frozenset(people)
        for person in self._seen - seen:
            self._absent.leaves(person, now)
        for person in seen - self._seen:
            self._absent.comes(person)
        self._seen = seen

    def hear(self, person: str, now: Seconds) -> None:
        """Take any other sign of somebody: what they do, or what is told of them."""
        if person not in self._seen:
            self._absent.leaves(person, now)

    def forgotten(self, now: Seconds) -> list[str]:
        """Take out those to forget by now; each is told once."""
        return self._absent.forgotten(now)
