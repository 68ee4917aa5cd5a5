"""One life of a requester and one of a server with its service, around the pure machines. `World` joins them."""

import random
from collections import Counter, defaultdict
from typing import TYPE_CHECKING, Any, NamedTuple

from msgspec import structs

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Wait
from engage_hri.schemas.blocks import Block, BlockOutcome, InterruptBehavior, PerformBlock
from engage_hri.schemas.body import BehaviorOutcome, PerformBehavior
from engage_hri.schemas.faults import EngageError, Fault, RunFailed
from engage_hri.schemas.requests import Accepted, Answer, Cancel, KeepAlive, Outcome, Refused, Request, life_of
from engage_hri.schemas.units import Stamp
from engage_hri.services.requests import asking, serving
from engage_hri.services.requests.asking import Asking, Patience
from engage_hri.services.requests.serving import Serving

if TYPE_CHECKING:
    from tests.requests.request_world import World

PATIENCE = Patience(cancel=8.0, silence=12.0)


class Asked(NamedTuple):
    """A request as the test knows it. By id alone the clients' requests are the same."""

    client: str
    life: str
    id: str


class Client:
    """One life of one client."""

    def __init__(self, world: "World", name: str, run: str) -> None:
        self.world = world
        self.name = name
        self.run = run
        self.life = life = life_of(run, 1)
        self.machine = Asking(name, life, structs.replace(PATIENCE, window=world.window))
        self.is_alive = True
        self.ends: dict[str, list[Outcome | EngageError]] = defaultdict(list)
        self.asked: list[str] = []
        self.cancelled: set[Asked] = set()
        self.first_sent: list[str] = []
        self.unanswered: set[str] = set()
        """Requests on their way: sent, and nothing has come back."""

    def _publish(self, message: Request) -> None:
        if isinstance(message, Cancel):
            self.unanswered.discard(message.id)
        elif message.id not in self.first_sent:
            self.first_sent.append(message.id)
            self.unanswered.add(message.id)
            assert len(self.unanswered) <= self.world.window, "more on their way than the server is to have"
        self.world.to_server(self, message)

    def hear(self, answer: Answer) -> None:
        if (answer.requester, answer.life) == (self.name, self.life):
            self.unanswered.discard(answer.id)
        self.carry_out(self.machine.hear(answer, self.world.now, "realizer"))

    def carry_out(self, effects: list[asking.Effect]) -> None:
        for effect in effects:
            match effect:
                case asking.PublishCommand(message=message):
                    self._publish(message)
                case asking.Renew(live=live):
                    still = KeepAlive(live=live, at=Stamp("w", self.world.now), requester=self.name, life=self.life)
                    self.world.to_server(self, still)
                case asking.TellEnd(id=id, end=end):
                    self.ends[id].append(end)
                    self.unanswered.discard(id)
                    if isinstance(end, RunFailed) and end.fault.cause == "gone":
                        self.world.judge_gone(Asked(self.name, self.life, id))
        self.world.wake(self.machine.deadline, self.tick)

    def tick(self) -> None:
        if self.is_alive and self.machine.deadline is not None and self.machine.deadline <= self.world.now:
            self.carry_out(self.machine.tick(self.world.now))


class Server:
    """One life of the server and of the service behind it, which is slow, deaf or forgetful as chance has it."""

    def __init__(self, world: "World", run: str) -> None:
        self.world = world
        self.run = run
        self.machine = Serving("realizer", 5.0)
        self.is_alive = True
        self.handed: Counter[Asked] = Counter()
        self.handed_at: dict[Asked, float] = {}
        self.ended: dict[Asked, list[Answer]] = defaultdict(list)
        self.names: dict[str, tuple[Asked, Request]] = {}
        self.deaf: set[str] = set()
        self.stopped: set[Asked] = set()
        self.lapsed: list[Asked] = []
        self.content: dict[Asked, Request] = {}
        self.mistakes: list[Fault] = []

    def carry_out(self, effects: list[serving.Effect]) -> None:
        for effect in effects:
            match effect:
                case serving.PublishAnswer(answer=answer):
                    self.world.to_clients(self, answer)
                case serving.Hand(request=Cancel() as cancel):
                    whose = self.names[cancel.id][0]
                    assert whose not in self.stopped, "told to stop twice"
                    self.stopped.add(whose)
                    if cancel.cause == "unrenewed":
                        self.lapsed.append(whose)
                    self.stop(cancel.id)
                case serving.Hand(request=request):
                    self.begin(request)
                case serving.ServingFault(fault=fault, is_ours=True):
                    self.mistakes.append(fault)
        self.world.wake(self.machine.deadline, self.tick)

    def begin(self, request: Request) -> None:
        if request.id in self.names:
            self.content[self.names[request.id][0]] = request
            return
        original = self.machine.asked(request.id)
        assert original is not None
        whose = Asked(original.requester, original.life, original.id)
        self.names[request.id] = (whose, original)
        self.content[whose] = request
        self.handed[whose] += 1
        self.handed_at[whose] = self.world.now
        chance, world = self.world.chance, self.world
        if chance.random() < 0.1:
            world.later(
                chance.uniform(0.0, 3.0), lambda: self.end(request.id, Refused(id="", fault=Fault(reason="no")))
            )
            return
        world.later(chance.uniform(0.0, 3.0), lambda: self.answer(request.id, Accepted(id=request.id)))
        if chance.random() < 0.15:
            self.deaf.add(request.id)
        if chance.random() < 0.7:
            world.later(3.0 + chance.expovariate(0.1), lambda: self.end(request.id, done(original, "done")))

    def stop(self, name: str) -> None:
        if name not in self.deaf:
            outcome = done(self.names[name][1], "interrupted")
            self.world.later(self.world.chance.choice([0.0, 0.5, 6.0, 20.0]), lambda: self.end(name, outcome))

    def answer(self, name: str, answer: Answer) -> None:
        if self.is_alive and self.machine.is_live(name):
            self.carry_out(self.machine.answer(name, answer, self.world.now))

    def end(self, name: str, answer: Answer) -> None:
        if self.is_alive and self.machine.is_live(name):
            self.ended[self.names[name][0]].append(answer)
            self.carry_out(self.machine.answer(name, answer, self.world.now))

    def tick(self) -> None:
        if self.is_alive and self.machine.deadline is not None and self.machine.deadline <= self.world.now:
            self.carry_out(self.machine.tick(self.world.now))


def done(request: Request, status: Any) -> Outcome:
    if isinstance(request, PerformBehavior):
        status = "aborted" if status == "interrupted" else status
        return BehaviorOutcome(id="", block="b", behavior="w", status=status, at=Stamp("w", 0.0))
    return BlockOutcome(id="", block="b", status=status)


CHANCE = random.Random(0)


def perform_block(id: str) -> Request:
    return PerformBlock(id=id, block=Block(id="b"))


def interrupt(id: str) -> Request:
    return InterruptBehavior(id=id, block="b", behavior="w")


def perform_behavior(id: str) -> Request:
    return PerformBehavior(id=id, block="b", behavior=Wait(id="w"), through=CHANCE.choice(("start", "end")))


# All on one server, so that kinds meet.
REQUESTS = ((perform_block, keys.BLOCK), (interrupt, keys.BLOCK), (perform_behavior, keys.BLOCK))
