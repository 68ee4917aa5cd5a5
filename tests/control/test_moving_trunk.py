"""Looks and pointing arms while the trunk moves: on target as they say so, and for as long as they are held there.

The oracle takes nothing from the body but where its eyes and forearms point, at every 4 ms.
"""

import asyncio
import math
from collections.abc import Callable
from random import Random

import numpy as np
import pytest

from engage_hri.schemas.behavior_types import sync_points
from engage_hri.schemas.behaviors import (
    BlockBehavior,
    Gaze,
    GazeShift,
    Hand,
    Head,
    HeadDirectionShift,
    Pointing,
    Posture,
    PostureShift,
)
from engage_hri.schemas.body import EstimateItem, PlannedTime
from engage_hri.services.control.contract.body import Arrived, BehaviorRefused, BodyFailed, BodyState, Spoke
from engage_hri.services.control.figure.repertoire import BUILT_IN, extended
from engage_hri.services.control.testing import WORLD, Stage, performed, times
from engage_hri.services.control.testing.findings import aside, beside
from engage_hri.services.control.testing.motions import STEP, recorded, violations
from engage_hri.services.control.testing.suite import ON_AXIS
from engage_hri.services.control.testing.truth import arms
from engage_hri.services.control.torso.body import SimulatedBody
from tests.random_cases import share_of

TARGETS = ("human", "near-right", "far-left")
HANDS: tuple[Hand, ...] = ("LEFT_HAND", "RIGHT_HAND")
LEANS = ("LEAN_FORWARD", "LEAN_BACK", "TURN_LEFT", "TURN_RIGHT", "FAR_LEFT", "BOW")
WIDE = """
[pose]
FAR_LEFT = { torso = { turn = 24, lean = 6 } }
DEEP = { torso = { lean = 25 }, arms = { inward = 0, forward = -10, elbow = 140 } }
BOW = { torso = { lean = 16, turn = -8 } }
"""
POINTED = 0.02
"""Metres by which the axis of a pointing forearm may pass its target."""
AIMED: tuple[Callable[[str, Random], BlockBehavior], ...] = (
    lambda id, chance: Gaze(id=id, target=chance.choice(TARGETS)),
    lambda id, chance: GazeShift(id=id, target=chance.choice(TARGETS)),
    lambda id, chance: GazeShift(id=id, target=chance.choice(TARGETS), influence="WAIST"),
    lambda id, chance: HeadDirectionShift(id=id, target=chance.choice(TARGETS)),
    lambda id, chance: Pointing(id=id, target=chance.choice(TARGETS[1:]), mode=chance.choice(HANDS)),
)
LEANING: tuple[Callable[[str, Random], BlockBehavior], ...] = (
    lambda id, chance: Posture(id=id, lexeme=chance.choice(LEANS)),
    lambda id, chance: PostureShift(id=id, lexeme=chance.choice(LEANS)),
)
NODDING: tuple[Callable[[str, Random], BlockBehavior], ...] = (
    lambda id, chance: Head(id=id, lexeme="NOD"),
    lambda id, chance: Head(id=id, lexeme="SHAKE"),
)
ON_TARGET = {Gaze: ("stroke", "relax"), Pointing: ("stroke", "stroke_end"), GazeShift: ("end", ""),
             HeadDirectionShift: ("end", "")}  # fmt: skip
"""First and last sync point at which each is on its target."""


@pytest.fixture
async def body() -> SimulatedBody:
    body = SimulatedBody(repertoire=extended(BUILT_IN, [("wide.toml", WIDE)]))
    body.see(WORLD)
    return body


def is_on_target(behavior: BlockBehavior, state: BodyState) -> bool:
    assert isinstance(behavior, Gaze | GazeShift | HeadDirectionShift | Pointing)
    entity = WORLD.entity(behavior.target)
    assert entity is not None
    if isinstance(behavior, Pointing):
        return beside(arms(state, behavior.mode)[0], entity.position) < POINTED
    return aside(state.gaze, entity.position) < ON_AXIS


class Scene:
    """Behaviors that move one body, and what of them was told or held without being on target."""

    def __init__(self, body: SimulatedBody) -> None:
        self.body = body
        self.stages: list[WatchedStage] = []
        self.lies: list[str] = []
        self.checks = 0

    def check(self, behavior: BlockBehavior, where: str) -> None:
        """Note a lie if a behavior that is on target now is not."""
        is_shift = isinstance(behavior, GazeShift | HeadDirectionShift)
        if is_shift and any(isinstance(each.behavior, Gaze) and not each.task.done() for each in self.stages):
            return  # A look lies over it.
        self.checks += 1
        if not is_on_target(behavior, self.body.state()):
            self.lies.append(f"{behavior.id}:{where} at {asyncio.get_running_loop().time():.3f}")

    async def watch(self) -> None:
        """Check what is held on target, all the time."""
        while True:
            for stage in self.stages:
                if stage.is_on and stage.authority.revoked is None:
                    self.check(stage.behavior, "held")
            await asyncio.sleep(STEP)


class WatchedStage(Stage):
    """A stage whose behavior is checked as it says that it is on target, and while it says no more."""

    def __init__(self, scene: Scene, behavior: BlockBehavior, through: str) -> None:
        self.behavior, self.scene = behavior, scene
        self.is_on = False
        super().__init__(scene.body, behavior, through)
        scene.stages.append(self)

    async def _perform(self) -> None:
        first, last = ON_TARGET.get(type(self.behavior), ("", ""))
        try:
            async for progress in self._body.perform(self.behavior, self.authority):
                assert not isinstance(progress, Spoke)
                self.progress.append(progress)
                if progress.sync in (first, last):
                    self.scene.check(self.behavior, progress.sync)
                    self.is_on = progress.sync == first or isinstance(progress, Arrived)
        except BehaviorRefused:
            pass
        finally:
            self.is_on = False


async def test_eyes_stay_on_a_face_while_the_trunk_turns_and_leans(body: SimulatedBody) -> None:
    stage = Stage(body, Gaze(id="look", target="human"))
    await asyncio.sleep(1.0)
    leaning = asyncio.create_task(performed(body, PostureShift(id="lean", lexeme="FAR_LEFT")))
    async with recorded(body, ["torso_turn"]) as recording:
        off = []
        while not leaning.done():
            off.append(aside(body.state().gaze, (1.3, 0.0, 1.2)))
            await asyncio.sleep(STEP)

    assert np.ptp(recording.angles) == pytest.approx(math.radians(24))
    assert len(off) > 100
    assert max(off) < 1e-6
    stage.authority.revoke()
    await stage.over()


@pytest.mark.parametrize("since", [0.0, 0.1, 0.2])
async def test_a_look_comes_later_where_the_trunk_is_still_in_its_way(body: SimulatedBody, since: float) -> None:
    """Bent down it cannot see a face. It gets up; the look says that it has come when it has, as was estimated."""
    await performed(body, PostureShift(id="down", lexeme="DEEP"))
    look = Gaze(id="look", target="human")
    assert not body.estimate(look, None, WORLD).feasible
    rising = asyncio.create_task(performed(body, PostureShift(id="up", lexeme="UPRIGHT")))
    await asyncio.sleep(since)
    told = {phase.to: phase.natural for phase in body.estimate(look, None, WORLD).phases}
    scene, began = Scene(body), asyncio.get_running_loop().time()
    stage = WatchedStage(scene, look, "end")
    await stage.over()
    await rising

    at = times(stage.progress)
    standing = SimulatedBody()
    assert scene.lies == []
    assert scene.checks == 2
    assert at["stroke"] - began == pytest.approx(told["stroke"])
    natural = {phase.to: phase.natural for phase in standing.estimate(look, None, WORLD).phases}
    assert told["stroke"] > natural["stroke"] + 0.1


async def test_a_look_whose_target_the_trunk_has_taken_out_of_reach_fails(body: SimulatedBody) -> None:
    stage = Stage(body, Gaze(id="look", target="human"))
    await asyncio.sleep(1.0)
    await performed(body, PostureShift(id="down", lexeme="DEEP"))
    stage.authority.extend("end")

    with pytest.raises(BodyFailed, match="out of reach"):
        await stage.over()
    assert stage.waits_at == ["stroke"]
    assert "stroke" not in stage.passed


async def test_estimated_degrees_are_those_that_the_head_then_turns(body: SimulatedBody) -> None:
    """The trunk turns towards what is looked at: the neck turns less than it would alone."""
    look = Gaze(id="look", target="near-right")
    alone = body.estimate(look, None, WORLD)
    turning = asyncio.create_task(performed(body, Posture(id="turn", lexeme="TURN_RIGHT")))
    await asyncio.sleep(0.3)
    estimate = body.estimate(look, None, WORLD)
    stage = Stage(body, look)
    async with recorded(body, ["neck_yaw", "neck_pitch"]) as recording:
        for _ in range(250):
            if stage.waits_at:
                break
            await asyncio.sleep(STEP)
    stage.authority.extend("end")
    await asyncio.gather(turning, stage.over())

    turned = math.degrees(float(np.abs(np.diff(recording.angles, axis=0)).sum()))
    assert estimate.head_degrees == pytest.approx(turned, rel=0.05)
    assert estimate.head_degrees < 0.9 * alone.head_degrees


@pytest.mark.parametrize("leaning", [Posture(id="lean", lexeme="TURN_LEFT"), PostureShift(id="lean", lexeme="BOW")])
@pytest.mark.parametrize("since", [0.1, 0.5, 0.8])
async def test_a_plan_is_performed_as_it_was_rehearsed(
    body: SimulatedBody, leaning: BlockBehavior, since: float
) -> None:
    """The torso sets out after, with or before a look and an arm, which go home while it moves, or once it has."""
    begins = [
        (Gaze(id="look", target="human"), 0.0),
        (Pointing(id="point", target="far-left", mode="LEFT_HAND"), 0.3),
        (Gaze(id="next", target="near-right"), 1.2),
        (leaning, since),
    ]
    begins.sort(key=lambda each: each[1])
    items = [EstimateItem(behavior=each, times=(PlannedTime(sync="start", at=at),)) for each, at in begins]
    told = {each.behavior: each.phases for each in body.rehearse(items, WORLD)}
    began = asyncio.get_running_loop().time()
    stages = {}
    for behavior, at in begins:
        await asyncio.sleep(began + at - asyncio.get_running_loop().time())
        stages[behavior.id] = Stage(body, behavior, "end")
    for stage in stages.values():
        await stage.over()

    for id in ("look", "point", "next", "lean"):
        at = times(stages[id].progress)
        taken = [at[phase.to] - at[phase.since] for phase in told[id]]
        assert taken == pytest.approx([phase.natural for phase in told[id]], abs=1e-3), id


@pytest.mark.parametrize("seed", range(share_of(24)))
async def test_what_is_on_target_says_so_and_stays_there_whatever_the_trunk_does(
    body: SimulatedBody, seed: int
) -> None:
    """Begin, extend, hold, release and abort looks, shifts, pointings and postures at random."""
    chance, scene = Random(f"trunk {seed}"), Scene(body)
    async with recorded(body) as recording:
        watching = asyncio.create_task(scene.watch())
        for number in range(30):
            await asyncio.sleep(chance.choice((0.0, chance.uniform(0.0, 0.5), chance.uniform(0.0, 1.5))))
            live = [each for each in scene.stages if not each.task.done()]
            act = chance.choice(("begin", "lean", "extend", "hold", "go on", "abort")) if live else "begin"
            if act in ("begin", "lean"):
                behavior = chance.choice(AIMED if act == "begin" else LEANING)(f"{number}", chance)
                WatchedStage(scene, behavior, chance.choice(("start", "end", *sync_points(behavior))))
                continue
            one = chance.choice(live).authority
            match act:
                case "extend":
                    one.extend(chance.choice(one.points))
                case "hold":
                    one.hold()
                case "go on":
                    one.go_on()
                case "abort":
                    one.revoke(chance.choice(("relax", "freeze")))
        for stage in scene.stages:
            stage.authority.go_on()
            stage.authority.extend("end")
        for stage in scene.stages:
            await stage.over()
        watching.cancel()

    assert scene.lies == []
    assert scene.checks > 20
    assert violations(recording, body.capabilities.joints) == []


@pytest.mark.parametrize("seed", range(share_of(16)))
async def test_no_joint_leaves_its_limits_in_a_hurry_while_the_trunk_moves(body: SimulatedBody, seed: int) -> None:
    """Looks, pointings and nods that are to be quicker than by themselves, while the trunk leans to and fro."""
    chance, stages = Random(f"hurry {seed}"), []
    loop = asyncio.get_running_loop()
    async with recorded(body) as recording:
        for number in range(16):
            for kinds in (LEANING, AIMED, NODDING)[chance.randrange(2) :]:
                stage = Stage(body, chance.choice(kinds)(f"{len(kinds)}-{number}", chance), "end")
                sync = chance.choice(stage.authority.points[1:])
                stage.authority.set_pace({sync: loop.time() + chance.uniform(0.1, 1.0)})
                stages.append(stage)
                await asyncio.sleep(chance.uniform(0.0, 0.4))
            await asyncio.sleep(chance.uniform(0.0, 1.0))
        await asyncio.gather(*(stage.task for stage in stages), return_exceptions=True)

    assert violations(recording, body.capabilities.joints) == []
