"""The torso with physics: a figure that moves along its plans as far as its motors can.

The plan of each part is that of `control.figure`; servos follow it, in MuJoCo. A sync point is reported once the plan
has come there *and the measured joints are there*. The plan waits for joints that lag, and a behavior whose joints
make no way any more fails with the name of the joint. The face is a screen: it is where its plan has it.
"""

import math
from collections import defaultdict
from collections.abc import AsyncGenerator, AsyncIterator, Collection, Iterable, Mapping, Sequence
from contextlib import aclosing, asynccontextmanager
from math import inf
from pathlib import Path

from msgspec.structs import replace

from engage_hri.schemas.behaviors import BlockBehavior, Pointing
from engage_hri.schemas.body import NoPointZone
from engage_hri.schemas.body_faults import BodyFault, refuse
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.units import Radians, Seconds
from engage_hri.schemas.world import World
from engage_hri.services.control.bases.walk import Off, Watch, farthest, nearest
from engage_hri.services.control.config import ControlConfig, Variability
from engage_hri.services.control.contract.body import Body, BodyFailed, Idle, MovementAuthority, Progress
from engage_hri.services.control.figure import tracks
from engage_hri.services.control.figure.body import FigureBody
from engage_hri.services.control.figure.repertoire import BUILT_IN, Repertoire, repertoire_of
from engage_hri.services.control.figure.runs import Run
from engage_hri.services.control.figure.tracks import PartTrack
from engage_hri.services.control.motion.motion import WalkPoint
from engage_hri.services.control.mujoco.described import DescribedBody
from engage_hri.services.control.mujoco.faults import KINDS, OURS, SHARED, told
from engage_hri.services.control.mujoco.film import Frame, filming, framed
from engage_hri.services.control.mujoco.pulse import TICK
from engage_hri.services.control.mujoco.settings import MujocoSettings
from engage_hri.services.control.mujoco.stage import Workbench, as_measured

NEAR: Mapping[str, Radians] = {
    "head": math.radians(0.6), "nod": math.radians(0.6), "torso": math.radians(0.8), "left_arm": math.radians(1.5),
    "right_arm": math.radians(1.5), "face": inf,
}  # fmt: skip
"""Radians by which a joint of a part may miss a sync point."""
LAG: Mapping[str, Radians] = {
    "head": math.radians(4.0), "nod": math.radians(4.0), "torso": math.radians(3.0), "left_arm": math.radians(6.0),
    "right_arm": math.radians(6.0), "face": inf,
}  # fmt: skip
"""Radians by which a joint of a part may lag behind its plan before the plan waits."""


class MujocoBody(FigureBody):
    """The figure as a physics model at a table. Estimates are of the healthy body."""

    Settings = MujocoSettings

    def __init__(
        self,
        zones: tuple[NoPointZone, ...] = (),
        deviations: Variability | None = None,
        repertoire: Repertoire = BUILT_IN,
        settings: MujocoSettings | None = None,
        *,
        alive: bool = False,
    ) -> None:
        """alive: its face, which is a screen, blinks and stirs.

        deviations: of these, joints that are displaced and a mute voice; motors deviate by `switch_faults`.

        Raises InputRefused: a deviation, a fault or a film that cannot be had.
        """
        super().__init__("mujoco", KINDS, zones, deviations, repertoire, alive=alive)
        self._settings = settings or MujocoSettings()
        joints = tuple(as_measured(each, 1.3, 4.0) for each in self.capabilities.joints)
        self.capabilities = replace(self.capabilities, joints=joints, fault_kinds=told(OURS))
        self.bench = Workbench(lambda now: tracks.pose_at(self.moves.tracks, now), self._look, self._settings.seed)
        self.pulse = self.bench.pulse
        self._watches: dict[Run, Watch] = {}
        self._awaiting: dict[Run, WalkPoint] = {}
        """The sync point that joints have not come to, though the plan has."""
        self._faults: tuple[BodyFault, ...] = ()
        """Faults that the physics plays; the others are those of the simulated torso."""
        self.switch_faults([*super().faults, *self._settings.faults])

    @classmethod
    def configured(cls, config: ControlConfig, settings: MujocoSettings | None) -> Body:  # type: ignore[override]
        """Make the torso, or the robot that the settings describe. Raises InputRefused."""
        settings = settings or MujocoSettings()
        if settings.robot:
            return DescribedBody(Path(settings.robot), settings)
        return cls(config.no_point_zones, config.variability, repertoire_of(config), settings, alive=config.alive)

    @asynccontextmanager
    async def connected(self) -> AsyncIterator[None]:
        async with super().connected(), filming(self.bench.model, self._settings, self.frame, self.pulse):
            yield

    def frame(self) -> Frame:
        """The body as a film shows it now."""
        runs = self.moves.runs
        pointing = {
            part: run.behavior.target
            for part, run in runs.items()
            if isinstance(run.behavior, Pointing) and run.awaits("stroke_end") and not run.awaits("stroke_start")
        }
        now, data = self._loop.time(), self.bench.physics.data
        return framed(now, data, self.state(), self.others_say(), self.moves.world, pointing, self._face())

    # -- the contract -------------------------------------------------------------------------------------------

    async def perform(self, behavior: BlockBehavior, authority: MovementAuthority) -> AsyncGenerator[Progress, None]:
        try:
            async with aclosing(super().perform(behavior, authority)) as stream:
                async for progress in stream:
                    self.pulse.wake()
                    yield progress
        finally:
            self.pulse.wake()

    async def home(self, parts: tuple[str, ...] = ()) -> None:
        self.pulse.step()
        self.pulse.wake()
        await super().home(parts)

    def coming_home(self, going: Collection[str], watches: defaultdict[str, Watch]) -> Seconds | None:
        if (until := super().coming_home(going, watches)) is not None:
            return until
        now, names = self._loop.time(), [name for name in tracks.LIMITS if name != "nod" and name in going]
        off = self._off_plan(names, now)
        if off.share <= 1.0 and not self.are_moving(names):
            return None
        watches["home"].see(off, now)
        if off.share > 1.0 and watches["home"].is_stuck:
            raise BodyFailed(self._stuck("home", watches["home"]))
        self.pulse.wake()
        return now + TICK

    def see(self, world: World) -> None:
        self.pulse.step()
        super().see(world)
        self.bench.room.lay(world)
        self.pulse.wake()

    # -- measurements -------------------------------------------------------------------------------------------

    def measured(self) -> dict[str, Radians]:
        """Tell the measured angle of each joint; of the face, where it is shown."""
        self.pulse.step()
        return {**self.planned(), **self.bench.measured}

    def beside(self) -> Mapping[str, Radians]:
        return self.bench.physics.beside

    def are_moving(self, names: Iterable[str]) -> bool:
        """True if these tracks move, by their plan or by what is measured."""
        joints, quick = {each for name in names for each in self.moves.tracks[name].joints}, self.bench.physics.quick
        return super().are_moving(names) or not quick.isdisjoint(joints)

    def looking_at(self) -> str:
        """Id of the entity on which the measured eyes rest, which are where the plan has them."""
        looked, now = super().looking_at(), self._loop.time()
        return looked if not looked or self._off_plan(("head", "torso"), now).share < 2.0 else ""

    def idle(self) -> Idle:
        """Tell what the screen shows by itself. No motor breathes: none of that would be in the physics."""
        idle = super().idle()
        shown = {joint: by for joint, by in idle.added.items() if joint not in self.bench.measured}
        return Idle(added=shown, quick_at=idle.quick_at)

    def _face(self) -> dict[str, float]:
        """The planned angle of each joint, and what the face does by itself: as a film shows it."""
        plan, added = self.planned(), self.idle().added
        return {joint: angle + added.get(joint, 0.0) for joint, angle in plan.items()}

    def calibrate(self, offsets: Mapping[str, Radians]) -> None:
        super().calibrate(offsets)
        self.bench.calibrate(offsets)

    # -- faults -------------------------------------------------------------------------------------------------

    @property
    def faults(self) -> tuple[BodyFault, ...]:
        return (*super().faults, *self._faults)

    def switch_faults(self, faults: Sequence[BodyFault]) -> None:
        ours = [fault for fault in faults if fault.kind not in SHARED]
        refuse(ours, self.capabilities)
        self.pulse.step()
        super().switch_faults([fault for fault in faults if fault.kind in SHARED])
        self._faults = tuple(ours)
        self.bench.suffer(ours)

    # -- steps --------------------------------------------------------------------------------------------------

    def _look(self, now: Seconds) -> bool:
        """Look at what has come of a step. True: everything is at rest."""
        for run in list(dict.fromkeys(self.moves.runs.values())):
            self._govern(run, now)
        for gone in [run for run in self._watches if not self.moves.owns(run)]:
            del self._watches[gone]
        is_planned = any(track.is_moving(now) for track in self.moves.tracks.values())
        return not (is_planned or self._watches) and self.bench.is_at_rest(now)

    # -- joints and plan ----------------------------------------------------------------------------------------

    def _govern(self, run: Run, now: Seconds) -> None:
        """Let the plan of a run wait while its joints lag, and go on when they have come along."""
        off = self._off_plan(run.course.parts, now, LAG)
        awaited = self._awaiting.get(run)
        watch = self._watches.get(run)
        if awaited is None and off.share < (1.0 if watch is None else 0.5):
            if watch is not None:
                del self._watches[run]
                run.gate = inf
                run.bell.ring()
            return
        if watch is None:
            watch = self._watches[run] = Watch()
        if run.gate == inf and not run.holding:
            self._stop(run, now)
        near = self._off_point(run, awaited, now) if awaited is not None else off
        watch.see(near, now)
        if watch.is_stuck or (awaited is not None and near.share <= 1.0):
            run.bell.ring()

    def _stop(self, run: Run, now: Seconds) -> None:
        """Stop the plan of a run where it can, before its next point but one."""
        motion = run.motion
        s, rate = motion.s(now), motion.rate(now)
        stop = s + rate * rate / (2 * motion.path.gentlest_brake)
        ahead = [motion.path.marks[point.sync] for point in run.pending[1:] if point.sync in motion.path.marks]
        if run in self._awaiting and ahead:
            stop = max(s, min(stop, ahead[0]))
        run.gate = stop
        motion.brake(now, min(stop, motion.limit))

    async def come(self, run: Run, point: WalkPoint, due: Seconds) -> Seconds | None:
        self.pulse.step()
        now = self._loop.time()
        if self.has_come(run, point):
            if self._awaiting.pop(run, None) is not None and run.gate < inf:
                run.gate = inf
                self._watches.pop(run, None)
                self.moves.extend(run)
            return max(due, now)
        self._awaiting[run] = point
        self.pulse.wake()
        await run.bell.wait(now + TICK)
        if run.is_over:
            self._awaiting.pop(run, None)
        return None

    def has_come(self, run: Run, point: WalkPoint) -> bool:
        return self._off_point(run, point, self._loop.time()).share <= 1.0

    def check(self, run: Run) -> None:
        watch = self._watches.get(run)
        if watch is not None and watch.is_stuck and not run.is_over:
            raise BodyFailed(self._stuck(run.behavior.id, watch))

    def _off(self, there: Mapping[str, Sequence[float]], now: Seconds, allowed: Mapping[str, float] = NEAR) -> Off:
        """The joint that is farthest off angles of these tracks; none is off if they have no motors."""
        rows = [
            (joint, self.bench.measured[joint] - self._others(track, now).get(joint, 0.0), angle, allowed[name])
            for name, angles in there.items()
            for track in [self.moves.tracks[name]]
            for joint, angle in zip(track.joints, angles, strict=True)
            if joint in self.bench.measured
        ]
        return farthest(rows) if rows else Off("", 0.0, 0.0, 0.0)

    def _off_plan(self, names: Iterable[str], now: Seconds, allowed: Mapping[str, float] = NEAR) -> Off:
        return self._off({name: self.moves.tracks[name].angles(now) for name in names}, now, allowed)

    def _off_point(self, run: Run, point: WalkPoint, now: Seconds) -> Off:
        """Measure how far the joints of a run are off a sync point, or off the nearest place behind it.

        A look that has waited and followed its target is to be where that has led it.
        """
        if run.holding and any(self.moves.tracks[name].motion is not run.motion for name in run.course.parts):
            return self._off_plan(run.course.parts, now)
        path, s = run.motion.path, run.motion.s(now)
        mark = path.marks.get(point.sync, s)
        later = [path.marks[each.sync] for each in run.pending if path.marks.get(each.sync, 0.0) > mark + 1e-9]
        if run.holding:
            mark = s  # Its target may have moved: it is there once the plan is, and the joints are where that is.
        return nearest(mark, max(mark, min([s, *later[:1]])), lambda place: self._off_at(run, place, now))

    def _off_at(self, run: Run, s: Seconds, now: Seconds) -> Off:
        """Measure how far the joints of a run are off a place on its path."""
        q, there = run.motion.path.at(s).q, {}
        for track in (self.moves.tracks[name] for name in run.course.parts):
            angles, q = q[: len(track.joints)], q[len(track.joints) :]
            if track.aim is not None and not track.is_still(now, track.aim):
                angles = track.aim.within(angles + track.aim.offset(track.trunk.angles(now)))
            there[track.name] = angles.tolist()
        return self._off(there, now)

    def _others(self, track: PartTrack, now: Seconds) -> dict[str, float]:
        """Angles that the other track of the head adds to the joints of this one."""
        if track.part != "head":
            return {}
        other = self.moves.tracks["nod" if track.name == "head" else "head"]
        return dict(zip(other.joints, other.angles(now), strict=True))

    def _stuck(self, where: str, watch: Watch) -> Fault:
        """Describe joints that do not come: which one, how far it is off, and what is known of its motor."""
        fault = watch.fault(where)
        known = self.bench.suspicion(watch.off.joint) if watch.off is not None else ""
        return replace(fault, reason=f"{fault.reason}: {known}") if known else fault
