"""Seats: who is which person, among all browsers of all windows. Pure.

Two visitors may ask for one name at the same instant, in two windows that know nothing of one another. So who takes a
seat first shows a participant on the bus whose name says which person it claims, waits until all have seen that, and
gives way to the claim that comes first by its number.
"""

import re
from collections.abc import Collection
from uuid import uuid4

from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.messages import Message
from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.schemas.units import Seconds

SETTLED: Seconds = 0.5
"""Time after which a claim has been seen by all windows."""
_CLAIM = re.compile(r"(?:^|.*[-.])seat-(?P<number>[0-9a-f]{8})-(?P<person>.+)$")
"""Name of the participant that claims a seat; with keys, that of their holder stands before it."""


class Seats:
    """The claims on the bus, as one window knows them."""

    def __init__(self) -> None:
        self._claims: dict[str, tuple[str, str]] = {}
        """Number and person of each claim, by its participant."""

    def feed(self, message: Message) -> None:
        """Take news of who is on the bus; other messages tell nothing."""
        match message:
            case PeerAlive(participant=name) if (claim := _CLAIM.match(name)) is not None:
                self._claims[name] = (claim["number"], claim["person"])
            case PeerGone(participant=name):
                self._claims.pop(name, None)

    def name(self, wanted: str, people: Collection[str]) -> str:
        """A name that nobody has, or claims: the wanted one, if there is one. Raises InputRefused: it is taken.

        people: ids of those who are in the world.
        """
        taken = {*people, *(person for _, person in self._claims.values())}
        if wanted in taken:
            raise InputRefused(Fault(reason=f"{wanted!r} is there already", advice="take another name"))
        names = ("visitor", *(f"visitor-{number}" for number in range(2, len(taken) + 3)))
        return wanted or next(name for name in names if name not in taken)

    def claim(self, person: str, tries: int = 0) -> str:
        """Claim a person. Returns the name of the participant that is to show it.

        tries: claims that this visitor has given up before: a later one comes behind those that are older, so that
        nobody who chooses a place meanwhile has to count it.
        """
        number = f"{min(tries, 255):02x}{uuid4().hex[:6]}"
        name = f"seat-{number}-{person}"
        self._claims[name] = (number, person)
        return name

    def give_up(self, claim: str) -> None:
        """Let go of a claim."""
        self._claims.pop(claim, None)

    def is_first(self, claim: str) -> bool:
        """Tell whether no other claim of this person comes before this one."""
        own = self._claims[claim]
        return not any(person == own[1] and number < own[0] for number, person in self._claims.values())

    def before(self, claim: str, people: Collection[str]) -> int:
        """Number of those who are about to sit down, and choose their place before this one."""
        first = dict[str, str]()
        for number, person in self._claims.values():
            first[person] = min(number, first.get(person, number))  # the others give way, and choose anew
        own, _ = self._claims[claim]
        return sum(number < own and person not in people for person, number in first.items())
