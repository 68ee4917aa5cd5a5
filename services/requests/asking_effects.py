"""Effects of the asking side of long requests: what it wants published, or told to the caller. Pure."""

from msgspec import Struct

from engage_hri.schemas.faults import EngageError, Fault
from engage_hri.schemas.requests import Accepted, Kept, Outcome, Request


class PublishCommand(Struct, frozen=True):
    """Publish this message. expression: the key expression of the command, as in `schemas/keys.py`."""

    expression: str
    message: Request


class Renew(Struct, frozen=True):
    """Send `server` a `KeepAlive` for these requests."""

    server: str
    live: tuple[Kept, ...]


class TellAccepted(Struct, frozen=True):
    """Tell the caller that the server has accepted the request."""

    id: str
    answer: Accepted


class TellEnd(Struct, frozen=True):
    """Tell the caller how the request has ended. There is exactly one for each request."""

    id: str
    end: Outcome | EngageError


class AskingFault(Struct, frozen=True):
    """Publish this fault for all to see."""

    fault: Fault


Effect = PublishCommand | Renew | TellAccepted | TellEnd | AskingFault
