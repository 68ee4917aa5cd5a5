"""The collaboration manager of the tangram: performs its plan through the public client alone."""

import asyncio

from schemas import keys
from schemas.faults import EngageError
from schemas.world import Entity, World
from services.bus import Bus
from services.client import Feed, Robot
from services.collaboration import plans
from services.collaboration.appendix_b import turns
from services.collaboration.config import CollaborationConfig
from services.collaboration.placement import has_been_placed
from services.runtime import Ready
from services.tangram_table import tangram_table


async def collaborate(bus: Bus, ready: Ready, config: CollaborationConfig) -> None:
    """Play the tangram once, with whoever comes; returns after the goodbye."""
    manager = plans.Manager(config, tangram_table())
    plan = plans.script(manager, turns(manager)) if config.mode == "scripted" else plans.task(manager)
    async with Robot.on(bus) as robot:
        with robot.worlds() as worlds:
            ready()
            await _follow(plan, _Engine(robot, worlds, bus))


async def _follow(plan: plans.Plan[None], engine: "_Engine") -> None:
    answer: plans.Answer = None
    while True:
        try:
            wish = plan.send(answer)
        except StopIteration:
            return
        answer = await engine.grant(wish)


class _Engine:
    """Does what a plan wishes. Keeps the world as last perceived."""

    def __init__(self, robot: Robot, worlds: Feed[World], bus: Bus) -> None:
        self._robot = robot
        self._worlds = worlds
        self._bus = bus
        self._world = World(entities=())

    async def grant(self, wish: plans.Wish) -> plans.Answer:
        match wish:
            case plans.Perform(fragment=fragment):
                try:
                    return await self._robot.perform(fragment)
                except EngageError as error:
                    self._bus.publish(keys.fault(self._bus.name), error.fault)
                    return None
            case plans.Observe():
                return (await self._now()).objects
            case plans.AwaitPlacement(piece=piece, before=before, timeout=timeout):
                return await self._placement(piece, before, self._robot.now() + timeout)
            case plans.AwaitPerson():
                while not (await self._now()).people:
                    await self._next(None)
                return self._world.people[0].id
            case plans.AwaitDeparture(timeout=timeout):
                deadline = self._robot.now() + timeout
                while (await self._now()).people:
                    if not await self._next(deadline):
                        return False
                return True
            case plans.Pause(seconds=seconds):
                await asyncio.sleep(seconds)
                return None

    async def _placement(self, piece: str, before: tuple[Entity, ...], deadline: float) -> tuple[Entity, ...] | None:
        while not has_been_placed(piece, before, (await self._now()).objects):
            if not await self._next(deadline):
                return None
        return self._world.objects

    async def _now(self) -> World:
        """The newest world there is, without waiting."""
        while await self._next(self._robot.now()):
            pass
        return self._world

    async def _next(self, deadline: float | None) -> bool:
        """Wait for a newer world. False: none came by `deadline`."""
        timeout = None if deadline is None else max(0.0, deadline - self._robot.now())
        world = await self._worlds.next(timeout)
        if world is None:
            return False
        self._world = world
        return True
