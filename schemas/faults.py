"""What went wrong, where, and what to do about it: one message and one small hierarchy of exceptions."""

from msgspec import Struct
from msgspec.structs import force_setattr


class Fault(Struct, frozen=True, kw_only=True, tag="fault", omit_defaults=True):
    """A refusal or failure, as it crosses the bus and as people read it.

    reason: what is wrong. advice: what to do about it. service: who says so.
    """

    reason: str
    where: str = ""
    """`block-3: constraint-1`, a JSON path, or a file name."""
    line: int = 0
    """Line of the XML source, from 1; 0 when there is none."""
    advice: str = ""
    service: str = ""

    def __post_init__(self) -> None:
        """What is no Unicode is written with backslashes: a fault must always get through.

        Python itself makes such text, of the names of files for instance.
        """
        for name in ("reason", "where", "advice", "service"):
            text = getattr(self, name)
            if isinstance(text, str) and not text.isascii():
                force_setattr(self, name, text.encode("utf-8", "backslashreplace").decode())

    def __str__(self) -> str:
        place = ", ".join(part for part in (self.where, f"line {self.line}" if self.line else "") if part)
        text = f"{place}: {self.reason}" if place else self.reason
        return f"{text} ({self.advice})" if self.advice else text


class EngageError(Exception):
    """Anything Engage raises on purpose. Carries the fault that the bus would carry."""

    def __init__(self, fault: Fault | str) -> None:
        self.fault = Fault(reason=fault) if isinstance(fault, str) else fault
        super().__init__(str(self.fault))


class InputRefused(EngageError):
    """The input is wrong. Nothing has moved; the fault says where and what to do.

    block: id of the block or fragment, as far as it could be read.
    """

    def __init__(self, fault: Fault | str, block: str | None = None) -> None:
        super().__init__(fault)
        self.block = block


class RunFailed(EngageError):
    """The input was good; performing it failed."""


class NoReply(EngageError):
    """A query went unanswered within its timeout: the server is dead, absent or denied."""


class RequestRefused(EngageError):
    """The server refused; nothing of the request was done."""


class ServerRestarted(RunFailed):
    """The server that had accepted the request is there as another life, which knows nothing of it."""


class NeverEnded(RunFailed):
    """The server has not ended the request, though it was asked to."""
