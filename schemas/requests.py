"""Requests and their answers: a command with an id is accepted or refused, and has exactly one terminal state.

A request is known by its requester, the requester's life, its kind and its id; an answer names all four. A request is
sent again until it is accepted, refused or ended; the server repeats its last answer. `KeepAlive` keeps accepted
requests alive. The states with their transitions are the tables in services/requests/asking_table.py and
services/requests/serving_table.py.
"""

from typing import ClassVar, Self, TypeVar

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.faults import Cause, Fault
from engage_hri.schemas.units import Seconds, Stamp


class Request(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """Fields that every command has.

    id: made by the requester; unique among its live requests of all kinds.
    requester: on arrival the participant that the key names; what the sender writes here is ignored.
    life: the life of the requester, so that a restarted one does not get the answers meant for the one before. A
    program without lives leaves it out; its ended requests are remembered for 10 s, then an id is new again. One
    that begins with `@` is made by `life_of`, and counts only from the process that it names.
    revision: number of changes of the content; the server ignores older content.
    lease: seconds that the request stays alive at its server without being sent again or named by a `KeepAlive`;
    0: until it ends, which control replaces by its `dead_man`.
    """

    is_updatable: ClassVar[bool] = False
    """True if other content under the same id may replace it while it is live."""

    id: str
    requester: str = ""
    life: str = ""
    revision: int = 0
    lease: Seconds = 0.0

    @property
    def term(self) -> Seconds:
        """Seconds without renewal after which the request lapses; 0: not given."""
        return self.lease

    @property
    def unheard(self) -> Seconds:
        """Seconds without renewal after which the server holds what it does, until it is renewed; 0: never."""
        return 0.0

    @property
    def authority(self) -> str:
        """Limit up to which the request may be carried out without asking; empty: no limit."""
        return ""

    def with_authority(self, authority: str) -> Self:
        """Extend the authority of the request."""
        return self


ORPHANING: frozenset[Cause] = frozenset(("restarted", "gone", "unlinked", "unrenewed", "closed"))
"""Causes of a `Cancel` that nobody wants: there is nobody any more who asked."""


class Cancel(Request, frozen=True, kw_only=True, tag="cancel", omit_defaults=True):
    """cmd: end one's own request `id`, as interrupted. It counts only from the process that has asked.

    of: the kind of that request, its `type`; empty: any kind.
    reason, cause, whose: why, as a `Fault` says it; the outcome repeats them. Without a cause it is `cancelled`, by
    the requester.
    """

    of: str = ""
    reason: str = ""
    cause: Cause = ""
    whose: str = ""

    def fault(self, where: str) -> Fault:
        """Make the fault by which the outcome of the request says why it ended."""
        cause, whose = (self.cause, self.whose) if self.cause else ("cancelled", self.requester)
        return Fault(reason=self.reason or "cancelled", where=where, cause=cause, whose=whose)


class Kept(Struct, frozen=True, array_like=True):
    """Entry of a `KeepAlive`: a request that stays alive for another `valid` seconds.

    kind: its `type`. revision, authority: those of its newest content.
    """

    kind: str
    id: str
    revision: int
    authority: str
    valid: Seconds


class KeepAlive(Struct, frozen=True, kw_only=True, tag="keep_alive", omit_defaults=True):
    """cmd: requester -> server: these requests are still wanted, each for `valid` seconds from `at`.

    A server refuses a request that it does not know; if it has older content, it grants the authority and answers
    with `Outdated`.
    """

    live: tuple[Kept, ...]
    at: Stamp
    requester: str = ""
    """Requester and life as in `Request`."""
    life: str = ""


class Answer(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """Fields that every answer has: they name the request that is answered.

    id: of the request. requester, life: copied from it. kind: its `type`.
    """

    id: str
    requester: str = ""
    life: str = ""
    kind: str = ""


class Heard(Answer, frozen=True, kw_only=True, tag="heard", omit_defaults=True):
    """The request has come more than once, or has begun, and is not decided yet: no other life begins it again."""


class Accepted(Answer, frozen=True, kw_only=True, tag="accepted", omit_defaults=True):
    """The request is being carried out, or will be.

    within: of an event, the longest time from the robot's last deed (a sync point of its blocks, or a word of its
    speech) to the outcome. Only recognition knows it. None: nothing is promised.
    """

    within: Seconds | None = None


class Outdated(Answer, frozen=True, kw_only=True, tag="outdated", omit_defaults=True):
    """The server has older content than a `KeepAlive` names. The requester then sends the newest."""


class Refused(Answer, frozen=True, kw_only=True, tag="refused", omit_defaults=True):
    """Terminal: nothing of the request was or will be done."""

    fault: Fault


class Unreadable(Struct, frozen=True, kw_only=True, tag="unreadable", omit_defaults=True):
    """local: bus -> server of the key: a payload that came as a command could not be read. Never travels.

    id, life, kind: those of the request, as far as they could be read. block: the id of the block or fragment in it.
    """

    fault: Fault
    block: str = ""
    id: str = ""
    life: str = ""
    kind: str = ""


class Outcome(Answer, frozen=True, kw_only=True, omit_defaults=True):
    """Base of the other terminal states; each kind of command has its own."""


A = TypeVar("A", bound=Answer)


def kind_of(request: Request) -> str:
    """Kind of a request: the `type` of its encoded form."""
    return str(request.__struct_config__.tag)


def life_of(run: str, number: int) -> str:
    """Id of one requester's life. number: of the requester, in this run of a participant."""
    return f"@{run[:16]}.{number}"


def is_life_of(life: str, run: str) -> bool:
    """Tell whether a life can belong to a run. False only for a life made by `life_of` in another run."""
    return not life.startswith("@") or life[1:].rpartition(".")[0] == run[:16]


def are_of_one_run(life: str, other: str) -> bool:
    """Tell whether two lives of a requester can belong to one run. False only for two made by `life_of`."""
    return not other.startswith("@") or is_life_of(life, other[1:].rpartition(".")[0])


def kind_meant(request: Request) -> str:
    """Kind of the request that is meant: of a cancellation that of the request to be ended, empty if not given."""
    return request.of if isinstance(request, Cancel) else kind_of(request)


def answering(request: Request, answer: A) -> A:
    """Address an answer to the sender of `request`. The answer to a `Cancel` is about the request to be ended."""
    id, kind = request.id, kind_meant(request)
    return replace(answer, id=id, requester=request.requester, life=request.life, kind=kind)
