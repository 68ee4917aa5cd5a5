"""The book of all requests on a bus: what was asked, what was answered, and what is wrong with that. Pure.

It sees each message once, as it is published, and judges servers by the protocol alone: every request that has
reached its server ends, and no request ends twice.
"""

from collections import Counter

from msgspec import Struct, field

from engage_hri.schemas import keys
from engage_hri.schemas.messages import Message, encode
from engage_hri.schemas.requests import Answer, Cancel, KeepAlive, Outcome, Refused, Request, kind_meant
from engage_hri.schemas.units import Seconds

PATIENCE: Seconds = 3.0
"""How long a requester may go on about what has ended: its last words may have been on their way."""

REFUSED = b"refused"
"""Stands for every refusal."""


class Name(Struct, frozen=True):
    """By what a request is known."""

    server: str
    requester: str
    life: str
    kind: str
    id: str


class Entry(Struct):
    """One request. is_owed: it has reached a server that still is the same. is_foreign: no service has sent it."""

    name: Name
    asked_at: Seconds
    role: str
    is_owed: bool
    is_foreign: bool
    is_cancelled: bool = False
    ends: list[bytes] = field(default_factory=list)
    """Each different terminal answer of its server, in this life of it."""
    ended_at: Seconds | None = None
    mentioned_at: Seconds = 0.0
    """When it last was sent again, renewed, or cancelled."""


class Book:
    """All of them."""

    def __init__(self) -> None:
        self.entries: dict[Name, Entry] = {}
        self.commands = 0
        self.answers = 0

    def hear(
        self, key: str, message: Message, sender: str, life: str, now: Seconds, *, arrives: bool, is_foreign: bool
    ) -> None:
        """A message that was published. arrives: a server that stands gets it. is_foreign: sent by no service."""
        match message:
            case Request() | KeepAlive() if key.startswith(f"{keys.PREFIX}/cmd/"):
                self._ask(key, message, message.life or life, now, arrives, is_foreign)
            case Answer() if sender and key == keys.request_state(sender):
                self._answer(sender, message, now)

    def restarted(self, server: str) -> None:
        """It owes nothing any more of what it was asked for in its former life, nor knows what has ended in it."""
        for entry in self.entries.values():
            if entry.name.server == server:
                entry.is_owed = False
                entry.ends.clear()

    def _ask(
        self, key: str, message: Request | KeepAlive, life: str, now: Seconds, arrives: bool, is_foreign: bool
    ) -> None:
        self.commands += 1
        server, requester = keys.server_of(key), keys.requester_of(key)
        if isinstance(message, KeepAlive):
            for kept in message.live:
                if entry := self.entries.get(Name(server, requester, life, kept.kind, kept.id)):
                    entry.mentioned_at = now
            return
        requester = requester or message.requester
        name = Name(server, requester, life, kind_meant(message), message.id)
        entry = self.entries.get(name)
        if entry is None and not isinstance(message, Cancel):
            role = key.split("/")[4] if keys.expression_of(key) else "manager"
            entry = self.entries[name] = Entry(name, now, role, arrives, is_foreign)
        if entry is not None:
            entry.mentioned_at = now
            entry.is_owed = entry.is_owed or arrives
            entry.is_cancelled = entry.is_cancelled or isinstance(message, Cancel)

    def _answer(self, server: str, answer: Answer, now: Seconds) -> None:
        self.answers += 1
        name = Name(server, answer.requester, answer.life, answer.kind, answer.id)
        entry = self.entries.get(name)
        if entry is None or not isinstance(answer, Refused | Outcome):
            return
        # Nothing was done, for whatever reason: sent on two wrong keys, it is refused in two ways.
        told = REFUSED if isinstance(answer, Refused) else encode(answer)  # type: ignore[arg-type]
        if told not in entry.ends:
            entry.ends.append(told)
        entry.ended_at = entry.ended_at if entry.ended_at is not None else now

    # -- verdicts -------------------------------------------------------------------------------------------------

    @property
    def open(self) -> list[Entry]:
        """What has reached its server and has not ended."""
        return [entry for entry in self.entries.values() if entry.is_owed and entry.ended_at is None]

    @property
    def doubled(self) -> list[Entry]:
        """What has ended in two ways.

        Nobody can tell for those who name no life, or give one id to several kinds of requests: it is new again.
        """
        kinds = Counter((name.server, name.requester, name.life, name.id) for name in self.entries)
        return [
            entry
            for name, entry in self.entries.items()
            if len(entry.ends) > 1 and name.life and kinds[name.server, name.requester, name.life, name.id] == 1
        ]

    def lingering(self, since: Seconds) -> list[Entry]:
        """What a requester that is a service still went on about after `since`, long after its end."""
        return [
            entry
            for entry in self.entries.values()
            if not entry.is_foreign
            and entry.mentioned_at >= since
            and entry.ended_at is not None
            and entry.mentioned_at > entry.ended_at + PATIENCE
        ]
