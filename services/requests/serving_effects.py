"""Effects of the serving side of long requests: what it wants published, or told to its service. Pure."""

from msgspec import Struct

from engage_hri.schemas.faults import Fault
from engage_hri.schemas.requests import Answer, Request
from engage_hri.schemas.units import Seconds


class PublishAnswer(Struct, frozen=True):
    """Publish this answer. again: it has been given before."""

    answer: Answer
    again: bool = False


class Hand(Struct, frozen=True):
    """Give this to the service: a request, new or changed, or a `Cancel`. Its `id` is its name at this server.

    is_asked: the message itself has just come; otherwise it was made here, as after a lease is over.
    """

    request: Request
    is_asked: bool


class HoldRequest(Struct, frozen=True, tag="hold_request"):
    """Tell the service to hold the request of this name, since nobody renews it, or to go on with it.

    until: when it ends unless it is renewed; None: it goes on. why: what has happened, and whose it was.
    """

    name: str
    until: Seconds | None
    why: Fault | None = None


class ServingFault(Struct, frozen=True):
    """Publish this fault for all to see. is_ours: it is a mistake of the service itself."""

    fault: Fault
    is_ours: bool


Effect = PublishAnswer | Hand | HoldRequest | ServingFault
