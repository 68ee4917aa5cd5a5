"""Questions of generation to the body: its capabilities, and the costs of the motions that references need. Pure.

Each is a generator, which yields what it asks and is sent the answer; None is a pause, in which others may work.
"""

from collections.abc import Generator, Sequence
from typing import Any, TypeVar

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import BlockBehavior, Hand
from engage_hri.schemas.body import Capabilities, DescribeBody, Estimate, EstimateBehaviors, EstimateItem, Estimates
from engage_hri.schemas.faults import Fault, RunFailed
from engage_hri.services.generation.block.emission import FragmentPlan
from engage_hri.services.generation.exchange import Question
from engage_hri.services.generation.pipeline import Planning
from engage_hri.services.generation.references.motions import (
    Motions,
    distinct,
    from_here,
    from_here_told,
    last_motions,
    pose_after,
)
from engage_hri.services.runtime.steps import SLICE

T = TypeVar("T")
Asking = Generator[Question | None, Any, T]


class BodyLink:
    """Generation's knowledge of the body. capabilities: what it last said of itself; None: not asked yet."""

    def __init__(self) -> None:
        self.capabilities: Capabilities | None = None

    def forget(self) -> None:
        """Drop the capabilities of a body that is gone: another one may come."""
        self.capabilities = None

    def motions(
        self, sequence: Sequence[str], hand: Hand | None, moving: Sequence[BlockBehavior] = (), glance: str = ""
    ) -> Asking[Motions]:
        """Costs, rays and poses of a look and a point at each target of the `sequence`, from where the body is.

        hand: the only one allowed; None: either. moving: gazes and points under way, in order; they will be on target
        before the references begin. glance: see `Motions`.
        """
        if not sequence:
            return Motions({}, {})
        if self.capabilities is None:
            described = yield DescribeBody()
            if isinstance(described, Capabilities):
                self.capabilities = described
        last = last_motions(moving)
        pose = pose_after(last, (yield from _estimates(last)))
        each = distinct(sequence)
        return from_here_told(each, (yield from _estimates(from_here(each, hand, pose, glance))), glance)


def planned(planning: Planning) -> Asking[FragmentPlan]:
    """The plan that is being made, a slice at a time; its questions go to the body. Raises as they do."""
    told: Sequence[Estimate] | None = None
    done = SLICE  # to take in an answer was a slice of its own
    while True:
        if done >= SLICE:
            done = 0
            yield None
        try:
            asked = planning.send(told)
        except StopIteration as end:
            plan: FragmentPlan = end.value
            return plan
        told = None
        if isinstance(asked, int):
            done += asked
        else:
            told, done = (yield from _estimates(asked)), SLICE


def _estimates(items: tuple[EstimateItem, ...]) -> Asking[tuple[Estimate, ...]]:
    if not items:
        return ()
    answer = yield EstimateBehaviors(items=items)
    if not isinstance(answer, Estimates) or len(answer.items) != len(items):
        raise RunFailed(Fault(reason="the body's estimates do not fit the question", where=keys.ESTIMATE))
    return answer.items
