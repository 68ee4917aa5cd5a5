"""Seats: who is which person, among all browsers of all windows, and what sitting down means. Pure.

Two visitors may ask for one name at the same instant, in two windows that know nothing of one another. So who takes a
seat first shows a participant on the bus whose name says which person it claims, waits until all have seen that, and
gives way to the claim that comes first by its number.
"""

import re
from collections.abc import Collection, Mapping
from uuid import uuid4

from msgspec import Struct

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


SIMULATION = "simulation"
"""Participant that plays a person."""
TASK = "collaboration"
"""Participant that has the robot do a task with whom it meets first."""
ALONE = "to have the robot for yourself, start it with `engage demo --you`"


class Invitation(Struct, frozen=True):
    """An invitation to sit down. there: who is there already, and what comes of that. button: its words."""

    there: str = ""
    button: str = "Take a seat"


def invitation(people: Collection[str], reporters: Mapping[str, str], here: Collection[str]) -> Invitation:
    """Make the invitation for somebody who may sit down.

    people: ids of those who are there. reporters: the participant that tells of each, as far as that is known.
    here: participants on the bus.
    """
    if not people:
        return Invitation("Nobody sits before the robot. You sit opposite it, and it looks at you.")
    simulated = [each for each in people if reporters.get(each) == SIMULATION]
    others = [each for each in people if each not in simulated]
    told = []
    if simulated:
        played = "is" if len(simulated) == 1 else "are"
        who = _listed(simulated)
        told.append(f"{who} {_sits(simulated)} before the robot already, and {played} played by a program.")
    if others:
        told.append(f"{_listed(others)} {_sits(others)} {'there, too' if simulated else 'before the robot already'}.")
    told.append("You may sit down beside them: the robot sees you, and looks back at you.")
    if TASK in here:
        told.append("But it does its task with the person whom it met first, until that person leaves.")
    if simulated:
        told.append(f"{ALONE[0].upper()}{ALONE[1:]}.")
    return Invitation(" ".join(told), f"Sit beside {_listed(list(people))}")


def _listed(names: list[str]) -> str:
    if len(names) > 3:
        return f"{names[0]}, {names[1]} and {len(names) - 2} others"
    return " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))


def _sits(names: list[str]) -> str:
    return "sits" if len(names) == 1 else "sit"
