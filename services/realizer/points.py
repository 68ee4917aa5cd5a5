"""Which sync points each type of behavior has, which of them are one instant, and at which it can wait.

Thesis 4.1.2, with BML 1.0's types. Everything here uses the drafts' names; `schemas/syncref.py` knows the dialects.
"""

from functools import lru_cache
from itertools import pairwise
from typing import Literal, NamedTuple

from engage_hri.schemas.behaviors import Behavior, Event, Mark, Speech, TurnSignal, Wait
from engage_hri.schemas.body import Estimate
from engage_hri.schemas.references import type_name
from engage_hri.schemas.syncref import SYNC_POINTS
from engage_hri.schemas.units import Seconds


class Point(NamedTuple):
    """A sync point of a behavior of the block."""

    behavior: str
    sync: str

    def __str__(self) -> str:
        return f"{self.behavior or 'bml'}:{self.sync}"


ORIGIN = Point("", "start")
"""The start of the block itself."""

Performer = Literal["body", "recognition", "clock"]
Gate = Literal["start", "hold", "prompt", "passive"]
"""How an instant of a behavior can be made to wait: not yet begun, holding there, or not at all.

prompt: holding there too, but it sets out so late that it need not. Who looks too early misleads.
"""

WITH_STROKE = frozenset({"gesture", "pointing", "head"})
ON_TARGET = frozenset({"gaze", "face", "faceLexeme", "faceFacs", "posture"})
"""They last: having arrived, they stay until something ends them."""
BENEATH = frozenset({"gazeShift", "headDirectionShift"})
"""They turn what a gaze returns to: one that starts during a gaze moves nothing, and ends at once."""
_FAMILY = {
    "faceLexeme": "face", "faceFacs": "face", "faceShift": "face", "postureShift": "posture", "pose": "posture",
    "gazeShift": "gaze", "headDirectionShift": "gaze",
}  # fmt: skip
_PERFORMERS: dict[str, Performer] = {
    "event": "recognition", "turn": "recognition", "wait": "clock", "emit": "clock", "unknown": "clock"
}  # fmt: skip

_ONE_INSTANT = {"gaze": (("start", "ready", "stroke_start"), ("stroke_end", "relax"))}
_LASTING_INSTANT = (("ready", "stroke_start", "stroke"), ("stroke_end", "relax"))

NOMINAL_STROKE: tuple[Seconds, ...] = (0.5, 0.1, 0.3, 0.2, 0.1, 0.6)
"""Seconds per phase of a behavior with all seven points, where no body says better."""
NOMINAL_GAZE: tuple[Seconds, ...] = (0.0, 0.0, 0.4, 0.0, 0.0, 0.4)
NOMINAL_ON_TARGET: tuple[Seconds, ...] = (0.4, 0.0, 0.0, 0.0, 0.0, 0.4)
NOMINAL_SHIFT: Seconds = 0.5
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
    return _PERFORMERS.get(type_name(behavior), "body")


def family(type: str) -> str:
    """Types of one family take each other's place: a later gaze takes over from an earlier one."""
    return _FAMILY.get(type, type)


def marks_in_order(speech: Speech) -> tuple[Mark, ...]:
    return tuple(sorted(speech.marks, key=lambda mark: mark.position))


def sync_points(behavior: Behavior) -> tuple[str, ...]:
    """The default points of a behavior, in order."""
    if isinstance(behavior, Speech):
        return ("start", *(mark.id for mark in marks_in_order(behavior)), "end")
    type = type_name(behavior)
    return SYNC_POINTS if type in WITH_STROKE or type in ON_TARGET else ("start", "end")


def hold_points(type: str) -> frozenset[str]:
    """Where it can wait for as long as it must, once begun. `start` of everything can wait too: it isn't sent."""
    if type in WITH_STROKE:
        return frozenset({"stroke_start", "stroke_end"})
    if type in ON_TARGET:
        return frozenset({"stroke", "relax"})
    return frozenset({"end"}) if type == "wait" else frozenset()


def one_instant(type: str) -> tuple[tuple[str, ...], ...]:
    """Points of a type that always coincide."""
    return _ONE_INSTANT.get(type, _LASTING_INSTANT if type in ON_TARGET else ())


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
            places = [0, *(mark.position for mark in marks_in_order(behavior)), len(text)]
            return tuple(max(0, to - since) * NOMINAL_PER_CHARACTER for since, to in pairwise(places))
        case Wait(duration=duration):
            return (duration or 0.0,)
        case Event(kind=kind):
            return (NOMINAL_DELAY[kind],)
        case TurnSignal():
            return (0.0,)
    if len(points) == 2:
        return (0.0 if type_name(behavior) == "emit" else NOMINAL_SHIFT,)
    if type_name(behavior) == "gaze":
        return NOMINAL_GAZE
    return NOMINAL_ON_TARGET if type_name(behavior) in ON_TARGET else NOMINAL_STROKE
