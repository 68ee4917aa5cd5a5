"""What the realizer says about a block while it runs, in the words of the block's dialect."""

from schemas import keys
from schemas.feedback import (
    BlockProgress,
    Feedback,
    PlannedPoint,
    PredictionFeedback,
    SyncPointProgress,
    WarningFeedback,
    WarningKind,
)
from schemas.syncref import dialect_sync
from schemas.units import Seconds
from services.bus import Bus
from services.realizer.authority import Authority
from services.realizer.planner import Plan
from services.realizer.points import Point, type_of


class Reporter:
    """The feedback of one block."""

    def __init__(self, bus: Bus, block: str) -> None:
        self._bus = bus
        self._block = block

    def started(self, plan: Plan, began: Seconds) -> None:
        self._say(BlockProgress(block=self._block, progress="start", at=self._bus.stamp(began)))
        points = [
            PlannedPoint(behavior=point.behavior, sync=sync, time=plan.predicted(point))
            for chain in plan.chains.values()
            for point in chain.points
            if (sync := dialect_sync(point.sync, type_of(chain.behavior), plan.block.dialect)) is not None
        ]
        self._say(PredictionFeedback(block=self._block, points=tuple(points)))

    def reached(
        self, first_plan: Plan, authority: Authority, point: Point, *, arrived: Seconds | None, by_body: bool
    ) -> Seconds:
        """Report a point; returns how much later it was than the first of its instant.

        first_plan: the one the block began with, which said when the point was to be.
        """
        plan, at = authority.plan, authority.reached[point]
        together = (authority.reached.get(member.point) for member in plan.members[plan.at[point]])
        skew = at - min(time for time in (*together, at) if time is not None)
        sync = dialect_sync(point.sync, type_of(plan.chains[point.behavior].behavior), plan.block.dialect)
        if sync is not None:
            self._say(
                SyncPointProgress(
                    block=self._block,
                    behavior=point.behavior,
                    sync=sync,
                    at=self._bus.stamp(at),
                    time=at - authority.began,
                    predicted=first_plan.predicted(point),
                    arrived=None if arrived is None or arrived == at else arrived - authority.began,
                    skew=skew,
                    source="body" if by_body else "clock",
                )
            )
        return skew

    def warn(self, kind: WarningKind, message: str, behavior: str = "") -> None:
        self._say(WarningFeedback(block=self._block, kind=kind, message=message, behavior=behavior))

    def ended(self, status: str, began: Seconds) -> None:
        now = self._bus.now()
        progress = BlockProgress(
            block=self._block,
            progress="end",
            at=self._bus.stamp(now),
            time=now - began,
            status=status,  # type: ignore[arg-type]
        )
        self._say(progress)

    def _say(self, feedback: Feedback) -> None:
        self._bus.publish(keys.FEEDBACK, feedback)
