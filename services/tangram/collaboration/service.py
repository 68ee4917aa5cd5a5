"""The collaboration manager of the tangram: performs its plan through the public client alone."""

import asyncio
import math
from collections.abc import Callable
from contextlib import suppress
from functools import partial

from engage_hri.schemas import keys
from engage_hri.schemas.faults import EngageError
from engage_hri.schemas.perception import ActionBegan
from engage_hri.schemas.recognition import EngagementLevel, Statistics
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import World
from engage_hri.services.bus.interface import Bus
from engage_hri.services.client.feeds import Feed
from engage_hri.services.client.robot import Robot
from engage_hri.services.reports.ongoing_actions import ActionEvent
from engage_hri.services.runtime.service import Ready, tell_settings
from engage_hri.services.tangram.collaboration import plans
from engage_hri.services.tangram.collaboration.config import CollaborationConfig
from engage_hri.services.tangram.collaboration.host import host
from engage_hri.services.tangram.collaboration.pieces_in_view import HeldPieces, PiecesInView, has_been_placed
from engage_hri.services.tangram.collaboration.plans import turns
from engage_hri.services.tangram.table import tangram_table


async def collaborate(bus: Bus, ready: Ready, config: CollaborationConfig) -> None:
    """Play the tangram once, with the first person who comes, or who comes after them; return after the goodbye.

    As a host, ask those who are there some questions instead.
    """
    if config.mode == "host":
        async with Robot.on(bus) as robot:
            tell_settings(bus, "collaboration", config)
            ready()
            await host(robot)
        return
    manager = plans.Manager(config, tangram_table())
    plan = plans.script(manager, turns(manager)) if config.mode == "scripted" else plans.task(manager)
    async with Robot.on(bus) as robot, asyncio.TaskGroup() as tasks:
        engine = _Engine(robot, bus, PiecesInView(), HeldPieces())
        with robot.worlds() as worlds, robot.engagement() as levels, robot.actions() as actions:
            watching = [
                tasks.create_task(engine.watch(worlds), name="watch the table"),
                tasks.create_task(engine.attend(levels), name="watch the people"),
                tasks.create_task(engine.follow(actions), name="watch their eyes and hands"),
            ]
            tell_settings(bus, "collaboration", config)
            ready()
            await _follow(plan, engine)
            for task in watching:
                task.cancel()


async def _follow(plan: plans.Plan[None], engine: "_Engine") -> None:
    answer: plans.Answer = None
    while True:
        try:
            wish = plan.send(answer)
        except StopIteration:
            return
        answer = await engine.grant(wish)


class _Engine:
    """Grants the wishes of a plan, and watches the table all the while."""

    def __init__(self, robot: Robot, bus: Bus, view: PiecesInView, held: HeldPieces) -> None:
        self._robot = robot
        self._bus = bus
        self._view = view
        self._held = held
        self._seen = asyncio.Event()
        self._levels: dict[str, EngagementLevel] = {}
        self._looks: dict[str, tuple[str, ...]] = {}
        """What each person looks at."""

    async def watch(self, worlds: Feed[World]) -> None:
        async for world in worlds:
            self._view.see(world, self._robot.now())
            self._seen.set()

    async def attend(self, levels: Feed[Statistics]) -> None:
        async for told in levels:
            self._levels[told.actor] = told.level

    async def follow(self, actions: Feed[ActionEvent]) -> None:
        async for told in actions:
            self._held.feed(told, self._robot.now())
            if isinstance(told, ActionBegan) and told.action == "look":
                self._looks[told.actor] = told.targets

    async def grant(self, wish: plans.Wish) -> plans.Answer:
        now, view = self._robot.now(), self._view
        match wish:
            case plans.Perform(fragment=fragment):
                try:
                    return await self._robot.perform(fragment)
                except EngageError as error:
                    self._bus.publish(keys.fault(self._bus.name), error.fault)
                    return None
            case plans.Observe(patience=patience):
                await self._wait_until(view.is_steady, lambda _: now + patience)
                return view.pieces(self._robot.now())
            case plans.AwaitPlacement(piece=piece, before=before, timeout=timeout):
                is_placed, end, held = partial(has_been_placed, piece, before), now + timeout, self._held
                end -= held.seconds(now)
                return await self._wait_until(
                    lambda at: is_placed(view.pieces(at)), lambda at: end + held.seconds(at)
                )
            case plans.LookAround():
                table = {tangram_table().surface.id, *(piece.id for piece in view.pieces(now))}
                return tuple(
                    plans.Attendee(
                        id,
                        self._levels.get(id, "unknown"),
                        view.visits[id],
                        is_at_it=not table.isdisjoint(self._looks.get(id, ())),
                    )
                    for id in view.people(now)
                )
            case plans.AwaitPerson(known=known):
                await self._wait_until(lambda at: view.person(at) is not None, lambda _: math.inf)
                return view.person(self._robot.now(), known)
            case plans.AwaitDeparture(timeout=timeout):
                return await self._wait_until(lambda at: view.person(at) is None, lambda _: now + timeout)
            case plans.Pause(seconds=seconds):
                await asyncio.sleep(seconds)
                return None

    async def _wait_until(self, holds: Callable[[Seconds], bool], ends: Callable[[Seconds], Seconds]) -> bool:
        """Wait until `holds`, asked at loop time, is true of the table. False: it was not when the wait `ends`."""
        while not holds(now := self._robot.now()):
            if now >= (deadline := ends(now)):
                return False
            change = self._view.deadline(now)
            again = deadline if change is None else min(change, deadline)
            self._seen.clear()
            with suppress(TimeoutError):
                async with asyncio.timeout_at(again if again < math.inf else None):
                    await self._seen.wait()
        return True
