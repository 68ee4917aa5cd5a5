"""Check of what a body tells of a behavior, as it tells it: drivers are programs of others. Pure.

Bodies are held to all of the contract by `testing`; here is what would make a message untrue by itself. `sound` makes
values of what a driver tells, so that they can be noted; `Told` compares them with what was told before.
"""

from collections.abc import Sequence
from math import isfinite
from typing import Any

from engage_hri.schemas.behavior_types import TYPES, sync_points
from engage_hri.schemas.behaviors import BlockBehavior, Head, Speech
from engage_hri.schemas.references import type_name
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.contract.body import Arrived, MovementAuthority, Progress, Reached, Spoke
from engage_hri.services.control.serving.steps import Nonsense

SKEW: Seconds = 0.25
"""What a body tells may be this much older than its behavior, or this much ahead: a robot has a clock of its own."""


def sound(told: object) -> Progress | Nonsense:
    """Pass on what a driver tells: the same, with each field of its type, or why that cannot be."""
    try:
        match told:
            case Reached(sync=sync, at=at, arrived=arrived):
                return Reached(_name(sync), _time(sync, at), _time(sync, arrived))
            case Arrived(sync=sync, at=at):
                return Arrived(_name(sync), _time(sync, at))
            case Spoke(word=word, position=position, at=at):
                return Spoke(str(word), _position(position), _time("a word", at))
    except ValueError as error:
        return Nonsense(str(error))
    return Nonsense(f"a {type(told).__name__}, which is no progress")


def _name(sync: object) -> str:
    if not isinstance(sync, str):
        raise ValueError(f"{sync!r}, which is no name of a sync point")
    return sync


def _time(what: str, at: object) -> Seconds:
    if isinstance(at, bool) or not isinstance(at, int | float) or not isfinite(at):
        raise ValueError(f"{what!r} at {at!r}, which is no time of the loop")
    return float(at)


def _position(position: Any) -> int:
    try:
        return int(position)  # a driver's number, of whatever type
    except (TypeError, ValueError):
        raise ValueError(f"a word that ends at {position!r}, which is no number of characters") from None


class Told:
    """Points and words of a behavior that its body has told so far."""

    def __init__(self, behavior: BlockBehavior, authority: MovementAuthority, began: Seconds) -> None:
        """authority: as it is extended and revoked. began: loop time at which the behavior was begun."""
        self._points: Sequence[str] = sync_points(behavior)
        self._holds = self._points if isinstance(behavior, Speech) else TYPES[type_name(behavior)].holds
        self._length = len(behavior.text) if isinstance(behavior, Speech) else 0
        self._type = type_name(behavior)
        self._authority = authority
        self._began = began
        self._passed = -1
        """Number of the last point that it has passed."""
        self._said = 0
        self._strokes = behavior.repetition if isinstance(behavior, Head) else 1
        self._struck = 1
        """Strokes of a repeated movement that are over, once the first is."""

    def flaw(self, progress: Progress, now: Seconds) -> str:
        """Say what cannot be in what the body tells now; empty: nothing. now: loop time."""
        match progress:
            case Reached(sync=sync, at=at, arrived=arrived):
                untimely = self._untimely(sync, now, at, arrived)
                return untimely or (
                    self._strikes(sync)
                    if sync in self._later_strokes()
                    else self._unasked(sync) or self._passes(sync)
                )
            case Arrived(sync=sync, at=at):
                return self._untimely(sync, now, at) or self._unpassed(sync)
            case Spoke(position=position, at=at):
                return self._untimely("a word", now, at) or self._says(position)

    def missing(self) -> str:
        """Say what is missing now that the body has ended the behavior; empty: nothing."""
        if self._authority.revoked is not None or self._passed == len(self._points) - 1:
            return ""
        after = f"after {self._points[self._passed]!r}" if self._passed >= 0 else "before its start"
        return f"an end of this {self._type} {after}, and nobody has told it to end it there"

    def _untimely(self, what: str, now: Seconds, *times: Seconds) -> str:
        for at in times:
            if at > now + SKEW:
                return f"{what!r} {at - now:.3f} s before it is"
            if at < self._began - SKEW:
                return f"{what!r} {self._began - at:.3f} s before the behavior began"
        return f"{what!r} before it had come there" if len(times) > 1 and times[1] > times[0] + SKEW else ""

    def _later_strokes(self) -> list[str]:
        """Name the points of a repeated movement that a body may tell of, or not."""
        return [f"stroke:{number}" for number in range(2, self._strokes + 1)]

    def _strikes(self, sync: str) -> str:
        self._struck += 1
        if sync == f"stroke:{self._struck}" and self._passed == self._points.index("stroke"):
            return ""
        return f"{sync!r} where it does not follow the stroke before it"

    def _unpassed(self, sync: str) -> str:
        if sync not in self._points:
            return f"{sync!r}, and a {self._type} has the points {', '.join(self._points)}"
        if self._points.index(sync) <= self._passed:
            return f"{sync!r} after {self._points[self._passed]!r}"
        return ""

    def _unasked(self, sync: str) -> str:
        if wrong := self._unpassed(sync):
            return wrong
        allowed = self._points.index(self._authority.through)
        # Where it cannot hold it need not: it goes on to where it can.
        closed = [point for point in self._points[allowed + 1 : self._points.index(sync) + 1] if point in self._holds]
        return f"{sync!r}, and it may go no further than {self._authority.through!r}" if closed else ""

    def _passes(self, sync: str) -> str:
        before, self._passed = self._passed, self._points.index(sync)
        if self._passed != before + 1 and self._authority.revoked is None:
            return f"{sync!r} without {self._points[before + 1]!r} before it"
        return ""

    def _says(self, position: int) -> str:
        before, self._said = self._said, position
        if not before <= self._said <= self._length:
            return f"a word that ends at {self._said} of {self._length} characters after one that ended at {before}"
        return ""
