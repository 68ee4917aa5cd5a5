"""Choosing how to refer: one reference with 10 phrases among 100 objects, sequences of them, the service around it.

    python benchmarks/reference_policy.py [--laps 10] [--trips 20] [--json]

Rows are multiples of the first, one reference. The brute force tries every sequence of pairs with the policy's own
tables and costs, and has to find the same cost; 40 pairs a reference are 64,000 sequences for three.

From fragment to block: a fragment is sent to the generation service over a bus in memory, and the trip is over when
its block has come to the realizer. The body's answers are remembered, so that they take no time, or worked out by
the simulated body for each fragment, as it does for real.
"""

import argparse
import itertools
import math
import random
import sys
from functools import partial
from pathlib import Path
from time import perf_counter

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import msgspec

from benchmarks.harness import Contender, compare, report
from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Reference, Speech, SpeechOption
from engage_hri.schemas.blocks import BlockOutcome, PerformBlock
from engage_hri.schemas.body import DescribeBody, Estimate, EstimateBehaviors, EstimateItem, Estimates
from engage_hri.schemas.fragments import PerformFragment, TurnFragment
from engage_hri.schemas.messages import Message
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.commandline.shell.process import run
from engage_hri.services.control.torso.body import SimulatedBody
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.references.motions import (
    AT_REST,
    CURRENT_POSE,
    Motions,
    Way,
    distinct,
    from_here,
    from_here_told,
    onward,
    onward_told,
)
from engage_hri.services.generation.references.pairs import ReferenceScene, considered, minimum_of, shown
from engage_hri.services.generation.references.policy import HeadAndArms, Movements, choose
from engage_hri.services.generation.service import generate
from engage_hri.services.requests.ends import RequestDesk, Requester
from engage_hri.services.runtime.service import running

OBJECTS, PHRASES = 100, 10
SIZES = (1, 2, 5, 10)
CONFIG = GenerationConfig(decision_patience=0.001)
PIECE = ((0.02, 0.02), (-0.02, 0.02), (-0.02, -0.02), (0.02, -0.02))


def table(seed: int = 1) -> World:
    """100 square pieces on half a square metre, and somebody to speak to."""
    chance = random.Random(seed)
    pieces = [
        Entity(
            id=f"piece-{number}",
            kind="object",
            position=(chance.uniform(0.35, 0.85), chance.uniform(-0.5, 0.5), 0.73),
            yaw=chance.uniform(0.0, math.pi),
            footprint=PIECE,
            radius=0.028,
        )
        for number in range(OBJECTS)
    ]
    return World(entities=(*pieces, Entity(id="human", kind="person", position=(1.3, 0.0, 1.2))))


def references(count: int, world: World, seed: int = 2) -> tuple[Reference, ...]:
    """Each of another piece: phrases of one to four words, the shorter the more ambiguous, and "this"."""
    chance = random.Random(seed)
    ids = [entity.id for entity in world.objects]
    made = []
    for number, target in enumerate(ids[:count]):
        others = [id for id in ids if id != target]
        options = [SpeechOption(text="this", cost=1, deictic=True)]
        for index in range(PHRASES - 1):
            words = 1 + index % 4
            left = tuple(chance.sample(others, OBJECTS // 4**words))
            options.append(SpeechOption(text=f"phrase {index}", cost=words, distractors=left))
        made.append(Reference(id=f"ref-{number}", target=target, minimum_reliability=0.3, options=tuple(options)))
    return tuple(made)


class Body:
    """The simulated body's estimates; remembered: each question is worked out once."""

    def __init__(self, world: World, remembered: bool) -> None:
        self._body = SimulatedBody()
        self._world = world
        self._known: dict[bytes, Estimate] | None = {} if remembered else None
        self.capabilities = self._body.capabilities

    def estimates(self, items: tuple[EstimateItem, ...]) -> tuple[Estimate, ...]:
        if self._known is None:
            return tuple(self._body.rehearse(items, self._world))
        return tuple(self._estimate(item) for item in items)

    def _estimate(self, item: EstimateItem) -> Estimate:
        assert self._known is not None
        question = msgspec.msgpack.encode(item)
        if question not in self._known:
            self._known[question] = self._body.estimate(item.behavior, item.pose, self._world)
        return self._known[question]

    def motions(self, sequence: list[str]) -> Motions:
        """All motions between the targets, and from rest."""
        targets = distinct(sequence)
        here = from_here_told(targets, self.estimates(from_here(targets)))
        ways = [Way("head", since, target) for target in targets for since in (AT_REST, *targets)]
        ways += [
            Way("arm", way.since, way.target)
            for way in ways
            if here.known[Way("arm", CURRENT_POSE, way.target)].feasible
        ]
        return onward_told(ways, here, self.estimates(onward(ways, here)))


class Choosing:
    """The policy alone, from references and motions to choices with their tables."""

    def __init__(self, count: int, world: World, body: Body) -> None:
        self.name = f"choose for {count} reference{'s' if count > 1 else ''}"
        self.references = references(count, world)
        self.motions = body.motions([reference.target for reference in self.references])
        self.world = world
        self.body = body

    def scene(self) -> ReferenceScene:
        says = self.body.capabilities
        return ReferenceScene(world=self.world, half_angle=says.gaze_half_angle, pointing_radius=says.pointing_radius)

    def cost(self) -> Seconds:
        choices = choose(self.references, self.scene(), self.motions, CONFIG).choices
        return sum(choice.cost for choice in choices)

    async def lap(self, count: int) -> list[Seconds]:
        taken = []
        for _ in range(count):
            began = perf_counter()
            self.cost()
            taken.append(perf_counter() - began)
        return taken


class BruteForce(Choosing):
    """Every sequence of pairs; the posture carried along."""

    def __init__(self, count: int, world: World, body: Body) -> None:
        super().__init__(count, world, body)
        self.least = super().cost()
        self.name = f"  all sequences, {count} reference{'s' if count > 1 else ''}"

    def cost(self) -> Seconds:
        scene = self.scene()
        seems = shown([reference.target for reference in self.references], scene, self.motions)
        tables = [
            [pair for pair in considered(reference, seems[reference.target], scene, self.motions, CONFIG)
             if not pair.ruled_out and pair.reliability >= minimum_of(reference, CONFIG)]
            for reference in self.references
        ]  # fmt: skip
        movements = [Movements(reference.target, self.motions, CONFIG) for reference in self.references]
        least = math.inf
        for sequence in itertools.product(*tables):
            total, posture = 0.0, HeadAndArms()
            for reference, pair, each in zip(self.references, sequence, movements, strict=True):
                total += each.cost(pair, posture)
                posture = posture.afterwards(reference.target, each.arm, self.motions)[pair.gesture]
            least = min(least, total)
        assert math.isclose(least, self.least), f"{least} instead of {self.least}"
        return least

    async def lap(self, count: int) -> list[Seconds]:
        return await super().lap(1 if len(self.references) > 2 else max(1, count // 5))


class Serving:
    """From `PerformFragment` to `PerformBlock`, through the generation service."""

    def __init__(self, count: int, world: World, client: Bus, realizer: Bus, how: str) -> None:
        self.name = f"fragment to block, {count} reference{'s' if count != 1 else ''}, {how}"
        self._references = references(count, world)
        self._bus = client
        self._requests = Requester(client)
        self._desk = RequestDesk(realizer, "realizer", lambda cancel: None)
        self._inbox = realizer.subscribe(*RequestDesk.patterns("realizer"))
        self._answers = client.subscribe(*Requester.PATTERNS)
        self._numbers = itertools.count()

    async def lap(self, count: int) -> list[Seconds]:
        return [await self._trip() for _ in range(count)]

    async def _trip(self) -> Seconds:
        id = f"{self.name}-{next(self._numbers)}".replace(" ", "_").replace(",", "")
        fragment = TurnFragment(id=id, behaviors=(Speech(id="s", text="Take"), *self._references))
        began = perf_counter()
        pending = self._requests.send(
            keys.FRAGMENT, PerformFragment(id=id, requester=self._bus.name, fragment=fragment)
        )
        while True:
            received = await self._inbox.next()
            assert received is not None
            request = self._desk.take(received)
            if isinstance(request, PerformBlock):
                arrived = perf_counter()
                self._desk.accept(request.id)
                self._desk.end(BlockOutcome(id=request.id, block=request.block.id, status="done"))
                if request.block.id == id:
                    break
        while not pending.outcome.done():
            answer = await self._answers.next()
            assert answer is not None
            self._requests.feed(answer)
        return arrived - began


async def measure(laps: int, trips: int, as_json: bool) -> None:
    world = table()
    remembering, working = Body(world, True), Body(world, False)
    contenders: list[Contender] = [Choosing(count, world, remembering) for count in SIZES]
    contenders += [BruteForce(count, world, remembering) for count in (1, 2, 3)]
    taken = await compare(contenders, laps, trips)
    for body, how in ((remembering, "body at once"), (working, "simulated body")):

        def answer(question: Message, body: Body = body) -> Message:
            assert isinstance(question, EstimateBehaviors)
            return Estimates(items=body.estimates(question.items))

        def describe(question: Message, body: Body = body) -> Message:
            assert isinstance(question, DescribeBody)
            return body.capabilities

        async with MemoryHub() as hub:
            client, realizer, control = hub.join("client"), hub.join("realizer"), hub.join("control")
            control.answer(keys.ESTIMATE, answer)
            control.answer(keys.DESCRIBE, describe)
            control.publish(keys.WORLD, world)
            for bus in (client, realizer, control):
                bus.declare_alive()
            async with running(hub, {"generation": partial(generate, config=CONFIG)}):
                for count in (0, *SIZES):
                    taken |= await compare([Serving(count, world, client, realizer, how)], laps, trips)
    report(taken, as_json)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--laps", type=int, default=10)
    parser.add_argument("--trips", type=int, default=20)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    run(measure(options.laps, options.trips, options.json))


if __name__ == "__main__":
    main()
