"""Rule for forgetting: who has gone, and since when, for everything that remembers anybody. Pure.

A robot in a lobby meets thousands of people, clients and programs, each under a name that never comes again. Whoever
keeps something of each of them grows for ever, and slows down with everybody who ever passed.
"""

from collections.abc import Collection, Hashable, Iterator
from typing import Generic, TypeVar

from engage_hri.schemas.units import Seconds

K = TypeVar("K", bound=Hashable)
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

    def forgotten(self, now: Seconds, after: Seconds = FORGOTTEN_AFTER) -> list[K]:
        """Remove and return those who have been absent for so long."""
        gone = []
        for name, since in self._since.items():
            if since + after > now:
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
