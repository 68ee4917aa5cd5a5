"""The simulated body: a figure whose joints are where the plan has them, but for scripted faults, which it words."""

from collections.abc import Mapping
from math import inf, radians
from typing import Self

from engage_hri.schemas.body import NoPointZone
from engage_hri.schemas.body_faults import KINDS
from engage_hri.schemas.units import Radians, Seconds
from engage_hri.services.control.config import ControlConfig, Variability
from engage_hri.services.control.contract.body import BodyFailed
from engage_hri.services.control.figure import kinematics
from engage_hri.services.control.figure.body import FigureBody, fault
from engage_hri.services.control.figure.repertoire import BUILT_IN, Repertoire, repertoire_of
from engage_hri.services.control.figure.runs import OVERHEAT, STALL, Run
from engage_hri.services.control.motion.motion import WalkPoint


class SimulatedBody(FigureBody):
    """A simulated torso with a voice. Behaviors take as long as `estimate` says, but for its faults."""

    def __init__(
        self,
        zones: tuple[NoPointZone, ...] = (),
        deviations: Variability | None = None,
        repertoire: Repertoire = BUILT_IN,
        *,
        alive: bool = False,
    ) -> None:
        """Make a torso at rest, in a running event loop. alive: it blinks and breathes. Raises InputRefused."""
        super().__init__("simulated", tuple(KINDS), zones, deviations, repertoire, alive=alive)

    @classmethod
    def configured(cls, config: ControlConfig, settings: None) -> Self:
        """Make a torso with the zones, deviations and repertoire of the section `control`. Raises InputRefused."""
        return cls(config.no_point_zones, config.variability, repertoire_of(config), alive=config.alive)

    async def come(self, run: Run, point: WalkPoint, due: Seconds) -> Seconds | None:
        if point.is_told:
            return due
        if point.sync == OVERHEAT:
            raise BodyFailed(fault(run.behavior, f"the motor of the {run.course.parts[0]} is overheated"))
        stall = run.faults[STALL]
        until = inf if stall is None or stall.amount is None else self._loop.time() + stall.amount
        while not run.is_over and point in run.pending and not run.bell.is_past(until):
            await run.bell.wait(until)
        run.pending = [each for each in run.pending if each is not point]
        return None

    def beside(self) -> Mapping[str, Radians]:
        by = {joint: -offset for joint, offset in self._offsets.items()}
        for each, amount in self._deviations.of("miscalibrated"):
            for joint in [limit.joint for limit in kinematics.JOINTS if each.part in ("", limit.part, limit.joint)]:
                if kinematics.LIMIT[joint].part != "face":
                    by[joint] = by.get(joint, 0.0) + radians(amount)
        return {joint: angle for joint, angle in by.items() if angle}
