"""Parts of a described robot, each an ordinary body of one part: where it looks or points, by inverse kinematics."""

import math
from collections.abc import Awaitable, Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial

from msgspec.structs import replace

from engage_hri.schemas.behaviors import BlockBehavior, Head, Pointing
from engage_hri.schemas.body import BodyPose, Estimate, JointLimit, Ray
from engage_hri.schemas.references import type_name
from engage_hri.schemas.units import Meters, Radians, Seconds, Vector
from engage_hri.schemas.world import World
from engage_hri.services.control.bases.one_part_motion import OrdinaryBody, Way, refused
from engage_hri.services.control.contract.body import (
    BehaviorRefused,
    Bell,
    BodyState,
    Seen,
)
from engage_hri.services.control.figure.kinematics import HAND_TO_TARGET, TABLE_TOP
from engage_hri.services.control.mujoco.ik import ON_AXIS, Chain, Solution
from engage_hri.services.control.mujoco.stage import Angles, DescribedStage
from engage_hri.services.runtime.steps import Steps, finished

NODS: Mapping[str, tuple[Radians, Radians]] = {
    "NOD": (0.0, -math.radians(10.0)), "SHAKE": (math.radians(10.0), 0.0), "TILT": (0.0, math.radians(5.0)),
}  # fmt: skip
"""Yaw and pitch of the first stroke of a movement of the head."""
SHARES = (1.0, -1.0, 0.5, -0.5)
"""Of these, in this order: near the end of its range a neck nods the other way, or less."""
OVER_THE_TABLE: Meters = 0.05
"""Height over the table that elbow and hand keep: a forearm is that thick."""
ABOVE: Meters = 0.15
"""Height over the target at which an arm that is ready points."""
KEPT = 2000
"""Solutions that a part keeps, the last ones."""


class _Unsolved(Exception):
    """An aim that nobody has solved yet. steps: begins to solve it."""

    def __init__(self, key: tuple[object, ...], steps: Callable[[], Steps[Solution]]) -> None:
        super().__init__()
        self.key, self.steps = key, steps


class Limb(OrdinaryBody):
    """A part of a described robot. chain: its joints, with the axis that they move."""

    near = math.radians(0.5)
    rate = 200.0
    settling = 0.02
    speed = 0.9
    acceleration = 0.5

    def __init__(
        self,
        stage: DescribedStage,
        part: str,
        joints: Sequence[JointLimit],
        chain: Chain,
        types: Sequence[str],
        name: str,
    ) -> None:
        self.part, self.joints, self.types, self.name = part, tuple(joints), tuple(types), name  # type: ignore[misc]
        self.rest = {limit.joint: stage.home[limit.joint] for limit in joints}  # type: ignore[misc]
        super().__init__()
        self.stage, self.chain = stage, chain
        self._is_open = True
        self._solved: dict[tuple[object, ...], Solution] = {}
        self._is_ahead = False
        """True while it looks for what is not solved yet."""

    def angles(self) -> Angles:
        return self.stage.angles(self.part)

    def go(self, goal: Angles, seconds: Seconds) -> None:
        self.stage.go(self.part, goal, seconds)

    def suspicion(self, joint: str, *, is_other_way: bool) -> str:
        return self.stage.suspicion(joint) or super().suspicion(joint, is_other_way=is_other_way)

    async def home(self, parts: tuple[str, ...] = ()) -> None:
        await super().home(parts)
        bell = Bell()
        while (not parts or self.part in parts) and self.stage.is_moving(self.part):
            await bell.wait(bell.now() + 1.0 / self.rate)

    def state(self) -> BodyState:
        state = super().state()
        return replace(state, moving=state.moving or self.stage.is_moving(self.part))

    def seen(self) -> Seen | None:
        self.stage.pulse.step()
        if self.stage.physics.beside.keys().isdisjoint(self.chain.joints):
            return None
        ray = self.chain.ray(self.stage.physics.data.qpos)
        return Seen(gaze=ray) if self.part == "head" else Seen(**{self.part: ray})

    def ray_at(self, part: str, pose: BodyPose) -> Ray | None:
        angles = {each.joint: each.angle for each in pose.joints if each.joint in self.chain.joints}
        return self.axis({**self.rest, **angles}) if part == self.part else None

    def calibrate(self, offsets: Mapping[str, Radians]) -> None:
        self.stage.calibrate({joint: offsets.get(joint, 0.0) for joint in self.chain.joints})

    def axis(self, angles: Angles) -> Ray:
        """The axis of eyes or forearm at these angles, all other joints as they are."""
        return self.chain.ray(self.stage.physics.told(), angles)

    def prepare(self, behaviors: Sequence[BlockBehavior]) -> Awaitable[None] | None:
        """Solve what estimates and motions of these behaviors will ask for, a slice at a time."""
        steps = self._ahead([each for each in behaviors if type_name(each) in self.types])
        return None if next(steps, None) is None else self.stage.pulse.in_turns(steps)

    def _ahead(self, behaviors: Sequence[BlockBehavior]) -> Steps[None]:
        for behavior in behaviors:
            while (aim := self._unsolved(behavior)) is not None:
                self._keep(aim, (yield from aim.steps()))

    def _unsolved(self, behavior: BlockBehavior) -> "_Unsolved | None":
        """The next aim of a behavior that is not solved; None: all are, or it cannot be done."""
        self._is_ahead = True
        try:
            self.way(behavior, self.moves.world)
        except _Unsolved as aim:
            return aim
        except BehaviorRefused:
            return None
        finally:
            self._is_ahead = False
        return None

    def solved(
        self, target: Vector, preferred: Angles, floor: Meters = -math.inf, distance: Meters = 0.0
    ) -> Solution:
        """Angles on a target, as near to the preferred ones as they can be. floor, distance: as for `Chain.aim`."""
        key = (target, *preferred.values(), floor, distance)
        if (found := self._solved.get(key)) is None:
            qpos = self.stage.safe_qpos
            aim = _Unsolved(key, partial(self.chain.aiming, qpos, target, preferred, floor=floor, distance=distance))
            if self._is_ahead:
                raise aim
            self._keep(aim, found := finished(aim.steps()))
        return found

    def _keep(self, aim: "_Unsolved", found: Solution) -> None:
        while len(self._solved) >= KEPT:
            del self._solved[next(iter(self._solved))]
        self._solved[aim.key] = found

    def solve(
        self, behavior: BlockBehavior, target: Vector, floor: Meters = -math.inf, distance: Meters = 0.0
    ) -> Angles:
        """Angles on a target, each time a mapping of their own. Raises BehaviorRefused: it finds none."""
        found = self.solved(target, self.moves.home, floor, distance)
        if found.low > 2e-3:
            raise refused(behavior, f"the {self.part} finds no way to it: the table is in the way, or it is too near")
        if found.off > ON_AXIS:
            off = math.degrees(found.off)
            raise refused(behavior, f"the {self.part} comes no nearer than {off:.1f} degrees to it")
        return dict(found.angles)


class HeadLimb(Limb):
    """A head: it looks, and nods."""

    near = math.radians(0.3)

    def aim(self, behavior: BlockBehavior, world: World) -> Angles:
        return self.solve(behavior, self.position(behavior, world))

    def way(self, behavior: BlockBehavior, world: World) -> Way:
        if not isinstance(behavior, Head):
            return super().way(behavior, world)
        turn = NODS.get(behavior.lexeme.upper())
        if turn is None:
            raise refused(behavior, f"this head has no {behavior.lexeme!r}: it has {', '.join(NODS)}")
        for share in SHARES[:-1]:
            with suppress(BehaviorRefused):
                return self._nod(behavior, turn, share)
        return self._nod(behavior, turn, SHARES[-1])

    def _nod(self, behavior: BlockBehavior, turn: tuple[Radians, Radians], share: float) -> Way:
        return [
            ("stroke", self._beside(behavior, *(share * each for each in turn))),
            ("stroke_end", self._beside(behavior, *(-0.4 * share * each for each in turn))),
        ]

    def estimate(self, behavior: BlockBehavior, pose: BodyPose | None, world: World) -> Estimate:
        estimate = super().estimate(behavior, pose, world)
        if estimate.feasible and isinstance(behavior, Head) and (behavior.repetition or 1) > 1:
            return replace(
                estimate, degraded=f"this body does not repeat a {behavior.lexeme!r}; it makes one, the nearest"
            )
        return estimate

    def gaze(self, angles: Angles) -> Ray:
        return self.axis(angles)

    def _beside(self, behavior: BlockBehavior, yaw: Radians, pitch: Radians) -> Angles:
        """Angles at which the eyes look beside where they belong."""
        base = self.axis(self.moves.goal)
        x, y, z = base.axis
        heading, height = math.atan2(y, x) + yaw, math.asin(max(-1.0, min(1.0, z))) + pitch
        axis = (math.cos(height) * math.cos(heading), math.cos(height) * math.sin(heading), math.sin(height))
        eyes = base.origin
        return self.solve(behavior, (eyes[0] + 2 * axis[0], eyes[1] + 2 * axis[1], eyes[2] + 2 * axis[2]))


class ArmLimb(Limb):
    """An arm: it points with its forearm."""

    @property
    def points_at(self) -> str:
        """Id of what it points at now; empty: nothing."""
        run = self.moves.runs.get(self.part)
        is_on = run is not None and run.awaits("stroke_end") and not run.awaits("stroke")
        return getattr(run.behavior, "target", "") if run is not None and is_on else ""

    def aim(self, behavior: BlockBehavior, world: World) -> Angles:
        target = self.position(behavior, world)
        entity = world.entity(getattr(behavior, "target", ""))
        if isinstance(behavior, Pointing) and behavior.mode not in (
            None,
            "",
            f"{self.part.removesuffix('_arm').upper()}_HAND",
        ):
            raise refused(behavior, f"it is to be done with {behavior.mode!r}")
        if (away := math.dist(self.axis(self.rest).origin, target)) > self.reach:
            raise refused(behavior, f"it is {away:.2f} m away, farther than its reach of {self.reach:g} m")
        distance = HAND_TO_TARGET + (entity.radius if entity is not None else 0.0)
        return self.solve(behavior, target, floor=TABLE_TOP + OVER_THE_TABLE, distance=distance)

    def way(self, behavior: BlockBehavior, world: World) -> Way:
        aim = self.aim(behavior, world)
        x, y, z = self.position(behavior, world)
        floor = TABLE_TOP + OVER_THE_TABLE + 0.03
        above = self.solved((x, y, z + ABOVE), aim, floor=floor)
        return [("ready", above.angles), ("stroke", aim), ("stroke_end", aim)]

    def forearm(self, angles: Angles) -> Ray:
        return self.axis(angles)
