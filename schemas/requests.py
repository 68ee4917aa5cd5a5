"""How a long request lives: command with an id -> accepted or refused -> exactly one terminal state.

A request is idempotent by id and is sent again until it has ended; the server repeats its last state.
Sending a request again with other content *updates* it where its kind says so (`PerformBehavior.through`).
"""

from msgspec import Struct

from schemas.faults import Fault


class Request(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """What every command has: who asks, and the id by which everything about it is known.

    revision: how often its content was changed; a server ignores an older one. Counted by `Requester.send`.
    """

    id: str
    requester: str
    revision: int = 0


class Cancel(Request, frozen=True, kw_only=True, tag="cancel", omit_defaults=True):
    """End request `id` as interrupted. Published on the key of the request's server, as every command."""

    reason: str = ""


class Accepted(Struct, frozen=True, kw_only=True, tag="accepted", omit_defaults=True):
    id: str


class Refused(Struct, frozen=True, kw_only=True, tag="refused", omit_defaults=True):
    """Terminal: nothing of the request was or will be done."""

    id: str
    fault: Fault


class Unreadable(Struct, frozen=True, kw_only=True, tag="unreadable", omit_defaults=True):
    """local: bus -> server of the key. What came there as a command is none: made on arrival, never sent.

    id: of the request, as far as it could be read.
    """

    fault: Fault
    id: str = ""


class Outcome(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """The base of the other terminal states; each domain has its own."""

    id: str
