"""Results of a client's requests: the outcome or answer that a caller gets, or the error that is raised."""

from typing import TypeVar

from msgspec import Struct

from engage_hri.schemas.blocks import BlockOutcome
from engage_hri.schemas.faults import Fault, NoReply, RunFailed
from engage_hri.schemas.fragments import FragmentOutcome
from engage_hri.schemas.units import Seconds


class PerformFailed(RunFailed):
    """A fragment or block failed while it ran, or what performed it has gone, so that its end is unknown.

    `outcome` tells what was done of it, as far as is known, and its `status` which of the two; `fault` tells why.
    """

    def __init__(self, fault: Fault, outcome: FragmentOutcome | BlockOutcome) -> None:
        super().__init__(fault)
        self.outcome = outcome


O = TypeVar("O", FragmentOutcome, BlockOutcome)  # noqa: E741


def successful(outcome: O, subject: str) -> O:
    """Return the outcome, or raise PerformFailed if it says so. subject: id of the fragment or block."""
    if outcome.status in ("failed", "unknown"):
        raise PerformFailed(outcome.fault or Fault(reason="it failed", where=subject), outcome)
    return outcome


S = TypeVar("S", bound=Struct)


def in_time(message: S | None, what: str, timeout: Seconds | None) -> S:
    """Return the message, or raise NoReply if none has come in time. what: its name, for the reader."""
    if message is None:
        within = " any more: the connection is over" if timeout is None else f" within {timeout} s"
        raise NoReply(Fault(reason=f"no {what}{within}", advice="is its service running?"))
    return message
