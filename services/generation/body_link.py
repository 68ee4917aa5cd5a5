"""Questions of generation to the body: its capabilities, and the costs of the motions that references need."""

import asyncio
from collections.abc import Sequence

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import BlockBehavior, Hand
from engage_hri.schemas.body import Capabilities, DescribeBody, Estimate, EstimateBehaviors, EstimateItem, Estimates
from engage_hri.schemas.faults import Fault, RunFailed
from engage_hri.schemas.messages import Message
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus
from engage_hri.services.generation.block.emission import FragmentPlan
from engage_hri.services.generation.pipeline import Planning
from engage_hri.services.generation.references.motions import (
    Motions,
    distinct,
    from_here,
    from_here_told,
    last_motions,
    pose_after,
)
from engage_hri.services.runtime.unhurried import SLICE

BODY_PATIENCE: Seconds = 5.0
"""Time that a reference waits for a body to say what motions cost: a body that has just been started needs it.
Ours."""


class BodyLink:
    """Generation's connection to the body. capabilities: what the body last said of itself; None: not asked yet."""

    def __init__(self, bus: Bus) -> None:
        self.capabilities: Capabilities | None = None
        self._bus = bus

    def forget(self) -> None:
        """Drop the capabilities of a body that is gone: another one may come."""
        self.capabilities = None

    async def motions(
        self, sequence: Sequence[str], hand: Hand | None, moving: Sequence[BlockBehavior] = (), glance: str = ""
    ) -> Motions:
        """Costs, rays and poses of a look and a point at each target of the `sequence`, from where the body is.

        hand: the only one allowed; None: either. moving: gazes and points under way, in order; they will be on target
        before the references begin. glance: see `Motions`. Raises NoReply without a body.
        """
        if not sequence:
            return Motions({}, {})
        if self.capabilities is None:
            described = await self._ask(keys.DESCRIBE, DescribeBody())
            if isinstance(described, Capabilities):
                self.capabilities = described
        last = last_motions(moving)
        pose = pose_after(last, await self._estimates(last))
        each = distinct(sequence)
        return from_here_told(each, await self._estimates(from_here(each, hand, pose, glance)), glance)

    async def planned(self, planning: Planning) -> FragmentPlan:
        """The plan that is being made, a slice at a time; its questions go to the body. Raises as they do."""
        told: Sequence[Estimate] | None = None
        done = SLICE  # to take in an answer was a slice of its own
        try:
            while True:
                if done >= SLICE:
                    done = 0
                    await asyncio.sleep(0)
                asked = planning.send(told)
                told = None
                if isinstance(asked, int):
                    done += asked
                else:
                    told, done = await self._estimates(asked), SLICE
        except StopIteration as end:
            plan: FragmentPlan = end.value
            return plan
        finally:
            planning.close()

    async def _estimates(self, items: tuple[EstimateItem, ...]) -> tuple[Estimate, ...]:
        if not items:
            return ()
        answer = await self._ask(keys.ESTIMATE, EstimateBehaviors(items=items))
        if not isinstance(answer, Estimates) or len(answer.items) != len(items):
            raise RunFailed(Fault(reason="the body's estimates do not fit the question", where=keys.ESTIMATE))
        return answer.items

    async def _ask(self, key: str, question: Message) -> Message:
        """The body's answer; the question waits while a body may still come up."""
        return await self._bus.query(key, question, BODY_PATIENCE)
