"""Short spellings for what is observed, and a session that remembers its log; for the tests of recognition."""

from typing import Any

from engage_hri.schemas.behaviors import Action, Event, EventKind, TurnSignal
from engage_hri.schemas.blocks import BlockProgress, SyncPointProgress
from engage_hri.schemas.faults import Cause
from engage_hri.schemas.fragments import Claim, HeadOwner
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, ActorLost
from engage_hri.schemas.recognition import ConnectionEvent, EventOutcome, RequestEvent, SignalTurn
from engage_hri.schemas.requests import Cancel
from engage_hri.schemas.units import Stamp
from engage_hri.schemas.world import Entity, World
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.events.machine import Effect
from engage_hri.services.recognition.events.session import Observation, Session
from engage_hri.services.reports.ongoing_actions import GoesOn

ROBOT, HUMAN = "robot", "human"
PIECES = ("blue-square", "rectangle", "purple-triangle", "pink-square", "trapezoid", "green-square")


def stamp(at: float) -> Stamp:
    return Stamp("loop", at)


def world(*people: str, pieces: tuple[str, ...] = PIECES) -> World:
    return World(
        entities=(
            *(Entity(id=piece, kind="object", position=(0.5, 0.0, 0.7)) for piece in pieces),
            Entity(id="table", kind="surface", position=(0.5, 0.0, 0.7)),
            *(Entity(id=person, kind="person", position=(1.2, 0.0, 1.2)) for person in people or (HUMAN,)),
        )
    )


class Log:
    """A session about one table; every call is one observation, its effects are kept in `effects`.

    An answer has 1.5 s, unless a test says otherwise: so the stories stay short.
    """

    def __init__(self, *people: str, **config: Any) -> None:
        self.session = Session(ROBOT, RecognitionConfig(**{"adjacency_pair_limit": 1.5, **config}))
        self.effects: list[Effect] = []
        self.requests = 0
        self.feed(world(*people), 0.0)

    def feed(self, observation: Observation, at: float) -> list[Effect]:
        effects = self.session.feed(observation, at)
        self.effects += effects
        return effects

    def until(self, now: float) -> list[Effect]:
        effects = self.session.advance(now)
        self.effects += effects
        return effects

    # -- what happened ------------------------------------------------------------------------------------------

    @property
    def events(self) -> list[ConnectionEvent]:
        return [effect for effect in self.effects if isinstance(effect, ConnectionEvent)]

    @property
    def outcomes(self) -> list[EventOutcome]:
        return [effect for effect in self.effects if isinstance(effect, EventOutcome)]

    def told(self, kind: EventKind | None = None) -> list[tuple[str, str, float]]:
        """(id, state, at) of all changes."""
        return [
            (event.id, event.state, round(event.at.seconds, 6))
            for event in self.events
            if kind is None or event.kind == kind
        ]

    def states(self, id: str) -> list[str]:
        return [event.state for event in self.events if event.id == id]

    def last(self, id: str) -> ConnectionEvent:
        return [event for event in self.events if event.id == id][-1]

    def succeeded(self, id: str) -> ConnectionEvent:
        return next(event for event in self.events if event.id == id and event.state == "succeeded")

    # -- what is observed ---------------------------------------------------------------------------------------

    def looks(self, actor: str, target: str, at: float) -> list[Effect]:
        return self.feed(_began(actor, "look", at, target), at)

    def looks_away(self, actor: str, target: str, at: float) -> list[Effect]:
        return self.feed(_ended(actor, "look", at, target), at)

    def begins(self, actor: str, action: Action, at: float, target: str = "", behavior: str = "") -> list[Effect]:
        return self.feed(_began(actor, action, at, target, behavior), at)

    def ends(self, actor: str, action: Action, at: float, target: str = "", behavior: str = "") -> list[Effect]:
        return self.feed(_ended(actor, action, at, target, behavior), at)

    def goes_on(
        self, actor: str, action: Action, at: float, since: float, target: str = "", behavior: str = ""
    ) -> list[Effect]:
        return self.feed(GoesOn(_began(actor, action, since, target, behavior), since), at)

    def found(self, actor: str, at: float) -> list[Effect]:
        return self.feed(ActorFound(actor=actor, at=stamp(at)), at)

    def lost(self, actor: str, at: float) -> list[Effect]:
        return self.feed(ActorLost(actor=actor, at=stamp(at)), at)

    def owner(self, kind: str, target: str, at: float) -> list[Effect]:
        return self.feed(HeadOwner(owner=Claim(kind=kind, priority=2, target=target), since=stamp(at)), at)

    def requests_event(self, kind: EventKind, at: float, *objects: str, **event: Any) -> str:
        """The id of the request."""
        self.requests += 1
        request = request_event(kind, at, *objects, request=f"request-{self.requests}", **event)
        self.feed(request, at)
        return request.id

    def signals(self, signal: str, at: float, turn: str = "turn-1", block: str = "") -> list[Effect]:
        behavior = TurnSignal(id="turn-end", turn=turn, signal=signal, actor=HUMAN)  # type: ignore[arg-type]
        self.requests += 1
        request = SignalTurn(
            id=f"signal-{self.requests}", requester="realizer", signal=behavior, at=stamp(at), block=block
        )
        return self.feed(request, at)

    def cancels(self, request: str, at: float, cause: Cause = "") -> list[Effect]:
        return self.feed(Cancel(id=request, requester="realizer", cause=cause), at)

    def passes(self, point: str, at: float, block: str = "block-1") -> list[Effect]:
        behavior, _, sync = point.partition(":")
        progress = SyncPointProgress(block=block, behavior=behavior, sync=sync, at=stamp(at), time=at)
        return self.feed(progress, at)

    def block_ends(self, at: float, status: str = "done", block: str = "block-1") -> list[Effect]:
        progress = BlockProgress(block=block, progress="end", at=stamp(at), status=status)  # type: ignore[arg-type]
        return self.feed(progress, at)


def asked(*accept: str, turn: str = "turn-1", end: float | None = 2.0) -> Log:
    """The robot has asked at 1.0 and fallen silent at `end`."""
    log = Log()
    log.begins(ROBOT, "speak", 1.0, behavior="block-1:speech-1")
    log.requests_event("adjacency_pair", 1.0, turn=turn, accept=accept)
    if end is not None:
        log.ends(ROBOT, "speak", end, behavior="block-1:speech-1")
        log.signals("ended", end)
    return log


def request_event(
    kind: EventKind, at: float, *objects: str, request: str = "request-1", block: str = "block-1", **event: Any
) -> RequestEvent:
    event = {"id": "event-1", "responder": HUMAN, **event}
    return RequestEvent(
        id=request, requester="realizer", block=block, at=stamp(at), event=Event(kind=kind, objects=objects, **event)
    )


def _began(actor: str, action: Action, at: float, target: str, behavior: str = "") -> ActionBegan:
    targets = (target,) if target else ()
    return ActionBegan(actor=actor, action=action, at=stamp(at), targets=targets, behavior=behavior)


def _ended(actor: str, action: Action, at: float, target: str, behavior: str = "") -> ActionEnded:
    targets = (target,) if target else ()
    return ActionEnded(actor=actor, action=action, at=stamp(at), targets=targets, behavior=behavior)
