"""Stretches of a recording, each under one condition of a study. Pure."""

from collections.abc import Iterable

from msgspec import Struct

from engage_hri.schemas.conditions import StudyCondition
from engage_hri.schemas.messages import Message
from engage_hri.schemas.units import Seconds

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
    under, as the recorder was told; it holds until one is set, and from a restart of generation on.
    """
    names = [(0.0, named)]
    for message, at in told:
        if isinstance(message, StudyCondition):
            names.append((max(0.0, at), message.name if message.by else named))
    begun = dict(sorted(names, key=lambda one: one[0]))  # of two at one instant the later one holds
    found: list[Stretch] = []
    for begin, name in begun.items():
        if found and found[-1].name == name:
            continue
        if found:
            found[-1] = Stretch(found[-1].name, found[-1].begin, begin)
        found.append(Stretch(name, begin, duration))
    return found if any(one.name for one in found) else [Stretch(UNNAMED, 0.0, duration)]
