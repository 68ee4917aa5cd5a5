"""How patient the realizer is."""

from msgspec import Struct

from engage_hri.schemas.behaviors import EventKind
from engage_hri.schemas.ranges import not_negative
from engage_hri.schemas.units import Seconds


class RealizerConfig(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Limits, in seconds. Where a factor stands beside one, it is multiplied with the phase's natural duration.

    late, late_factor: a phase may take this much longer than natural before the realizer warns. Ours.
    stall, stall_factor: and this much before its behavior counts as failed. Motors of 1x-4x must pass. Ours.
    lead: how long before an instant a behavior is told to pass it that will come just then; more than braking takes.
    gap: the same of an utterance at a word gap: more than a message takes. The later, the more is known of others.
    skew: a sync point that misses its instant by more is reported as LATE. Below what people notice (0.1 s).
    estimate: how long the body may take to answer what it expects of a block.
    abort: how long the body may take to end what was aborted before the block ends without it.
    pulse: between two renewals of what the body, and recognition, are asked for. lease: how long movement authority
    lasts that is not renewed, so that a body stops by itself when the realizer is gone. At least three pulses.
    utterance: characters of one speech, some five minutes; a block with a longer one is refused.
    blocks: live blocks; one more is refused. The default is the most with which a command follows its sync point
        within 50 ms in 99 of 100 cases on two cores, if they begin at once, too (benchmarks/live_blocks.py).
    event_grace: an event ends as failed this much after its limit if recognition is not there to decide it.
    event_patience: and this much if it is there, but says nothing.
    most: behaviors, marks and sync references in a block; more is refused. Planning takes 0.1 ms each.
    *_limit: of an event that names no limit: recognition's own (its design page), the longer for a pair.
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
    lease: Seconds = 5.0
    utterance: int = 5000
    blocks: int = 300
    event_grace: Seconds = 0.5
    event_patience: Seconds = 10.0
    most: int = 2000
    directed_gaze_limit: Seconds = 2.5
    mutual_facial_gaze_limit: Seconds = 1.9
    adjacency_pair_limit: Seconds = 8.0
    backchannel_limit: Seconds = 0.8

    def __post_init__(self) -> None:
        not_negative(self, self.__struct_fields__)
        if self.stall < self.late or self.stall_factor < self.late_factor:
            raise ValueError("stall and stall_factor must not be below late and late_factor")
        if not 0.0 < 3.0 * self.pulse <= self.lease:
            raise ValueError(
                f"lease {self.lease} s must be at least three times pulse {self.pulse} s, which is above 0"
            )

    def limit_of(self, kind: EventKind) -> Seconds:
        return float(getattr(self, f"{kind}_limit"))
