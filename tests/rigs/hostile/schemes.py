"""Requests at bad moments, from peers that know the protocol and break its rules. Pure, from chance."""

from collections import deque
from collections.abc import Callable, Sequence
from typing import Literal, cast

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.blocks import (
    BlockOutcome,
    InterruptBehavior,
    PerformBlock,
    Steer,
    SteerPerformance,
    SteerRobot,
)
from engage_hri.schemas.body import AbortBehavior, BehaviorOutcome, GoHome, PerformBehavior
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.fragments import FragmentOutcome, Inhibit, PerformFragment
from engage_hri.schemas.messages import COMMANDS, Message
from engage_hri.schemas.requests import (
    Accepted,
    Cancel,
    Heard,
    KeepAlive,
    Kept,
    Outdated,
    Refused,
    Request,
    kind_of,
)
from engage_hri.schemas.units import Seconds, Stamp
from tests.rigs.hostile import plausible
from tests.rigs.hostile.chance import Chance, happens
from tests.rigs.hostile.typed import NASTY_FLOATS, NASTY_INTS, RandomMessages, Words

IDS = ("1", "2", "3", "same", "1~2")
"""Request ids that all peers share."""
REMEMBERED = 32
WISHES: tuple[Steer, ...] = ("hold", "continue", "stop")


class Move(Struct, frozen=True):
    """Peer number `peer` publishes `message` after `delay` seconds; None: it leaves, and comes back as another life.

    expression: the key; for a command the key expression of all requesters.
    """

    peer: int
    message: Message | None = None
    expression: str = ""
    delay: Seconds = 0.0


class _Sent(Struct, frozen=True):
    peer: int
    expression: str
    request: Request


class Schemer:
    """Draws what a peer does next. peers: number of peers that take part."""

    def __init__(
        self, chance: Chance, messages: RandomMessages, words: Words, entities: tuple[str, ...], peers: int
    ) -> None:
        self._chance = chance
        self._messages = messages
        self._words = words
        self._entities = entities
        self._peers = peers
        self._sent: deque[_Sent] = deque(maxlen=REMEMBERED)
        self._lives = [""] * peers

    def next(self, now: Seconds) -> Move:
        peer = self._chance.randrange(0, self._peers)
        move = self._chance.choice(MOVES)(self, peer, now)
        late = self._chance.choice((0.0, 0.0, 0.0, self._chance.uniform(0.0, 3.0)))
        return replace(move, delay=late)

    # -- moves ----------------------------------------------------------------------------------------------------

    def _ask(self, peer: int, now: Seconds) -> Move:
        expression = self._chance.choice(tuple(COMMANDS))
        kind = self._chance.choice(COMMANDS[expression])
        lease = self._chance.choice((0.0, 0.0, 1.0, 5.0, *NASTY_FLOATS[:3]))
        request = self._request(kind, now)
        request = replace(request, id=self._id(), life=self._lives[peer], requester="", revision=0, lease=lease)
        self._sent.append(_Sent(peer, expression, request))
        return Move(peer, cast(Message, request), expression)

    def _repeat(self, peer: int, now: Seconds) -> Move:
        """Send a request again: perhaps as another peer, on another key, with another revision, or in a new life."""
        if not self._sent:
            return self._ask(peer, now)
        sent = self._chance.choice(self._sent)
        request = sent.request
        if happens(self._chance, 0.4):
            request = replace(request, revision=self._chance.choice((*NASTY_INTS, 1, 2, 3)))
        if happens(self._chance, 0.3):
            other = self._request(type(request), now)
            request = replace(other, id=request.id, life=request.life, requester="", revision=request.revision)
        expression = sent.expression if happens(self._chance, 0.9) else self._chance.choice(tuple(COMMANDS))
        return Move(sent.peer if happens(self._chance, 0.8) else peer, cast(Message, request), expression)

    def _cancel(self, peer: int, now: Seconds) -> Move:
        """Cancel a request of any peer, or one that was never made."""
        if self._sent and happens(self._chance, 0.7):
            sent = self._chance.choice(self._sent)
            server, id, kind = keys.server_of(sent.expression), sent.request.id, kind_of(sent.request)
            life, peer = sent.request.life, sent.peer
        else:
            server, id = self._chance.choice(keys.SERVICES), self._id()
            kind, life = "perform_block", self._lives[peer]
        of = self._chance.choice((kind, kind, kind, "", "inhibit", "nothing"))
        return Move(peer, Cancel(id=id, life=life, of=of, reason="why not"), keys.cancel(server))

    def _keep_alive(self, peer: int, now: Seconds) -> Move:
        """Renew requests, some with a kind, revision or authority that does not exist."""
        requests = [each.request for each in self._sent if happens(self._chance, 0.5)][:4]
        kept = [
            Kept(kind_of(request), request.id, request.revision, request.authority, 5.0)
            if happens(self._chance, 0.5)
            else Kept(
                self._chance.choice((kind_of(request), "perform_behavior", "nothing")),
                self._chance.choice((request.id, self._id())),
                self._chance.choice(NASTY_INTS),
                self._chance.choice(("", "end", "stroke", "nothing")),
                self._chance.choice(NASTY_FLOATS),
            )
            for request in requests
        ]
        clock = self._chance.choice(("loop", "loop", "sundial"))
        at = Stamp(clock, now + self._chance.choice((0.0, -5.0, 1e9, 1e308)))
        life = self._chance.choice((self._lives[peer], *[request.life for request in requests]))
        server = self._chance.choice(keys.SERVICES)
        return Move(peer, KeepAlive(live=tuple(kept), at=at, life=life), keys.keep_alive(server))

    def _answer(self, peer: int, now: Seconds) -> Move:
        """Answer requests in the name of a server."""
        at = Stamp("loop", now)
        fault = Fault(reason="because I say so")
        id, block = self._word("id"), self._word("block")
        status: Literal["done", "failed"] = "done" if happens(self._chance, 0.5) else "failed"
        answer = self._chance.choice((
            Accepted(id=id), Heard(id=id), Outdated(id=id), Refused(id=id, fault=fault),
            BlockOutcome(id=id, block=block, status=status), FragmentOutcome(id=id, fragment=block, status=status),
            BehaviorOutcome(id=id, block=block, behavior=self._word("behavior"), status="done", at=at),
        ))  # fmt: skip
        answer = replace(
            answer,
            requester=self._word("requester"),
            life=self._word("life"),
            kind=self._chance.choice(("perform_block", "perform_behavior", "perform_fragment", "request_event", "")),
        )
        return Move(peer, cast(Message, answer), keys.request_state(self._chance.choice((*keys.SERVICES, "nobody"))))

    def _new_life(self, peer: int, now: Seconds) -> Move:
        self._lives[peer] = self._chance.choice(("", "life-1", f"life-{now:.3f}"))
        return Move(peer)

    # -- what is asked for ----------------------------------------------------------------------------------------

    def _id(self) -> str:
        return self._chance.choice(IDS) if happens(self._chance, 0.7) else self._word("id")

    def _word(self, field: str) -> str:
        return self._chance.choice((*self._words.of(field), "1"))

    def _request(self, kind: type[Request], now: Seconds) -> Request:
        chance, name = self._chance, f"x{self._chance.randrange(0, 6)}"
        if kind is PerformBlock:
            return PerformBlock(id="", block=plausible.block(chance, name, self._entities))
        if kind is PerformFragment:
            return PerformFragment(id="", fragment=plausible.fragment(chance, name, self._entities))
        if kind is InterruptBehavior:
            return InterruptBehavior(id="", block=self._word("block"), behavior=chance.choice(("b1", "b2", "b9")))
        if kind is SteerPerformance:
            block, named = chance.choice(("", self._word("block"))), chance.choice(("", "", "b1"))
            return SteerPerformance(id="", to=chance.choice(WISHES), block=block, behavior=named)
        if kind is SteerRobot:
            return SteerRobot(id="", to=chance.choice(WISHES))
        if kind is PerformBehavior:
            behavior = plausible.block(chance, name, self._entities).behaviors[0]
            through = chance.choice(("start", "end", "relax"))
            return PerformBehavior(id="", block=name, behavior=behavior, through=through)
        if kind is AbortBehavior:
            return AbortBehavior(id="", block=self._word("block"), behavior=self._word("behavior"))
        if kind is GoHome:
            return GoHome(id="", parts=chance.choice(((), ("head",), ("voice", "nothing"))))
        if kind is Inhibit:
            target = chance.choice(("", *self._entities))
            return Inhibit(id="", mode=chance.choice(("release", "hold", "target")), target=target, ttl=2.0)
        made = self._messages.message(now, kind.__name__)
        assert isinstance(made, Request)
        return made


MOVES: Sequence[Callable[[Schemer, int, Seconds], Move]] = (
    *(Schemer._ask,) * 5, *(Schemer._repeat,) * 4, *(Schemer._cancel,) * 3, Schemer._keep_alive,
    *(Schemer._answer,) * 2, Schemer._new_life,
)  # fmt: skip
