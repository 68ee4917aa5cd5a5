"""Stretches of a recording, each under one condition of a study. Pure."""

from collections.abc import Iterable

from msgspec import Struct

from engage_hri.schemas.messages import Message
from engage_hri.schemas.units import Seconds
from engage_hri.services.reports.in_force import InForce

UNNAMED = "recorded"
"""Condition of recordings that name none."""


class Stretch(Struct, frozen=True):
    """A part of a recording. name: of the condition; empty: it belongs to none. begin, end: in the recording."""

    name: str
    begin: Seconds
    end: Seconds

    @property
    def seconds(self) -> Seconds:
        return self.end - self.begin


def stretches(told: Iterable[tuple[Message, Seconds]], named: str, duration: Seconds) -> list[Stretch]:
    """Divide a recording where a condition was set. All of it is one stretch if none was.

    told: messages with their times in the recording. named: the condition that the recording was made
    under, as the recorder was told; it holds until one is set. A condition that was set ends with its generation:
    none is in force until one is set again.
    """
    names, study = [(0.0, named)], InForce()
    for message, at in told:
        before, study = study, study.after(message)
        if study.told is not before.told:
            names.append((max(0.0, at), _name(study, named)))
    begun = dict(sorted(names, key=lambda one: one[0]))  # of two at one instant the later one holds
    found: list[Stretch] = []
    for begin, name in begun.items():
        if found and (found[-1].name == name or begin >= duration):
            continue
        if found:
            found[-1] = Stretch(found[-1].name, found[-1].begin, begin)
        found.append(Stretch(name, begin, duration))
    return found if any(one.name for one in found) else [Stretch(UNNAMED, 0.0, duration)]


def _name(study: InForce, named: str) -> str:
    """The condition that counts. named: the recorder's, which counts where nobody has set one."""
    if study.told is not None and study.told.by:
        return study.told.name
    return named if study.lost is None else ""
