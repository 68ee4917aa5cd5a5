"""Results of a client's requests: the outcome or answer that a caller gets, or the error that is raised."""

from typing import TypeVar

from msgspec import Struct

from engage_hri.schemas.blocks import BlockOutcome
from engage_hri.schemas.faults import Fault, NoReply, RunFailed
from engage_hri.schemas.fragments import FragmentOutcome
from engage_hri.schemas.units import Seconds


class PerformFailed(RunFailed):
    """A fragment or block failed while it ran. `outcome` tells what was done of it, `fault` why it failed."""

    def __init__(self, fault: Fault, outcome: FragmentOutcome | BlockOutcome) -> None:
        super().__init__(fault)
        self.outcome = outcome


O = TypeVar("O", FragmentOutcome, BlockOutcome)  # noqa: E741


def successful(outcome: O, subject: str) -> O:
    """Return the outcome, or raise PerformFailed if it says so. subject: id of the fragment or block."""
    if outcome.status == "failed":
        raise PerformFailed(outcome.fault or Fault(reason="it failed", where=subject), outcome)
    return outcome


S = TypeVar("S", bound=Struct)


def in_time(message: S | None, what: str, timeout: Seconds | None) -> S:
    """Return the message, or raise NoReply if none has come in time. what: its name, for the reader."""
    if message is None:
        within = " any more: the connection is over" if timeout is None else f" within {timeout} s"
        raise NoReply(Fault(reason=f"no {what}{within}", advice="is its service running?"))
    return message
