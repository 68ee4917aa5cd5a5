"""Words for a visitor before they sit down: who is at the table already, and what sitting there means. Pure."""

from collections.abc import Collection, Mapping

from msgspec import Struct

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
