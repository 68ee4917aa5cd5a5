"""Holds on what the robot performs, as they are told: see `SteerPerformance`."""

from msgspec import Struct

from engage_hri.schemas.faults import Fault
from engage_hri.schemas.units import Stamp


class Hold(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A hold that is in force.

    block: id of a live block; empty: all that the robot performs, and what comes. behavior: of that block; empty: all
    of it. since: when it began. until: when what it holds is stopped, unless somebody lets it go on before. why: what
    has happened, and whose it was; None: somebody has asked for it.
    """

    since: Stamp
    until: Stamp
    block: str = ""
    behavior: str = ""
    why: Fault | None = None

    def holds(self, other: "Hold") -> bool:
        """True if what the other holds is the same as what this one holds, or a part of it."""
        return not self.block or (self.block == other.block and self.behavior in ("", other.behavior))


class Held(Struct, frozen=True, kw_only=True, tag="held", omit_defaults=True):
    """state: realizer. All holds that are in force, the oldest first; none: nothing is held.

    Published at every change; a late subscriber gets the last one. Of a hold that is not among them any more, what it
    held goes on, or has ended.

    at: when it was published.
    """

    at: Stamp
    holds: tuple[Hold, ...] = ()


class BodyHeld(Struct, frozen=True, kw_only=True, tag="body_held", omit_defaults=True):
    """state: control. All behaviors that wait because whoever asked for them is not heard (`held_after`), the oldest
    first; none: nothing waits for that.

    Published at every change; a late subscriber gets the last one. Of a behavior that is not among them any more, its
    requester was heard again, or it has ended; `until` is when it ends otherwise.

    at: when it was published.
    """

    at: Stamp
    holds: tuple[Hold, ...] = ()

    @property
    def reasons(self) -> list[str]:
        """Reasons of these holds in words, each once."""
        return sorted({each.why.reason for each in self.holds if each.why is not None})
