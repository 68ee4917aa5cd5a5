"""Time limits and sizes of the realizer."""

from msgspec import Struct

from engage_hri.schemas.ranges import not_negative
from engage_hri.schemas.units import Seconds


class RealizerConfig(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Limits, in seconds. Each factor is multiplied with the natural duration of a phase, and added to its limit.

    late, late_factor: a phase may take so much longer than natural before the realizer warns. Ours.
    stall, stall_factor: a phase may take so much longer than natural before its behavior counts as failed. Motors of
    1x-4x must pass. Ours.
    lead: how long before an instant a behavior that comes just in time is told to pass it; more than braking takes.
    gap: how long before a word gap an utterance is told to go on; more than a message takes. Later is better, since
    more is known of the others then.
    skew: a sync point that misses its instant by more is reported as LATE. Below what people notice (0.1 s).
    estimate: how long the body may take to answer what it expects of a block.
    abort: how long the body may take to end what was aborted before the block ends without it.
    pulse: time between two renewals of the requests to the body and to recognition.
    held_after: how long the body may go on without hearing of the realizer; then it holds, and goes on as soon as it
    does. It hears of it three times as often. 0: for as long as it has authority.
    lease: how long movement authority lasts that is not renewed; then the body ends what it holds, and goes home.
    Longer than that, and at least three pulses.
    blocks: number of live blocks; one more is refused. The default is the most with which a command follows its sync
        point within 50 ms in 99 of 100 cases on two cores, if they begin at once, too (benchmarks/live_blocks.py).
    longest_hold: what is held for longer is stopped, so that no arm stays in the air when whoever held it has gone.
    most: behaviors, marks and sync references in a block; more is refused. Planning takes 0.1 ms each.
    """

    late: Seconds = 0.5
    late_factor: float = 1.0
    stall: Seconds = 3.0
    stall_factor: float = 5.0
    lead: Seconds = 0.3
    gap: Seconds = 0.05
    skew: Seconds = 0.1
    estimate: Seconds = 2.0
    abort: Seconds = 5.0
    pulse: Seconds = 1.0
    held_after: Seconds = 0.5
    lease: Seconds = 4.0
    blocks: int = 300
    longest_hold: Seconds = 60.0
    most: int = 2000

    def __post_init__(self) -> None:
        not_negative(self, self.__struct_fields__)
        if self.stall < self.late or self.stall_factor < self.late_factor:
            raise ValueError("stall and stall_factor must not be below late and late_factor")
        if self.held_after >= self.lease:
            raise ValueError(f"held_after {self.held_after} s must be below lease {self.lease} s")
        if not 0.0 < 3.0 * self.pulse <= self.lease:
            raise ValueError(
                f"lease {self.lease} s must be at least three times pulse {self.pulse} s, which is above 0"
            )
