"""Matrix of who sees whom, from the facts. Pure."""

from collections.abc import Iterator
from typing import Literal

from msgspec import Struct

from engage_hri.schemas import access, keys
from engage_hri.schemas.participants import ClockOffset, Status
from engage_hri.schemas.units import Seconds
from engage_hri.services.doctor.facts import SystemFacts

HERE = "here"
"""Name of the row of this process."""
Sees = Literal["itself", "yes", "no", "needless", "unknown"]
"""needless: it does not see it, and has no need to."""


class Cell(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """Tells whether `viewer` sees `other`. trip: the quickest round trip between their processes or machines."""

    viewer: str
    other: str
    sees: Sees
    trip: Seconds | None = None


def matrix(facts: SystemFacts) -> tuple[Cell, ...]:
    """Cells of the matrix, row by row: first this process, then all that answer for themselves."""
    return tuple(_cells(facts))


def _cells(facts: SystemFacts) -> Iterator[Cell]:
    for other in facts.known:
        yield Cell(viewer=HERE, other=other.name, sees="yes" if other.seen else "no", trip=other.trip)
    for viewer in facts.known:
        if not viewer.answers:
            continue
        for other in facts.known:
            sees: Sees
            trip = None
            if viewer.name == other.name:
                sees = "itself"
            elif viewer.status is None:
                sees = "unknown"
            else:
                hidden: Sees = "no" if _needs(viewer.name, other.part) else "needless"
                sees = "yes" if other.name in viewer.status.bus.peers else hidden
                if sees == "yes" and (clock := clock_of(viewer.status, other.status)) is not None:
                    trip = clock.trip
            yield Cell(viewer=viewer.name, other=other.name, sees=sees, trip=trip)


def _needs(viewer: str, part: keys.Part) -> bool:
    """True if one has to see participants of this part: everybody sees the robot, and services see their clients."""
    heard = access.rows(access.role_of(viewer), "subscribes")
    return part == "robot" or keys.alive("*", part) in heard


def clock_of(viewer: Status, other: Status | None) -> ClockOffset | None:
    """Measurement that one has of the other's clock; None: it has the same clock, or has not measured it."""
    if other is None:
        return None
    return next((each for each in viewer.bus.clocks if each.clock == other.at.clock), None)
