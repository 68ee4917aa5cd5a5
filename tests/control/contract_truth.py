"""The contract of bodies: no sync point that the joints do not bear out, whatever is begun, held, cut or aborted.

The oracle takes nothing from the body but where its eyes and forearms point as it reports a point. From that, and
from what the test itself has asked for, it says whether the report can be true.
"""

import asyncio
import math
from collections.abc import Callable, Sequence
from random import Random

import pytest

from engage_hri.schemas.behavior_types import sync_points
from engage_hri.schemas.behaviors import BlockBehavior, Gaze, GazeShift, Gesture, Head, HeadDirectionShift, Pointing
from engage_hri.schemas.body import Ray
from engage_hri.schemas.references import type_name
from engage_hri.schemas.units import Vector
from engage_hri.schemas.world import World
from engage_hri.services.control.body import BehaviorRefused, Body, BodyState, Reached
from tests.control.suite import ON_AXIS, Stage, Suite, aside, default

TARGETS = ("human", "near-right", "far-left")
SHIFTS = GazeShift | HeadDirectionShift
PROMPT = 0.05
"""Seconds within which a body reports a point."""
AWAY = 0.02
"""Metres that a hand is at least away from where it rests, at the stroke of a gesture."""
NODDED = math.radians(1.0)
LOOKS: tuple[Callable[[str, Random], BlockBehavior], ...] = (
    lambda id, chance: Gaze(id=id, target=chance.choice(TARGETS)),
    lambda id, chance: Gaze(id=id, target=chance.choice(TARGETS)),
    lambda id, chance: GazeShift(id=id, target=chance.choice(TARGETS)),
    lambda id, chance: HeadDirectionShift(id=id, target=chance.choice(TARGETS)),
)
NODS: tuple[Callable[[str, Random], BlockBehavior], ...] = (
    lambda id, chance: Head(id=id, lexeme="NOD", repetition=chance.randrange(1, 4)),
    lambda id, chance: Head(id=id, lexeme="SHAKE"),
)
ARMS: tuple[Callable[[str, Random], BlockBehavior], ...] = (
    lambda id, chance: Pointing(id=id, target=chance.choice(TARGETS[1:]), mode=one_hand(chance)),
    lambda id, chance: Pointing(id=id, target=chance.choice(TARGETS[1:]), mode=one_hand(chance)),
    lambda id, chance: Gesture(id=id, lexeme="BEAT", mode=one_hand(chance)),
    lambda id, chance: Gesture(id=id, lexeme="WAVE", mode="BOTH_HANDS"),
)
CROWDS = {"looks": LOOKS, "nods": NODS, "arms": ARMS, "all but nods": LOOKS + ARMS}


def one_hand(chance: Random) -> str:
    return chance.choice(("LEFT_HAND", "RIGHT_HAND"))


class Witness:
    """Knows what was asked for, and says what cannot be true. rest: the body at home, before anything."""

    def __init__(self, body: Body, world: World) -> None:
        self.body = body
        self.world = world
        self.rest = body.state()
        self.stages: list[WatchedStage] = []
        self.base: str | None = ""
        """Where the head belongs: an entity; empty: where it was; None: unknown, since a shift was broken off."""
        self.lies: list[str] = []

    def hear(self, stage: "WatchedStage", reached: Reached) -> None:
        """Take a report, as it comes."""
        late = asyncio.get_running_loop().time() - reached.at
        if not 0.0 <= late + 1e-6 <= PROMPT:
            self.lies.append(f"{stage.behavior.id}:{reached.sync} is reported {late:.2f} s after it was")
        if isinstance(stage.behavior, SHIFTS):
            if reached.sync == "start":
                self.base = None
            elif reached.sync == "end":
                self.base = stage.behavior.target
        if not self.is_true(stage.behavior, reached.sync, self.body.state()):
            self.lies.append(f"{stage.behavior.id}:{reached.sync}")

    def is_true(self, behavior: BlockBehavior, sync: str, state: BodyState) -> bool:
        match behavior, sync:
            case Gaze(target=target), "stroke" | "stroke_end" | "relax":
                return self.looks_at(state.gaze, target)
            case Gaze(), "end":
                return self.is_at_base(state.gaze)
            case GazeShift(target=target) | HeadDirectionShift(target=target), "end":
                return self.has_look() or self.looks_at(state.gaze, target)
            case Head(), "stroke":
                return angle(state.gaze.axis, self.rest.gaze.axis) > NODDED
            case Head(), "end":
                return angle(state.gaze.axis, self.rest.gaze.axis) < ON_AXIS
            case Pointing(target=target, mode=mode), "stroke" | "stroke_end":
                (arm,) = arms(state, mode)
                return beside(arm, self.place(target)) <= self.body.capabilities.pointing_radius
            case Gesture(mode=mode), "stroke":
                pairs = zip(arms(state, mode), arms(self.rest, mode), strict=True)
                return all(math.dist(hand(one), hand(other)) > AWAY for one, other in pairs)
            case ((Gesture(mode=mode) | Pointing(mode=mode)), "end"):
                pairs = zip(arms(state, mode), arms(self.rest, mode), strict=True)
                return all(math.dist(hand(one), hand(other)) < AWAY / 2 for one, other in pairs)
        return True

    def is_at_base(self, gaze: Ray) -> bool:
        if self.base is None:
            return True
        return self.looks_at(gaze, self.base) if self.base else angle(gaze.axis, self.rest.gaze.axis) < ON_AXIS

    def looks_at(self, gaze: Ray, target: str) -> bool:
        return aside(gaze, self.place(target)) < ON_AXIS

    def has_look(self) -> bool:
        return any(isinstance(each.behavior, Gaze) and not each.task.done() for each in self.stages)

    def place(self, target: str) -> Vector:
        entity = self.world.entity(target)
        assert entity is not None
        return entity.position


class WatchedStage(Stage):
    """A stage whose reports a witness hears as they come."""

    def __init__(self, witness: Witness, behavior: BlockBehavior, through: str) -> None:
        self.is_refused = False
        self.behavior = behavior
        self.witness = witness
        super().__init__(witness.body, behavior, through)
        witness.stages.append(self)

    async def _perform(self) -> None:
        async for progress in self._body.perform(self.behavior, self.authority):
            self.progress.append(progress)
            if isinstance(progress, Reached):
                self.witness.hear(self, progress)


class TruthContract(Suite):
    """Part of `BodyContract`."""

    @pytest.mark.parametrize("seed", range(12))
    @pytest.mark.parametrize("crowd", CROWDS)
    async def test_no_sync_point_that_the_joints_do_not_bear_out(self, body: Body, crowd: str, seed: int):
        await body.home()
        witness = await witnessed(body, self.world, CROWDS[crowd], Random(f"{crowd} {seed}"))
        if witness is None:
            pytest.skip("no such parts")

        assert witness.lies == [], witness.lies
        for stage in witness.stages:
            told, points = default(stage.passed), sync_points(stage.behavior)
            assert told == points[: len(told)], stage.behavior.id
            how = stage.authority.revoked
            if not stage.is_refused:
                assert (told == points) == (how is None or "end" in told), (stage.behavior.id, how)
                assert how is not None or told == points, stage.behavior.id
        assert witness.is_at_base(body.state().gaze)
        assert not body.state().moving


async def witnessed(
    body: Body, world: World, makers: Sequence[Callable[[str, Random], BlockBehavior]], chance: Random
) -> Witness | None:
    """Begin, extend, hold, release and abort at random; None if the body has none of these behaviors."""
    able = [make for make in makers if type_name(make("any", chance)) in body.capabilities.types]
    if not able:
        return None
    witness = Witness(body, world)
    for number in range(25):
        await asyncio.sleep(chance.choice((0.0, chance.uniform(0.0, 0.5), chance.uniform(0.0, 2.0))))
        live = [each for each in witness.stages if not each.task.done()]
        act = chance.choice(("begin", "begin", "extend", "hold", "go on", "abort")) if live else "begin"
        if act == "begin":
            behavior = chance.choice(able)(f"{number}", chance)
            WatchedStage(witness, behavior, chance.choice(("start", "end", *sync_points(behavior))))
            continue
        one = chance.choice(live)
        match act:
            case "extend":
                one.authority.extend(chance.choice(one.authority.points))
            case "hold":
                one.authority.hold()
            case "go on":
                one.authority.go_on()
            case "abort":
                if isinstance(one.behavior, SHIFTS):
                    witness.base = None
                one.authority.revoke(chance.choice(("relax", "freeze")))
    for stage in witness.stages:
        stage.authority.go_on()
        stage.authority.extend("end")
    for stage in witness.stages:
        try:
            await stage.over()
        except BehaviorRefused:
            stage.is_refused = True
    await asyncio.sleep(10.0)
    return witness


def arms(state: BodyState, mode: str | None) -> tuple[Ray, ...]:
    both = {"LEFT_HAND": (state.left_arm,), "RIGHT_HAND": (state.right_arm,)}
    return both.get(mode or "", (state.left_arm, state.right_arm))


def hand(arm: Ray) -> Vector:
    assert arm.tip is not None
    return arm.tip


def angle(one: Vector, other: Vector) -> float:
    return math.acos(max(-1.0, min(1.0, sum(a * b for a, b in zip(one, other, strict=True)))))


def beside(ray: Ray, point: Vector) -> float:
    """Metres by which a point lies beside a ray; inf behind it."""
    way = [there - here for here, there in zip(ray.origin, point, strict=True)]
    along = sum(a * b for a, b in zip(ray.axis, way, strict=True))
    return math.sqrt(max(0.0, sum(each * each for each in way) - along * along)) if along > 0 else math.inf
