"""Answers of the control service to questions about its body: what behaviors would take, and what it can do."""

from collections.abc import Awaitable, Coroutine
from typing import Any

from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.body import DescribeBody, EstimateBehaviors, Estimates
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.messages import Message
from engage_hri.schemas.world import World
from engage_hri.services.bus.interface import Bus
from engage_hri.services.control.config import ControlConfig
from engage_hri.services.control.contract.body import Body
from engage_hri.services.control.contract.calibration import Calibration
from engage_hri.services.control.serving.estimates import IncomingEstimates
from engage_hri.services.control.serving.intake import ControlIntake
from engage_hri.services.control.serving.words_for_voice import estimate_of, spoken, spoken_items
from engage_hri.services.runtime.loop import InTurns
from engage_hri.services.runtime.steps import Steps


class Questions:
    """Answers about a body. Nothing of it moves."""

    def __init__(
        self, bus: Bus, config: ControlConfig, body: Body, calibration: Calibration, intake: ControlIntake
    ) -> None:
        """calibration: says how far what is estimated may be beside. intake: knows the world as it is now."""
        self._config, self._body, self._calibration, self._intake = config, body, calibration, intake
        self._estimates = IncomingEstimates(bus)
        self._rehearsals = InTurns()

    def estimate(self, question: Message) -> Message | Coroutine[Any, Any, Message]:
        """Answer `EstimateBehaviors`; what its behaviors need is prepared before. Raises InputRefused."""
        if not isinstance(question, EstimateBehaviors):
            raise InputRefused(Fault(reason="expected EstimateBehaviors", where=keys.ESTIMATE, service="control"))
        preparing = self._body.prepare([spoken(item.behavior) for item in question.items])
        if preparing is not None:
            return self._prepared(preparing, question)
        return self._rehearsals.answer(self._estimated(question, self._intake.world))

    async def _prepared(self, preparing: Awaitable[None], question: EstimateBehaviors) -> Message:
        await preparing
        answer = self._rehearsals.answer(self._estimated(question, self._intake.world))
        return await answer if isinstance(answer, Coroutine) else answer

    def _estimated(self, question: EstimateBehaviors, world: World) -> Steps[Message]:
        refused = [self._intake.refused(item.behavior) for item in question.items]
        known = [item for item, refusal in zip(question.items, refused, strict=True) if refusal is None]
        others = [item for item in question.others if self._intake.refused(item.behavior) is None]
        told = yield from self._body.rehearse_in_steps(spoken_items(known), world, spoken_items(others))
        taken = zip(known, self._estimates.take(known, told), strict=True)
        estimates = iter([self._calibration.stated(estimate_of(item.behavior, each)) for item, each in taken])
        return Estimates(items=tuple([next(estimates) if refusal is None else refusal for refusal in refused]))

    def describe(self, question: Message) -> Message:
        """Answer `DescribeBody` with what the body can do. Raises InputRefused."""
        if not isinstance(question, DescribeBody):
            raise InputRefused(Fault(reason="expected DescribeBody", where=keys.DESCRIBE, service="control"))
        able = self._body.capabilities
        zones = dict.fromkeys((*able.no_point_zones, *self._config.no_point_zones))
        return replace(able, no_point_zones=tuple(zones))
