"""Table 2.1 of the thesis: nine minutes of two people making canapés, as numbers to draw from and to compare with."""

from collections.abc import Mapping

from msgspec import Struct

from engage_hri.schemas.behaviors import EventKind
from engage_hri.schemas.units import Seconds
from engage_hri.services.simulation.chance import Delays


class Row(Struct, frozen=True, kw_only=True):
    """One kind of connection event. delays: of successes; failed_delays: from start to failure.

    Backchannels have neither: they have no delay and cannot fail.
    """

    succeeded: int
    failed: int = 0
    delays: Delays = Delays(0.0, 0.0, 0.0)
    failed_delays: Delays = Delays(0.0, 0.0, 0.0)

    @property
    def count(self) -> int:
        return self.succeeded + self.failed

    @property
    def success(self) -> float:
        """Share of the events that succeed."""
        return self.succeeded / self.count


TABLE: Mapping[EventKind, Row] = {
    "directed_gaze": Row(
        succeeded=13, delays=Delays(0.0, 0.3, 2.0), failed=1, failed_delays=Delays(1.5, 1.5, 1.5)
    ),
    "mutual_facial_gaze": Row(
        succeeded=11, delays=Delays(0.0, 0.7, 1.5), failed=13, failed_delays=Delays(0.3, 0.6, 1.8)
    ),
    "adjacency_pair": Row(
        succeeded=30, delays=Delays(0.0, 0.4, 1.1), failed=14, failed_delays=Delays(0.1, 1.2, 7.4)
    ),
    "backchannel": Row(succeeded=15),
}  # fmt: skip
EVENTS = sum(row.count for row in TABLE.values())
MTBCE: Seconds = 5.7
"""Mean time between the starts of successive connection events."""
LONGEST_GAP: Seconds = 70.0
