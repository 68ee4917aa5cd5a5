"""Records of requests at their server: what is known of each, and what a command that comes means for it. Pure."""

from math import inf

from msgspec.structs import replace

from engage_hri.schemas.faults import Fault
from engage_hri.schemas.messages import decode, encode
from engage_hri.schemas.requests import Answer, Cancel, KeepAlive, Request, kind_meant
from engage_hri.schemas.units import Seconds
from engage_hri.services.requests.serving_table import ServingEvent, ServingState

ANEW = "if it is to be done again, send it under a new id"
"""Advice about a request of which nobody knows, or remembers, what became of it."""
LONGEST = 1000
"""Letters of an id, and of a life: answers name them, and answers are kept."""

Key = tuple[str, str, str]
"""Requester, life and id. Only one request of a key is live at a time."""


class Record:
    """One request. sender: the process that it came from. run: the requester's life by its token.

    kind: of the request, or of what a cancellation ends. is_held: the service was told to hold it.
    """

    __slots__ = (
        "_answer", "_request", "ended_at", "is_held", "key", "kind", "lease", "name", "renewed_at", "run", "sender",
        "size", "state",
    )  # fmt: skip

    def __init__(self, name: str, request: Request, sender: str, run: str) -> None:
        self.name = name
        self._request: Request | bytes = request
        self._answer: Answer | bytes | None = None
        self.sender = sender
        self.run = run
        self.key = key_of(request)
        self.kind = kind_meant(request)
        self.lease = (ServingEvent.LEASE_OVER, name)
        """Name of its lease among the deadlines."""
        self.state = ServingState.UNKNOWN
        self.is_held = False
        self.renewed_at: Seconds = -inf
        self.ended_at: Seconds = inf
        self.size = 0
        """Bytes of request and answer, once they are packed."""

    @property
    def request(self) -> Request:
        return decode(self._request) if isinstance(self._request, bytes) else self._request  # type: ignore[return-value]

    @request.setter
    def request(self, request: Request) -> None:
        self._request = request

    @property
    def answer(self) -> Answer | None:
        return decode(self._answer) if isinstance(self._answer, bytes) else self._answer  # type: ignore[return-value]

    @answer.setter
    def answer(self, answer: Answer) -> None:
        self._answer = answer

    def pack(self) -> int:
        """Keep request and answer as their bytes from now on: as objects they take twice as much, and more.

        Returns the number of these bytes.
        """
        self._request = encode(self.request)  # type: ignore[arg-type]
        self._answer = None if self._answer is None else encode(self.answer)  # type: ignore[arg-type]
        self.size = len(self._request) + len(self._answer or b"")
        return self.size


def key_of(request: Request) -> Key:
    return (request.requester, request.life, request.id)


def event_of(record: Record, request: Request) -> ServingEvent:
    """The event that this command is for the request of `record`."""
    if isinstance(request, Cancel):
        return ServingEvent.CANCEL
    known = record.request
    if record.state is ServingState.UNKNOWN or isinstance(known, Cancel) or request == known:
        return ServingEvent.CAME
    if not request.is_updatable:
        return ServingEvent.CAME if content_of(request) == content_of(known) else ServingEvent.DIFFERED
    return ServingEvent.CAME if request.revision < known.revision else ServingEvent.CHANGED


def content_of(request: Request) -> Request:
    """The request without the fields that are no content."""
    return replace(request, revision=0, lease=0.0)


def unwieldy(command: Request | KeepAlive, server: str) -> Fault | None:
    """A fault if an id or the life in a command is too long to be answered; None otherwise."""
    ids = [each.id for each in command.live] if isinstance(command, KeepAlive) else [command.id]
    most = max(map(len, (command.life, *ids)))
    if most <= LONGEST:
        return None
    reason = f"an id of {most} letters; at most {LONGEST} are read"
    return Fault(reason=reason, where=type(command).__name__, service=server)
