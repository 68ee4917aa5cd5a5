"""How a long request lives: command with an id -> accepted or refused -> exactly one terminal state.

A request is known by its requester, the requester's life, its kind and its id; an answer names all four. It is sent
again until it is accepted, refused or ended; the server repeats its last state. What is accepted is kept alive by
`KeepAlive`. The states and what moves them are the tables in services/requests/asking_table.py and
services/requests/serving_table.py.
"""

from typing import ClassVar, Self, TypeVar

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.faults import Fault
from engage_hri.schemas.units import Seconds, Stamp


class Request(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """What every command has.

    id: made up by the requester; among its live requests no other has it, of whatever kind.
    requester: on arrival the participant that the key names, whatever stands here.
    life: which life of the requester asks, so that a restarted one does not get the answers to the one before. A
    program that has none may leave it out; its ended requests are remembered for 10 s, then an id is new again.
    revision: how often the content was changed; the server ignores an older one.
    lease: seconds that the request stays alive at its server without being sent again or named by a `KeepAlive`.
    0: until it ends; control does not allow that, and takes its `dead_man`.
    """

    is_updatable: ClassVar[bool] = False
    """May other content under the same id replace it while it is live?"""

    id: str
    requester: str = ""
    life: str = ""
    revision: int = 0
    lease: Seconds = 0.0

    @property
    def term(self) -> Seconds:
        """Seconds without renewal after which it lapses; 0: it does not say."""
        return self.lease

    @property
    def authority(self) -> str:
        """How far it may be carried out without asking; empty: it has no such limit."""
        return ""

    def with_authority(self, authority: str) -> Self:
        """The same with more authority."""
        return self


class Cancel(Request, frozen=True, kw_only=True, tag="cancel", omit_defaults=True):
    """End the requester's own request `id` as interrupted.

    of: the kind of that request, its `type`; empty: whichever it is.
    """

    of: str = ""
    reason: str = ""


class Kept(Struct, frozen=True, array_like=True):
    """A request that is to stay alive for another `valid` seconds. revision, authority: of its newest content."""

    kind: str
    id: str
    revision: int
    authority: str
    valid: Seconds


class KeepAlive(Struct, frozen=True, kw_only=True, tag="keep_alive", omit_defaults=True):
    """cmd: requester -> server: these requests are still wanted, each for `valid` seconds from `at`.

    A server that does not know one of them refuses it; one that has older content grants the authority, and answers
    with `Outdated`.
    """

    live: tuple[Kept, ...]
    at: Stamp
    requester: str = ""
    """As in `Request`."""
    life: str = ""


class Answer(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """What every answer has: whose request it is about.

    id: of the request. requester, life: copied from it. kind: its `type`.
    """

    id: str
    requester: str = ""
    life: str = ""
    kind: str = ""


class Heard(Answer, frozen=True, kw_only=True, tag="heard", omit_defaults=True):
    """The request has come more than once, and is not decided yet."""


class Accepted(Answer, frozen=True, kw_only=True, tag="accepted", omit_defaults=True):
    """It is being carried out, or will be."""


class Outdated(Answer, frozen=True, kw_only=True, tag="outdated", omit_defaults=True):
    """To a `KeepAlive`: the content that the server has is older than it says. The requester sends the newest."""


class Refused(Answer, frozen=True, kw_only=True, tag="refused", omit_defaults=True):
    """Terminal: nothing of the request was or will be done."""

    fault: Fault


class Unreadable(Struct, frozen=True, kw_only=True, tag="unreadable", omit_defaults=True):
    """local: bus -> server of the key. What came there as a command is none: made on arrival, never sent.

    id, life, kind: of the request, as far as they could be read.
    """

    fault: Fault
    id: str = ""
    life: str = ""
    kind: str = ""


class Outcome(Answer, frozen=True, kw_only=True, omit_defaults=True):
    """The base of the other terminal states; each domain has its own."""


A = TypeVar("A", bound=Answer)


def kind_of(request: Request) -> str:
    """The `type` of its encoded form."""
    return str(request.__struct_config__.tag)


def life_of(run: str, number: int) -> str:
    """The life of one requester, of any number in this run of a participant."""
    return f"{run[:16]}.{number}"


def is_life_of(life: str, run: str) -> bool:
    """May it be one of that run? False only if it is of this form, and another run's."""
    before, _, number = life.rpartition(".")
    return not (before and number.isdecimal()) or before == run[:16]


def kind_meant(request: Request) -> str:
    """Of a cancellation the kind of what it ends; empty if it does not say."""
    return request.of if isinstance(request, Cancel) else kind_of(request)


def answering(request: Request, answer: A) -> A:
    """`answer`, addressed to whoever has sent `request`. To a `Cancel` it is about the request that it ends."""
    id, kind = request.id, kind_meant(request)
    return replace(answer, id=id, requester=request.requester, life=request.life, kind=kind)
