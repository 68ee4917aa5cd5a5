"""Sync points as the realizer needs them: what each can wait for, and the seconds between them.

What a type of behavior is stands in schemas/behavior_types.py.
"""

from functools import lru_cache
from itertools import pairwise
from typing import Literal, NamedTuple

from engage_hri.schemas.behavior_types import TYPES, Performer, sync_points, types_with
from engage_hri.schemas.behaviors import Behavior, Event, Speech, Wait
from engage_hri.schemas.body import Estimate
from engage_hri.schemas.references import type_name
from engage_hri.schemas.units import Seconds


class Point(NamedTuple):
    """A sync point of a behavior of the block."""

    behavior: str
    sync: str

    def __str__(self) -> str:
        return f"{self.behavior or 'bml'}:{self.sync}"


ORIGIN = Point("", "start")
"""The start of the block itself."""

Gate = Literal["start", "hold", "prompt", "passive"]
"""How an instant of a behavior can be made to wait: not yet begun, holding there, or not at all.

prompt: holding there too, but it sets out so late that it need not. Who looks too early misleads.
"""

WITH_STROKE = types_with(has_stroke=True)
ON_TARGET = types_with(lasts=True, performer="body")
"""They last: having arrived, they stay until something ends them."""
BENEATH = types_with(turns_base=True)
"""They turn what a gaze returns to: one that starts during a gaze moves nothing, and ends at once."""

NOMINAL_PER_CHARACTER: Seconds = 0.07
GUESSED_SHORTEST: Seconds = 0.01
NOMINAL_DELAY: dict[str, Seconds] = {
    "directed_gaze": 0.3, "mutual_facial_gaze": 0.7, "adjacency_pair": 0.4, "backchannel": 0.0,
}  # fmt: skip
"""Mean delays of Table 2.1: what the decision of an event is expected to take."""


class Segment(NamedTuple):
    """From one point of a behavior to its next: seconds, and whether it can wait at the end."""

    since: str
    to: str
    shortest: Seconds
    natural: Seconds
    hold: bool


def performer(behavior: Behavior) -> Performer:
    return TYPES[type_name(behavior)].performer


def family(type: str) -> str:
    """Types of one family take each other's place: a later gaze takes over from an earlier one."""
    return TYPES[type].family or type


def hold_points(type: str) -> tuple[str, ...]:
    """Where it can wait for as long as it must, once begun. `start` of everything can wait too: it isn't sent."""
    return TYPES[type].holds


def one_instant(type: str) -> tuple[tuple[str, ...], ...]:
    """Points of a type that always coincide."""
    return TYPES[type].one_instant


@lru_cache(maxsize=1024)
def gate(type: str, syncs: tuple[str, ...]) -> Gate:
    """How a behavior can wait at the instant that holds its points `syncs`, in order.

    Where it comes to the first of them it must wait for all: holding at a later one would let the first pass alone.
    """
    if syncs[0] == "start":
        return "start"
    here = gate_point(type, syncs)
    if here not in hold_points(type):
        return "passive"
    return "prompt" if here == "stroke" else "hold"


@lru_cache(maxsize=1024)
def gate_point(type: str, syncs: tuple[str, ...]) -> str:
    """Of its points in one instant (in order), the one whose report says that the behavior is there."""
    first = next((group for group in one_instant(type) if syncs[0] in group), syncs[:1])
    return next((sync for sync in syncs if sync in first and sync in hold_points(type)), syncs[0])


def segments(behavior: Behavior, estimate: Estimate | None) -> tuple[Segment, ...]:
    """The phases of a behavior: as the body estimates them, nominal where it does not."""
    points, holds = sync_points(behavior), hold_points(type_name(behavior))
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
            # A guess must not be what refuses a block: nearly no time at all is thought possible.
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
            return (NOMINAL_DELAY[kind],)
    return TYPES[type_name(behavior)].nominal
