"""Every body we ship, held to the contract; and bodies that lie, which the contract is to catch."""

from collections.abc import AsyncGenerator
from contextlib import aclosing
from random import Random

import pytest

from engage_hri.schemas.behaviors import BlockBehavior, Gaze
from engage_hri.services.control.body import Body, MovementAuthority, Progress, Reached
from engage_hri.services.control.torso.body import SimulatedBody
from tests.control.contract import BodyContract
from tests.control.contract_truth import CROWDS, witnessed
from tests.control.suite import WORLD


class TestSimulatedBody(BodyContract):
    def make(self) -> Body:
        return SimulatedBody()


class Boaster(SimulatedBody):
    """Says of what is taken over that it was made."""

    async def perform(self, behavior: BlockBehavior, authority: MovementAuthority) -> AsyncGenerator[Progress, None]:
        passed = set()
        async with aclosing(super().perform(behavior, authority)) as stream:
            async for progress in stream:
                passed |= {progress.sync} if isinstance(progress, Reached) else set()
                yield progress
        if authority.revoked == "taken_over":
            now = self._loop.time()
            for sync in (each for each in authority.points if each not in passed):
                yield Reached(sync, now, now)


class Early(SimulatedBody):
    """Says that it looks as soon as it begins to turn."""

    async def perform(self, behavior: BlockBehavior, authority: MovementAuthority) -> AsyncGenerator[Progress, None]:
        async with aclosing(super().perform(behavior, authority)) as stream:
            async for progress in stream:
                yield progress
                if isinstance(behavior, Gaze) and isinstance(progress, Reached) and progress.sync == "stroke_start":
                    yield Reached("stroke", progress.at, progress.at)


@pytest.mark.parametrize(
    ("liar", "crowd"), [(Boaster, "looks"), (Boaster, "arms"), (Boaster, "nods"), (Early, "looks")]
)
async def test_a_body_that_lies_about_its_joints_is_caught(liar: type[SimulatedBody], crowd: str) -> None:
    body = liar()
    body.see(WORLD)
    witness = await witnessed(body, WORLD, CROWDS[crowd], Random(crowd))

    assert witness is not None
    assert witness.lies
