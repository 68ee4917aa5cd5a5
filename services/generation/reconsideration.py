"""The choice of references, looked at again while their fragments go on: of objects that have moved or left."""

import asyncio
from collections.abc import Mapping

from engage_hri.schemas import keys
from engage_hri.schemas.blocks import InterruptBehavior
from engage_hri.schemas.faults import EngageError
from engage_hri.schemas.world import World
from engage_hri.services.bus.interface import Bus
from engage_hri.services.generation.body_link import BodyLink
from engage_hri.services.generation.choosing_again import (
    barred,
    changed,
    first_that_differs,
    open_references,
    remembered,
    without,
)
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.head.inhibitions import Leases
from engage_hri.services.generation.performance import FragmentPerformance
from engage_hri.services.generation.pipeline import planning, targets
from engage_hri.services.generation.references.policy import Unreferable
from engage_hri.services.requests.ends import Requester


class Reconsideration:
    """Looks again at the choices of `live` fragments, by request id."""

    def __init__(
        self,
        bus: Bus,
        config: GenerationConfig,
        requests: Requester,
        leases: Leases,
        body: BodyLink,
        live: Mapping[str, FragmentPerformance],
    ) -> None:
        self._bus, self._config, self._requests, self._leases = bus, config, requests, leases
        self._body, self._live = body, live
        self._world: World | None = None
        self._news = asyncio.Event()

    def look_again(self, world: World | None) -> None:
        """Take the world as it is now. To be called whenever something has changed, in it or of a fragment."""
        self._world = world
        self._news.set()

    async def all_made(self, turn: str) -> None:
        """Wait until no reference of the turn's fragments under way is chosen again: words follow on words."""
        while any(each.acts and each.may_choose_again for each in self._live.values() if each.turn.turn == turn):
            await self._changes()

    async def keep(self) -> None:
        """Choose again where objects have moved or left since the choice, until cancelled."""
        while True:
            for performance in list(self._live.values()):
                if self._has_changed(performance):
                    with self._bus.containing(f"another choice for fragment {performance.fragment.id}"):
                        await self._choose_again(performance)
            await self._changes()

    async def _changes(self) -> None:
        if self._news.is_set():
            self._news = asyncio.Event()
        await self._news.wait()

    def _has_changed(self, performance: FragmentPerformance) -> bool:
        then, now = performance.world, self._world
        is_going_on = performance.plan is not None and performance.is_sent and not performance.is_over
        return is_going_on and then is not None and now is not None and changed(performance.acts[-1], then, now)

    async def _choose_again(self, performance: FragmentPerformance) -> None:
        """Take out the gestures of the first reference that would be made otherwise in the world as it is now.

        What needs them falls, and the rest of the fragment is performed by another block.
        """
        act, turn, now = performance.acts[-1], performance.turn_left, self._world
        assert now is not None
        performance.world = world = remembered(now, performance.known)
        fragment = open_references(performance.left, act)
        bars = barred(targets(fragment), now, performance.known, performance.barred)
        permits = self._leases.permits()
        try:
            motions = await self._body.motions(targets(fragment), permits.only_hand)
            motions, config = without(motions, bars), self._config
            made = await self._body.planned(
                planning(fragment, turn, world, self._body.capabilities, motions, permits, config)
            )
            choices = made.choices
        except Unreferable:
            choices = ()
        except EngageError:
            return  # the body does not answer: the realizer will tell
        if performance.is_over or performance.plan is None or performance.acts[-1] is not act:
            return
        for gesture in first_that_differs(act, choices, bars):
            id = f"{performance.block_id}/{gesture}:again"
            self._requests.send(keys.BLOCK, InterruptBehavior(id=id, block=performance.fragment.id, behavior=gesture))
