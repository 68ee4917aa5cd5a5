"""Faults (reason, place, advice) as a message, and the small hierarchy of exceptions that carry them."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Literal

from msgspec import Struct
from msgspec.structs import force_setattr, replace

Cause = Literal[
    "", "restarted", "gone", "unlinked", "frozen", "silent", "unrenewed", "forgotten", "late",
    "cancelled", "replaced", "closed",
]  # fmt: skip
CAUSES: Mapping[Cause, str] = {
    "restarted": "It has started again; its new process knows nothing of what was asked of the one before.",
    "gone": "It is not seen any more: it has ended or stands still, or its machine or the network between does.",
    "unlinked": "The service that reports this had no router, so that it could see nobody.",
    "frozen": "It reports this, and stood still itself, or its machine did, so that it heard nobody.",
    "silent": "It is seen, and has not answered.",
    "unrenewed": "It has not renewed in time what it had asked for.",
    "forgotten": "It does not know what it is asked about: it has started again since, or had to forget it.",
    "late": "It has not done in time what it was to do.",
    "cancelled": "It has asked that this ends.",
    "replaced": "It has asked for something else instead.",
    "closed": "It has left the bus, and had asked for this.",
}
"""What can have happened, as far as the service that reports it can know. `whose`: the participant that did it."""
ROUTER = "router"
"""Whose fault it is where the cause is `unlinked`."""
LONGEST_TEXT = 2500
"""Characters of each text in a fault. The rest is cut off: a fault has to fit into a message, in any form."""


class Fault(Struct, frozen=True, kw_only=True, tag="fault", omit_defaults=True):
    """A refusal or failure, as it crosses the bus and as people read it.

    reason: what is wrong. advice: what to do about it. service: the one that reports it.
    cause: what happened, one of `CAUSES`; empty: nothing did, the service itself could not, or would not, as the
    reason says. whose: the participant to which it happened, or that did it; `ROUTER`.
    """

    reason: str
    where: str = ""
    """`block-3: constraint-1`, a JSON path, or a file name."""
    line: int = 0
    """Line of the XML source, from 1; 0 when there is none."""
    advice: str = ""
    service: str = ""
    cause: Cause = ""
    whose: str = ""

    def __post_init__(self) -> None:
        """Make sure that a fault can always be sent: shorten texts, and write half characters with backslashes.

        Python itself makes such text, for example of file names that are not UTF-8. What is refused may be quoted in
        the reason, whatever its length.
        """
        for name in ("reason", "where", "advice", "service", "whose"):
            text = getattr(self, name)
            if isinstance(text, str) and not (text.isascii() and len(text) <= LONGEST_TEXT):
                text = text if len(text) <= LONGEST_TEXT else f"{text[: LONGEST_TEXT - 3]}..."
                force_setattr(self, name, text.encode("utf-8", "backslashreplace").decode())

    def at(self, where: str, line: int = 0) -> "Fault":
        """Make the same fault, told of something that it has ended.

        where: its place. line: the line of it; 0: this fault's line.
        """
        return replace(self, where=where, line=line or self.line)

    def following(self, reason: str, where: str) -> "Fault":
        """Make the fault of something that ended as something else did, of the same cause.

        reason: what has ended; this fault's reason is added to it. where: its place.
        """
        return replace(self, reason=f"{reason}: {self.reason}", where=where, line=0, advice="")

    def within(self, *names: str) -> str:
        """Write it without the beginning of its place that is told already.

        names: of a block and a behavior, one after the other.
        """
        left = self.where.split(": ")
        for name in names:
            if left and left[0] == name:
                del left[0]
        return str(replace(self, where=": ".join(left)))

    def __str__(self) -> str:
        place = ", ".join(part for part in (self.where, f"line {self.line}" if self.line else "") if part)
        text = f"{place}: {self.reason}" if place else self.reason
        return f"{text} ({self.advice})" if self.advice else text


class EngageError(Exception):
    """Base of all exceptions that Engage raises on purpose. `fault` is what the bus would carry."""

    def __init__(self, fault: Fault | str) -> None:
        self.fault = Fault(reason=fault) if isinstance(fault, str) else fault
        super().__init__(str(self.fault))


class InputRefused(EngageError):
    """The input is wrong. Nothing has moved; the fault has the place and an advice.

    block: id of the block or fragment; None if it could not be read.
    """

    def __init__(self, fault: Fault | str, block: str | None = None) -> None:
        super().__init__(fault)
        self.block = block


class NotReady(InputRefused):
    """Refusal of input that names what is not there yet, or not any more: the same input may be good later."""


class RunFailed(EngageError):
    """The input was good; performing it failed."""


class NoReply(EngageError):
    """A query went unanswered within its timeout: the server is dead, absent or denied."""


class RequestRefused(EngageError):
    """The server refused; nothing of the request was done."""


class OutcomeUnknown(RunFailed):
    """Failure of a request whose server is gone, or silent: nobody knows what was done of it."""


class ServerRestarted(OutcomeUnknown):
    """The server that had accepted the request has started again and knows nothing of it."""


class NeverEnded(OutcomeUnknown):
    """The server was asked to end the request, and has not."""


@contextmanager
def raised_as(
    kind: type[EngageError],
    errors: type[Exception] | tuple[type[Exception], ...],
    where: object = "",
    problem: str = "",
    advice: str = "",
) -> Iterator[None]:
    """Raise errors of the system or of a library, in the body of `with`, as one of ours.

    errors: their classes. problem: words before those of the error, as in `cannot write: No space left on device`.
    """
    try:
        yield
    except errors as error:
        said = getattr(error, "strerror", None) or str(error)
        reason = f"{problem}: {said}" if problem else said
        raise kind(Fault(reason=reason, where=str(where), advice=advice)) from error


def bug(error: BaseException, where: str, service: str) -> Fault:
    """Make the fault of an exception that nobody foresaw. where: what was being done. service: where it shows."""
    try:
        reason = error.fault.reason if isinstance(error, EngageError) else f"{type(error).__name__}: {error}"
    except Exception:  # the error's own __str__ raises
        reason = type(error).__name__
    return Fault(reason=reason, where=where, advice="this is a bug: the log has its traceback", service=service)
