"""Time limits and sizes of the realizer."""

from msgspec import Struct

from engage_hri.schemas.units import Seconds, not_negative

LATE: Seconds = 0.5
"""Time by which a phase may take longer than natural before the realizer warns. Ours."""
LEASE: Seconds = 4.0
"""Time for which movement authority lasts that is not renewed; then the body ends what it holds, and goes home. Three
renewals at least fit into it. Decision 0001."""


class RealizerConfig(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The section `realizer`. Raises ValueError for a limit that is negative or longer than movement authority."""

    stall: Seconds = 3.0
    """Time, and five times the natural duration besides, by which a phase may take longer than natural before its
    behavior counts as failed. Ours."""
    held_after: Seconds = 0.5
    """Time for which the body may go on without hearing of the realizer; then it holds, and goes on as soon as it
    does. It hears of it three times as often. 0: for as long as it has authority (4 s)."""
    blocks: int = 300
    """Number of live blocks; one more is refused. The default is the most with which a command follows its sync point
    within 50 ms in 99 of 100 cases on two cores, if they begin at once, too (benchmarks/live_blocks.py)."""
    longest_hold: Seconds = 60.0
    """What is held for longer is stopped, so that no arm stays in the air when whoever held it has gone."""

    def __post_init__(self) -> None:
        not_negative(self, self.__struct_fields__)
        if self.stall < LATE:
            raise ValueError(f"stall {self.stall} s must not be below {LATE} s, when a phase is late")
        if self.held_after >= LEASE:
            raise ValueError(f"held_after {self.held_after} s must be below {LEASE:g} s, when authority lapses")
