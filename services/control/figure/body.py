"""A body that is a figure: all that a torso does, whether formulas or motors move its joints.

The position that the plan has for each part at an instant is a formula (`tracks`, `motion`); a behavior's task only
sleeps until its next sync point, or until its authority changes. So a part needs no task to go home: it is given its
path once. A driver on it says where the joints are, and what faults there are.
"""

from collections.abc import AsyncGenerator, Iterable, Mapping, Sequence
from contextlib import aclosing
from math import inf, radians

from engage_hri.schemas.behaviors import BlockBehavior, Speech, Wait
from engage_hri.schemas.body import BodyPose, Capabilities, Estimate, EstimateItem, NoPointZone, Ray
from engage_hri.schemas.body_faults import BodyFault, refuse
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.references import type_name
from engage_hri.schemas.units import Radians
from engage_hri.schemas.world import World
from engage_hri.services.control.bases.walk import WalkingBody
from engage_hri.services.control.config import Variability
from engage_hri.services.control.contract import variability
from engage_hri.services.control.contract.body import (
    BehaviorRefused,
    BodyFailed,
    BodyState,
    Idle,
    MouthShape,
    MovementAuthority,
    Progress,
    Reached,
    Seen,
)
from engage_hri.services.control.contract.refusals import Impossible
from engage_hri.services.control.contract.variability import Deviations
from engage_hri.services.control.figure import choreography, kinematics, tracks
from engage_hri.services.control.figure.alive import Alive, Mouth
from engage_hri.services.control.figure.estimates import beneath_a_look, wait_estimate
from engage_hri.services.control.figure.rehearsal import ClockOfCopy, beside, rehearsed
from engage_hri.services.control.figure.repertoire import Repertoire
from engage_hri.services.control.figure.runs import Run
from engage_hri.services.control.figure.torso import Torso
from engage_hri.services.control.motion.motion import is_shift
from engage_hri.services.control.voice.speaker import Voice, speech_estimate
from engage_hri.services.control.voice.speaking import speak
from engage_hri.services.control.voice.timeline import uttered
from engage_hri.services.runtime.steps import Steps, finished

ELEMENTS = 256
"""Elements that an estimate with a path counts for (see `steps`)."""


class FigureBody(WalkingBody[Run]):
    """A torso with a voice. Without a driver that measures them, its joints are where the plan has them."""

    carries = kinematics.CARRIES
    moves: Torso

    def __init__(
        self, name: str, faults: tuple[str, ...], zones: tuple[NoPointZone, ...], deviations: Variability | None,
        repertoire: Repertoire, *, alive: bool,
    ) -> None:  # fmt: skip
        """Make a torso at rest, in a running event loop. faults: kinds that it can play. Raises InputRefused.

        deviations: with which it begins. alive: it blinks and breathes.
        """
        super().__init__()
        self.capabilities = Capabilities(
            body=name, types=tuple(map(type_name, choreography.TYPES)), parts=(*kinematics.PARTS, "voice"),
            joints=kinematics.JOINTS, reach=kinematics.REACH, no_point_zones=zones, faults=faults,
        )  # fmt: skip
        self._deviations = variability.configured(deviations or Variability())
        refuse(self._deviations.faults, self.capabilities, "control.variability")
        self.moves = Torso(self._loop, zones, repertoire, _displaced(self._deviations.faults))
        self._voice = Voice(is_mute=bool(self._deviations.of("mute")))
        self._occasions = 0
        self._alive = Alive(self._deviations.seed, self._loop.time()) if alive else None
        self._mouth = Mouth()
        self.on_lips = self.move_lips
        self._offsets: dict[str, float] = {}
        """Radians by which the true angle of a joint is more than what it measures, as its calibration says."""

    # -- what a driver measures ---------------------------------------------------------------------------------

    def planned(self) -> dict[str, Radians]:
        """Tell the angle of each joint by its plan now."""
        return tracks.pose_at(self.moves.tracks, self._loop.time())

    def measured(self) -> dict[str, Radians]:
        """Tell the measured angle of each joint now."""
        return self.planned()

    def beside(self) -> Mapping[str, Radians]:
        """Tell by how much true angles are more than measured ones, of joints of which they are not the same."""
        return {}

    def are_moving(self, names: Iterable[str]) -> bool:
        """True if any of these tracks moves."""
        now = self._loop.time()
        return any(self.moves.tracks[name].is_moving(now) for name in names)

    def looking_at(self) -> str:
        """Id of the entity on which the eyes rest; empty: none."""
        return self.moves.attention.fixated(self._loop.time())

    # -- the contract -------------------------------------------------------------------------------------------

    def estimate(self, behavior: BlockBehavior, pose: BodyPose | None, world: World) -> Estimate:
        return self._estimate(self.moves, behavior, pose, world)

    def _estimate(
        self, torso: Torso, behavior: BlockBehavior, pose: BodyPose | None, world: World, only: str = ""
    ) -> Estimate:
        match behavior:
            case Speech() if self._deviations.of("voiceless"):
                return Impossible("CANNOT_CREATE_BEHAVIOR", "the voice cannot speak").estimate(behavior)
            case Speech():
                return speech_estimate(behavior, uttered(behavior), torso.pose(world, pose))
            case Wait(duration=duration):
                return wait_estimate(behavior, duration or 0.0, torso.pose(world, pose))
        estimate = torso.estimate(behavior, pose, world, only)
        is_beneath = pose is None and is_shift(behavior) and torso.is_overlaid()
        return beneath_a_look(estimate) if is_beneath else estimate

    def rehearse(
        self, items: Sequence[EstimateItem], world: World, others: Sequence[EstimateItem] = ()
    ) -> Sequence[Estimate]:
        return finished(self._rehearsed(items, world, others))

    def rehearse_in_steps(
        self, items: Sequence[EstimateItem], world: World, others: Sequence[EstimateItem] = ()
    ) -> Steps[Sequence[Estimate]]:
        if type(self).rehearse is not FigureBody.rehearse:  # what a subclass says counts
            return self.rehearse(items, world, others)
        return (yield from self._rehearsed(items, world, others))

    def _rehearsed(
        self, items: Sequence[EstimateItem], world: World, others: Sequence[EstimateItem]
    ) -> Steps[Sequence[Estimate]]:
        """Estimate all as of now, whatever happens between the steps."""
        clock, told = ClockOfCopy(self._loop.time()), dict[int, Estimate]()
        still, is_mine = beside(self.moves, clock, world), type(self).estimate is FigureBody.estimate
        moving = [item for item in items if item.times] if not self.moves.misbelieved else []
        if moving:
            going = ClockOfCopy(clock.at)
            copy = beside(self.moves, going, world)
            told |= zip(map(id, moving), (yield from rehearsed(copy, going, moving, others)), strict=True)
        for item in items:
            if id(item) not in told:
                asked = (item.behavior, item.pose, world)
                told[id(item)] = self._estimate(still, *asked, item.only) if is_mine else self.estimate(*asked)
                yield ELEMENTS
        return [told[id(item)] for item in items]

    def perform(self, behavior: BlockBehavior, authority: MovementAuthority) -> AsyncGenerator[Progress, None]:
        if isinstance(behavior, Speech):
            return self._speak(behavior, authority)
        return super().perform(behavior, authority)

    async def home(self, parts: tuple[str, ...] = ()) -> None:
        if not parts or "voice" in parts:
            self._voice.hush()
        await super().home(parts)

    def state(self) -> BodyState:
        pose = self.measured()
        return BodyState(
            pose=kinematics.pose_message(pose), gaze=kinematics.gaze(pose),
            left_arm=kinematics.arm(pose, "left"), right_arm=kinematics.arm(pose, "right"),
            moving=self._voice.is_busy or self.are_moving(tracks.LIMITS), looking_at=self.looking_at(),
            speaking=self._voice.saying,
        )  # fmt: skip

    def see(self, world: World) -> None:
        self.moves.world = world
        self.moves.follow()

    # -- what it does not measure -------------------------------------------------------------------------------

    def seen(self) -> Seen | None:
        told, by = self.measured(), self.beside()
        if not by:
            return None
        angles = {joint: angle + by.get(joint, 0.0) for joint, angle in told.items()}
        arms = kinematics.arm(angles, "left"), kinematics.arm(angles, "right")
        return Seen(gaze=kinematics.gaze(angles), left_arm=arms[0], right_arm=arms[1])

    def ray_at(self, part: str, pose: BodyPose) -> Ray | None:
        angles = tracks.updated(kinematics.HOME, pose)
        rays = {
            "head": kinematics.gaze(angles), "left_arm": kinematics.arm(angles, "left"),
            "right_arm": kinematics.arm(angles, "right"),
        }  # fmt: skip
        return rays.get(part)

    def calibrate(self, offsets: Mapping[str, Radians]) -> None:
        if unknown := [joint for joint in offsets if kinematics.LIMIT.get(joint) is None]:
            reason, advice = f"no joint {', '.join(unknown)}", f"its joints are {', '.join(kinematics.LIMIT)}"
            raise InputRefused(Fault(reason=reason, where="control.calibration", advice=advice, service="control"))
        self._offsets = dict(offsets)

    # -- what belongs to no behavior ----------------------------------------------------------------------------

    def idle(self) -> Idle:
        """Tell of lips with the voice, and of a torso that is alive what it does where nothing else is done."""
        now, alive = self._loop.time(), self._alive
        face = self.moves.tracks["face"]
        expression = dict(zip(face.joints, face.angles(now), strict=True))
        added = self._mouth.added(now, expression)
        quick_at = now if self._mouth.is_moving(now) else inf
        if alive is None:
            return Idle(added=added, quick_at=quick_at)
        busy = {part for part, track in self.moves.tracks.items() if track.is_moving(now)} | {*self.moves.runs}
        by_itself = alive.added(now, expression, face_rests="face" not in busy, body_rests=not busy - {"face"})
        added = {joint: added.get(joint, 0.0) + by_itself.get(joint, 0.0) for joint in (*added, *by_itself)}
        return Idle(added=added, quick_at=min(quick_at, alive.quick_at(now)))

    def move_lips(self, shapes: Sequence[MouthShape]) -> None:
        self._mouth.move(shapes, self._loop.time())

    # -- faults -------------------------------------------------------------------------------------------------

    @property
    def faults(self) -> tuple[BodyFault, ...]:
        return self._deviations.faults

    def switch_faults(self, faults: Sequence[BodyFault]) -> None:
        on, displaced = _displaced(self.faults), _displaced(faults)
        if reason := self.moves.objection_to(on, displaced):
            raise InputRefused(Fault(reason=reason, where="displaced", service="control"))
        self._deviations = Deviations(self._deviations.seed, tuple(faults))
        self.moves.displace(on, displaced)
        self.moves.deviate(self._deviations)
        self._voice.is_mute = bool(self._deviations.of("mute"))
        if self._deviations.of("voiceless"):
            self._voice.hush()

    # -- motion -------------------------------------------------------------------------------------------------

    def set_out(self, behavior: BlockBehavior, authority: MovementAuthority) -> Run:
        course = choreography.plan(behavior, self.moves.situation(self.moves.world, real=True))
        run = self.moves.set_out(Run(behavior, course, authority, self._deviations, self._occasions + 1))
        self._occasions += not run.is_beneath
        return run

    def confirm(self, run: Run, sync: str) -> None:
        if self.moves.is_off_target(run, sync):
            raise BodyFailed(fault(run.behavior, "its target is out of reach where the torso is now"))

    def is_behind(self, run: Run) -> bool:
        return self.moves.is_behind(run)

    # -- voice --------------------------------------------------------------------------------------------------

    async def _speak(self, behavior: Speech, authority: MovementAuthority) -> AsyncGenerator[Progress, None]:
        await self._voice.wait_for_silence(authority)
        if authority.revoked is not None:
            return
        if self._deviations.of("voiceless"):
            raise BehaviorRefused(fault(behavior, "the voice cannot speak"))
        self._occasions += 1
        pace = 1.0 / variability.rate(self._deviations, ("voice",), behavior.id, self._occasions)
        words = speak(behavior, authority, pace, self.on_lips)
        async with aclosing(self._voice.say(behavior, authority, words)) as utterance:
            async for progress in utterance:
                yield progress
                if isinstance(progress, Reached) and progress.sync == "end":
                    return
        if self._deviations.of("voiceless"):
            raise BodyFailed(fault(behavior, "the voice cannot speak"))


def _displaced(faults: Sequence[BodyFault]) -> dict[str, float]:
    return {fault.part: radians(fault.amount or 0.0) for fault in faults if fault.kind == "displaced"}


def fault(behavior: BlockBehavior, reason: str) -> Fault:
    """Describe why a behavior cannot be done, or go on."""
    return Fault(reason=reason, where=behavior.id, service="control")
