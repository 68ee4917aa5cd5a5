"""Robot and people as they really are, the reporters that tell of them, and recognition as a service among them."""

import asyncio
from collections.abc import Iterable
from math import inf
from typing import Any

import pytest
from msgspec import Struct

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Action, Event, TurnSignal
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, ActorLost, OngoingActions
from engage_hri.schemas.recognition import ConnectionEvent, EventOutcome, RequestEvent, SignalTurn
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Subscription
from engage_hri.services.bus.memory import MemoryBus
from engage_hri.services.client.people.perceived_person import PerceivedActions
from engage_hri.services.recognition import intake, service
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.events.session import Session
from engage_hri.services.recognition.recognizer import Recognizer
from engage_hri.services.reports.action_reports import REPORT_GRACE
from engage_hri.services.reports.ongoing_actions import OngoingActionTracker
from engage_hri.services.requests.ends import Requester
from engage_hri.services.runtime.service import serve
from tests.bus.cuttable import CuttableHub
from tests.recognition.observations import ROBOT, world

GRACE = REPORT_GRACE
SERVICES = ("recognition", "control", "cameras", "others")
SPEECH = "block-1:speech-1"
Doing = dict[tuple[Action, str], Seconds]
"""Actions that go on, with a target or a behavior, and since when."""


class Belief(Struct, frozen=True):
    """What somebody does, as recognition has it, or as it is."""

    is_here: bool
    looks: str = ""
    speaks: bool = False
    acts: bool = False


class Actor:
    """Somebody, as they are."""

    def __init__(self, id: str) -> None:
        self.id = id
        self.is_here = id == ROBOT
        self.doing: Doing = {}

    @property
    def truth(self) -> Belief:
        if not self.is_here:
            return Belief(False)
        looks = next((target for action, target in self.doing if action == "look"), "")
        kinds = {action for action, _ in self.doing}
        return Belief(True, looks, "speak" in kinds, "act" in kinds)


class Reporter:
    """A reporter of these actors, which dies and comes back as another life."""

    def __init__(self, stage: "Stage", name: str, *actors: Actor) -> None:
        self.name = name
        self.actors = actors
        self._stage = stage
        self._bus: MemoryBus | None = None

    def start(self) -> None:
        """Come onto the bus, and see what there is to be seen: of what goes on it does not know since when."""
        if self._bus is not None:
            return
        self._bus = self._stage.hub.join(self.name, role="control" if self.name == "control" else "perception")
        self._perceived, self._tracker = PerceivedActions(self._bus), OngoingActionTracker()
        self._bus.declare_alive()
        now = self._bus.now()
        if self.name == "control":
            self._bus.publish(keys.ROBOT_ONGOING, OngoingActions(actor=ROBOT, at=self._bus.stamp()))
        for actor in self.actors:
            if actor.is_here:
                self.tell(actor, ActorFound, now)
                for action, about in actor.doing:
                    self.tell(actor, ActionBegan, now, action, about)

    def kill(self) -> None:
        if self._bus is not None:
            self._bus = None
            self._stage.hub.kill(self.name)

    def tell(self, actor: Actor, kind: type, at: Seconds, action: Action = "look", about: str = "") -> None:
        if self._bus is None or actor not in self.actors:
            return
        stamp = self._bus.stamp(at)
        if kind in (ActorFound, ActorLost):
            event = kind(actor=actor.id, at=stamp)
        elif actor.id == ROBOT and action == "speak":
            event = kind(actor=actor.id, action=action, at=stamp, behavior=about)
        else:
            event = kind(actor=actor.id, action=action, at=stamp, targets=(about,) if about else ())
        if actor.id != ROBOT:
            self._perceived.tell(event)
        elif kind in (ActionBegan, ActionEnded):
            self._bus.publish(keys.ROBOT_ACTION, event)
            for state in self._tracker.feed([event], self._bus.stamp()):
                self._bus.publish(keys.ROBOT_ONGOING, state)


class Stage:
    """Recognition, a body, cameras that see ann and bob, and others that see ann."""

    def __init__(self, hub: CuttableHub, monkeypatch: pytest.MonkeyPatch, **config: Any) -> None:
        self.hub = hub
        self.robot, self.ann, self.bob = (Actor(name) for name in (ROBOT, "ann", "bob"))
        self.actors = {actor.id: actor for actor in (self.robot, self.ann, self.bob)}
        self.reporters = {
            "control": Reporter(self, "control", self.robot),
            "cameras": Reporter(self, "cameras", self.ann, self.bob),
            "others": Reporter(self, "others", self.ann),
        }
        self.sessions: list[Session] = []
        self._config = RecognitionConfig(**config)
        self._task: asyncio.Task[None] | None = None
        stage = self

        class Watched(Recognizer):
            def __init__(self, *args: Any, **named: Any) -> None:
                super().__init__(*args, **named)
                stage.sessions.append(self.session)

        monkeypatch.setattr(intake, "Recognizer", Watched)
        self.world = hub.join("world")
        self.world.publish(keys.WORLD, world("nobody"))

    @property
    def now(self) -> Seconds:
        return self.world.now()

    # -- processes ----------------------------------------------------------------------------------------------

    def start(self, *names: str) -> None:
        for name in names:
            if name != "recognition":
                self.reporters[name].start()
            elif self._task is None:
                recognition = lambda bus, ready: service.recognize(bus, ready, self._config)  # noqa: E731
                self._task = asyncio.create_task(serve(self.hub, "recognition", recognition), name="recognition")

    async def kill(self, *names: str) -> None:
        for name in names:
            if name != "recognition":
                self.reporters[name].kill()
            elif self._task is not None:
                self.hub.kill("recognition")
                self._task.cancel()
                await asyncio.wait([self._task])
                self._task = None

    # -- what happens -------------------------------------------------------------------------------------------

    def comes(self, actor: Actor) -> None:
        actor.is_here = True
        self._tell(actor, ActorFound)

    def goes(self, actor: Actor) -> None:
        for action, about in list(actor.doing):
            self.ends(actor, action, about)
        actor.is_here = False
        self._tell(actor, ActorLost)

    def looks(self, actor: Actor, target: str) -> None:
        """Look there; empty: nowhere."""
        for action, about in list(actor.doing):
            if action == "look":
                self.ends(actor, "look", about)
        if target:
            self.begins(actor, "look", target)

    def begins(self, actor: Actor, action: Action, about: str = "") -> None:
        actor.doing[action, about] = self.now
        self._tell(actor, ActionBegan, action, about)

    def ends(self, actor: Actor, action: Action, about: str = "") -> None:
        if actor.doing.pop((action, about), None) is not None:
            self._tell(actor, ActionEnded, action, about)

    def _tell(self, actor: Actor, kind: type, action: Action = "look", about: str = "") -> None:
        for reporter in self.reporters.values():
            reporter.tell(actor, kind, self.now, action, about)

    # -- what recognition believes ------------------------------------------------------------------------------

    def believed(self, actor: Actor) -> Belief:
        session = self.sessions[-1]
        if actor is self.robot:
            gaze, speaks = session.scene.gaze, session.scene.robot_speaks_since
            return Belief(True, _first(gaze.targets), speaks is not None)
        person = session.persons.get(actor.id)
        if person is None or not person.presence.here:
            return Belief(False)
        looks = "" if person.gazes.gaze.ended < inf else _first(person.gazes.gaze.targets)
        return Belief(True, looks, person.talk.speeches.going_on is not None, actor.id in session.busy)


def _first(targets: Iterable[str]) -> str:
    return next(iter(targets), "")


class Running:
    """A stage with these processes on it; none: all."""

    def __init__(
        self, monkeypatch: pytest.MonkeyPatch, *names: str, hub: CuttableHub | None = None, **config: Any
    ) -> None:
        self.hub = hub or CuttableHub()
        self.stage = Stage(self.hub, monkeypatch, **config)
        self._names = names or SERVICES

    async def __aenter__(self) -> Stage:
        self.stage.start(*self._names)
        await asyncio.sleep(0.1)
        return self.stage

    async def __aexit__(self, *raised: object) -> None:
        await self.stage.kill("recognition")
        await self.hub.close()


async def ask(stage: Stage, kind: str, person: str, *objects: str, **event: Any) -> "asyncio.Task[EventOutcome]":
    """Ask for an event; returns the task that has its outcome."""
    realizer = stage.hub._buses.get("realizer") or stage.hub.join("realizer")
    realizer.declare_alive()
    asked = Event(id=f"{kind}-1", kind=kind, responder=person, objects=objects, **event)  # type: ignore[arg-type]

    async def outcome() -> EventOutcome:
        async with Requester(realizer) as requests:
            request = RequestEvent(id="r", requester="realizer", block="block-1", at=realizer.stamp(), event=asked)
            decided = await requests.send(keys.EVENT, request).outcome
        assert isinstance(decided, EventOutcome)
        return decided

    task = asyncio.create_task(outcome(), name="realizer")
    await asyncio.sleep(0.05)
    return task


async def all_of(inbox: Subscription) -> list[ConnectionEvent]:
    """The events that have come."""
    received = [await inbox.next() for _ in range(len(inbox))]
    return [each.message for each in received if each is not None and isinstance(each.message, ConnectionEvent)]


async def turn_ends(stage: Stage) -> None:
    realizer = stage.hub._buses["realizer"]
    signal = TurnSignal(id="turn", turn="turn-1", signal="ended", actor="ann")
    async with Requester(realizer) as requests:
        await requests.send(
            keys.TURN, SignalTurn(id="s", requester="realizer", signal=signal, at=realizer.stamp())
        ).outcome
