"""Sync points for the realizer: how a behavior can wait at each, and the seconds between them.

Each type of behavior has a row in schemas/behavior_types.py.
"""

import re
from collections.abc import Iterable
from functools import lru_cache
from itertools import pairwise
from typing import Any, Literal, NamedTuple, TypeVar

from msgspec import Struct

from engage_hri.schemas.behavior_types import TYPES, Performer, sync_points, types_with
from engage_hri.schemas.behaviors import EVENT_KINDS, Behavior, Event, Speech, Wait
from engage_hri.schemas.body import Estimate
from engage_hri.schemas.references import type_name
from engage_hri.schemas.units import Seconds


class Point(NamedTuple):
    """A sync point of a behavior of the block."""

    behavior: str
    sync: str

    def __str__(self) -> str:
        return f"{self.behavior or 'bml'}:{self.sync}"


EPSILON: Seconds = 1e-6
"""Seconds; instants that differ by less are one."""

ORIGIN = Point("", "start")
"""The start of the block itself."""
FINISH = Point("", "end")
"""The end of the block itself, the last transition of its net."""

Gate = Literal["start", "hold", "prompt", "passive"]
"""How a behavior can be made to wait at an instant.

start: it is not begun yet. hold: it comes there and holds. passive: it cannot wait there.
prompt: it could hold, but sets out so late that it need not. (A look that is on its target too early misleads.)
"""


LIFE = "\u2063"
"""An invisible separator: in the name of a block, between its id and a number. No text that is told has it."""
_LIVES = re.compile(rf"(?:{LIFE}|\\u2063)[0-9]+")
"""The end of a name, also where the name was quoted."""


def as_told(text: str) -> str:
    """A text with the ids of blocks for their names."""
    return _LIVES.sub("", text)


T = TypeVar("T")
_NOTHING: frozenset[Any] = frozenset()


def frozen(items: Iterable[T] = ()) -> frozenset[T]:
    """The items as a set, and the same object whenever there are none: a live block keeps a dozen of those."""
    return frozenset(items) or _NOTHING


class Member(Struct, frozen=True, gc=False):
    """A behavior's part in an instant: how it can be made to wait there, and the point that is reported then."""

    behavior: str
    kind: Gate
    point: Point

    @property
    def can_wait(self) -> bool:
        """True if it can hold there, once begun."""
        return self.kind in ("hold", "prompt")


WITH_STROKE = types_with(has_stroke=True)
ON_TARGET = types_with(lasts=True, performer="body")
"""Types that stay where they are, once arrived, until something ends them."""
SHIFTS = types_with(turns_base=True)
"""Types that turn what a gaze returns to. One that starts during a gaze moves nothing, and ends at once."""

NOMINAL_PER_CHARACTER: Seconds = 0.07
GUESSED_SHORTEST: Seconds = 0.01


class Segment(NamedTuple):
    """Phase from one point of a behavior to its next: seconds, and whether the behavior can wait at its end."""

    since: str
    to: str
    shortest: Seconds
    natural: Seconds
    hold: bool


def performer(behavior: Behavior) -> Performer:
    return TYPES[type_name(behavior)].performer


def stands_soon(behavior: Behavior) -> bool:
    """True if it stands soon once it is held: a voice between two words, a clock at once.

    A movement goes on to where it can wait.
    """
    return isinstance(behavior, Speech) or performer(behavior) != "body"


def family(type: str) -> str:
    """Name that is common to types that take each other's place: a later gaze takes over from an earlier one."""
    return TYPES[type].family or type


@lru_cache(maxsize=1024)
def gate(type: str, syncs: tuple[str, ...]) -> Gate:
    """The way in which a behavior can wait at the instant that holds its points `syncs`, in order.

    The first of them decides: a behavior that holds at a later one has passed the first alone.
    """
    if syncs[0] == "start":
        return "start"
    here = gate_point(type, syncs)
    if here not in TYPES[type].holds:
        return "passive"
    return "prompt" if here in ("stroke", "stroke_start") else "hold"


@lru_cache(maxsize=1024)
def gate_point(type: str, syncs: tuple[str, ...]) -> str:
    """The point that is reported when the behavior has come to the instant of its points `syncs` (in order)."""
    first = next((group for group in TYPES[type].one_instant if syncs[0] in group), syncs[:1])
    return next((sync for sync in syncs if sync in first and sync in TYPES[type].holds), syncs[0])


def segments(behavior: Behavior, estimate: Estimate | None) -> tuple[Segment, ...]:
    """The phases of a behavior: as the body estimates them, nominal where it does not."""
    points, holds = sync_points(behavior), TYPES[type_name(behavior)].holds
    nominal = _nominal(behavior, points)
    known = {(phase.since, phase.to): phase for phase in estimate.phases} if estimate else {}
    total = sum(phase.natural for phase in known.values())
    if isinstance(behavior, Speech) and known and not all(pair in known for pair in pairwise(points)):
        scale = total / (sum(nominal) or 1.0)
        nominal, known = tuple(seconds * scale for seconds in nominal), {}
    result = []
    for (since, to), seconds in zip(pairwise(points), nominal, strict=True):
        if phase := known.get((since, to)):
            shortest, natural = phase.shortest, phase.natural
        else:
            # A guess must not cause the refusal of a block: nearly no time at all counts as possible.
            shortest, natural = seconds if isinstance(behavior, Wait) else min(GUESSED_SHORTEST, seconds), seconds
        result.append(Segment(since, to, min(shortest, natural), natural, to in holds))
    return tuple(result)


def _nominal(behavior: Behavior, points: tuple[str, ...]) -> tuple[Seconds, ...]:
    match behavior:
        case Speech(text=text):
            marks = sorted(mark.position for mark in behavior.marks)
            places = [0, *marks, len(text)]
            return tuple(max(0, to - since) * NOMINAL_PER_CHARACTER for since, to in pairwise(places))
        case Wait(duration=duration):
            return (duration or 0.0,)
        case Event(kind=kind):
            return (EVENT_KINDS[kind].delay,)
    return TYPES[type_name(behavior)].nominal
