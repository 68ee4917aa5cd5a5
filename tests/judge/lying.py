"""A body that cannot be trusted: it lies about its points, does not hear, fails, refuses, or dies for a while.

It is the simulated body behind a curtain: what it does is left as it is, what is heard of it is not.
"""

import asyncio
from collections.abc import AsyncGenerator, Sequence
from contextlib import aclosing
from random import Random

from msgspec import Struct

from engage_hri.schemas.behaviors import BlockBehavior
from engage_hri.schemas.body import BodyPose, Estimate, EstimateItem
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.world import World
from engage_hri.services.control.contract.body import (
    Arrived,
    BehaviorRefused,
    Body,
    BodyFailed,
    BodyState,
    MovementAuthority,
    Progress,
    Reached,
)


class Lies(Struct, frozen=True, omit_defaults=True):
    """Shares of behaviors, or of their points, with which something goes wrong; drawn from `seed`.

    twice, never, mistimed, foreign: points told twice, not told, told at another time, and told though the behavior
    has no such point. deaf: behaviors that do not end when they are aborted. refuse, fail: behaviors.
    gone, back: seconds from the beginning at which the body leaves the bus and comes back; None: never.
    """

    seed: int = 0
    twice: float = 0.0
    never: float = 0.0
    mistimed: float = 0.0
    foreign: float = 0.0
    deaf: float = 0.0
    refuse: float = 0.0
    fail: float = 0.0
    gone: float | None = None
    back: float | None = None


class LyingBody(Body):
    """Another body, of which false reports are made."""

    def __init__(self, body: Body, lies: Lies) -> None:
        self.capabilities = body.capabilities
        self._body = body
        self._lies = lies
        self._chance = Random(lies.seed)

    def estimate(self, behavior: BlockBehavior, pose: BodyPose | None, world: World) -> Estimate:
        return self._body.estimate(behavior, pose, world)

    def rehearse(
        self, items: Sequence[EstimateItem], world: World, others: Sequence[EstimateItem] = ()
    ) -> Sequence[Estimate]:
        return self._body.rehearse(items, world, others)

    async def perform(self, behavior: BlockBehavior, authority: MovementAuthority) -> AsyncGenerator[Progress, None]:
        lies, chance = self._lies, self._chance
        if chance.random() < lies.refuse:
            raise BehaviorRefused(Fault(reason="not today", where=behavior.id))
        fails = chance.random() < lies.fail
        is_deaf = chance.random() < lies.deaf
        async with aclosing(self._body.perform(behavior, authority)) as true:
            async for progress in true:
                if chance.random() >= lies.never:
                    yield self._mistimed(progress)
                if chance.random() < lies.twice:
                    yield progress
                if chance.random() < lies.foreign and isinstance(progress, Arrived | Reached):
                    sync = chance.choice(("start", "stroke", "relax", "end", "nowhere"))
                    yield Reached(sync, progress.at, progress.at)
                if fails and chance.random() < 0.4:
                    raise BodyFailed(Fault(reason="it broke", where=behavior.id))
        if is_deaf and authority.revoked:
            await asyncio.sleep(chance.choice((1.0, 30.0)))

    def _mistimed(self, progress: Progress) -> Progress:
        if isinstance(progress, Reached) and self._chance.random() < self._lies.mistimed:
            at = self._chance.choice((progress.at - 1.0, progress.at + 1.0, 0.0, 1e9))
            return Reached(progress.sync, at, self._chance.choice((at, progress.at)))
        return progress

    async def home(self, parts: tuple[str, ...] = ()) -> None:
        await self._body.home(parts)

    def state(self) -> BodyState:
        return self._body.state()

    def see(self, world: World) -> None:
        self._body.see(world)
