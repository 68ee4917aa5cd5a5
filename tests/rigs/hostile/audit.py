"""Audit of all requests on a bus: what was asked, what was answered, and what is wrong with that. Pure.

The audit sees each message once, as it is published, and judges servers by the protocol alone: every request that
has reached its server ends, and no request ends twice.
"""

from collections import Counter

from msgspec import Struct, field

from engage_hri.schemas import keys
from engage_hri.schemas.messages import Message, encode
from engage_hri.schemas.requests import Answer, Cancel, KeepAlive, Outcome, Refused, Request, is_life_of, kind_meant
from engage_hri.schemas.units import Seconds

PATIENCE: Seconds = 3.0
"""Seconds for which a requester may still mention a request that has ended: the messages may have crossed."""

REFUSED = b"refused"
"""Stands for every refusal among the ends of a request."""


class RequestName(Struct, frozen=True):
    """Names one request among all on the bus."""

    server: str
    requester: str
    life: str
    kind: str
    id: str


class Entry(Struct):
    """One request.

    is_owed: it has reached its server, which has not been restarted since. is_foreign: no service has sent it.
    sender: the life of the connection by which it reached its server first.
    """

    name: RequestName
    asked_at: Seconds
    role: str
    is_owed: bool
    is_foreign: bool
    sender: str
    is_cancelled: bool = False
    ends: list[bytes] = field(default_factory=list)
    """Different terminal answers of its server since that was last restarted."""
    ended_at: Seconds | None = None
    mentioned_at: Seconds = 0.0
    """Time at which it was last sent, renewed, or cancelled."""


class Audit:
    """All requests on a bus, with their answers."""

    def __init__(self) -> None:
        self.entries: dict[RequestName, Entry] = {}
        self.commands = 0
        self.answers = 0

    def hear(
        self, key: str, message: Message, sender: str, life: str, now: Seconds, *, arrives: bool, is_foreign: bool
    ) -> None:
        """Record a published message. arrives: its server is alive and gets it. is_foreign: not from a service."""
        match message:
            case Request() | KeepAlive() if key.startswith(f"{keys.PREFIX}/cmd/"):
                if is_life_of(message.life, life):  # another's life counts for nothing
                    self._ask(key, message, life, now, arrives, is_foreign)
            case Answer() if sender and key == keys.request_state(sender):
                self._answer(sender, message, now)

    def note_restart(self, server: str) -> None:
        """Note that `server` has a new life: it owes nothing from its former one, and may end old requests anew."""
        for entry in self.entries.values():
            if entry.name.server == server:
                entry.is_owed = False
                entry.ends.clear()

    def _ask(
        self, key: str, message: Request | KeepAlive, life: str, now: Seconds, arrives: bool, is_foreign: bool
    ) -> None:
        self.commands += 1
        sender, life = life, message.life or life
        server, requester = keys.server_of(key), keys.requester_of(key)
        if isinstance(message, KeepAlive):
            for kept in message.live:
                if entry := self.entries.get(RequestName(server, requester, life, kept.kind, kept.id)):
                    entry.mentioned_at = now
            return
        requester = requester or message.requester
        name = RequestName(server, requester, life, kind_meant(message), message.id)
        entry = self.entries.get(name)
        if entry is None and not isinstance(message, Cancel):
            role = key.split("/")[4] if keys.expression_of(key) else "manager"
            entry = self.entries[name] = Entry(name, now, role, arrives, is_foreign, sender)
        if entry is not None:
            entry.mentioned_at = now
            entry.sender = entry.sender if entry.is_owed else sender
            entry.is_owed = entry.is_owed or arrives
            entry.is_cancelled = entry.is_cancelled or isinstance(message, Cancel)

    def _answer(self, server: str, answer: Answer, now: Seconds) -> None:
        self.answers += 1
        name = RequestName(server, answer.requester, answer.life, answer.kind, answer.id)
        entry = self.entries.get(name)
        if entry is None or not isinstance(answer, Refused | Outcome):
            return
        # All refusals are one end, since nothing was done: a request sent on two wrong keys is refused in two ways.
        told = REFUSED if isinstance(answer, Refused) else encode(answer)  # type: ignore[arg-type]
        if told not in entry.ends:
            entry.ends.append(told)
        entry.ended_at = entry.ended_at if entry.ended_at is not None else now

    # -- verdicts -------------------------------------------------------------------------------------------------

    @property
    def open(self) -> list[Entry]:
        """Requests that have reached their server and have not ended."""
        return [entry for entry in self.entries.values() if entry.is_owed and entry.ended_at is None]

    @property
    def doubled(self) -> list[Entry]:
        """Requests that have ended in two ways.

        Requests without a life are left out, and ids given to several kinds of requests: there a second end may
        belong to a new request.
        """
        kinds = Counter((name.server, name.requester, name.life, name.id) for name in self.entries)
        return [
            entry
            for name, entry in self.entries.items()
            if len(entry.ends) > 1 and name.life and kinds[name.server, name.requester, name.life, name.id] == 1
        ]

    def lingering(self, since: Seconds) -> list[Entry]:
        """Requests of services that were still mentioned after `since`, more than `PATIENCE` after their end."""
        return [
            entry
            for entry in self.entries.values()
            if not entry.is_foreign
            and entry.mentioned_at >= since
            and entry.ended_at is not None
            and entry.mentioned_at > entry.ended_at + PATIENCE
        ]
