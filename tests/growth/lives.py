"""Everything that runs long, at once: a whole robot, a manager, a window, a recorder, and those who come and go.

`step(k)` is one minute of such a life: somebody who was never there before passes, speaks and leaves; a block is
performed, another is refused, a third is cancelled; a manager that was never there before joins and leaves. No name
in it comes again.
"""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable, Coroutine
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from pathlib import Path
from typing import Any

from msgspec import Raw, json
from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Gaze, Speech, Wait
from engage_hri.schemas.faults import EngageError
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, ActorLost, Utterance
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus.deadlines import FORGOTTEN_AFTER
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.people.perceive import perceive
from engage_hri.services.client.robot import Robot, connect
from engage_hri.services.commandline.shell import roster
from engage_hri.services.commandline.shell.config import Config
from engage_hri.services.console.web import orders
from engage_hri.services.console.web.frames import Receipts, Viewer
from engage_hri.services.console.web.orders import Script
from engage_hri.services.console.web.service import WindowServer, window
from engage_hri.services.console.web.visitor import Visitor
from engage_hri.services.runtime.service import running
from tests.recording.runs import recording_to

THINGS = (
    Entity(id="cup", kind="object", position=(0.5, 0.1, 0.72), category="cup"),
    Entity(id="jug", kind="object", position=(0.6, -0.2, 0.72), category="jug"),
)
CALM: Seconds = FORGOTTEN_AFTER + 60.0
"""Time in which nobody is there and nothing is asked."""


class Eyes:
    """A perception that sees whoever passes. bus: its own."""

    def __init__(self, bus: Bus) -> None:
        self._bus = bus

    def see(self, *people: str, speed: float = 0.0) -> None:
        """Tell the world: the table, and these people with their hands. speed: of the hands, metres a second."""
        seen = list(THINGS)
        for place, person in enumerate(people):
            seen.append(Entity(id=person, kind="person", position=(1.2, 0.4 * place, 1.2)))
            hand = Entity(id=f"{person}-hand", kind="hand", owner=person, position=(0.7, 0.4 * place, 0.8))
            seen.append(replace(hand, velocity=(speed, 0.0, 0.0)))
        self._bus.publish(keys.WORLD, World(entities=tuple(seen), at=self._bus.stamp()))

    def tell(self, event: type, actor: str, *of: Any) -> None:
        """Tell that an action began or ended, or that somebody came or left."""
        what = {"action": of[0], "targets": of[1:]} if of else {}
        self._bus.publish(keys.PERCEIVED_ACTION, event(actor=actor, at=self._bus.stamp(), **what))

    async def passes(self, person: str, robot: str, meanwhile: Awaitable[None]) -> None:
        """Somebody comes, looks at the robot, speaks, waves, takes a thing, and leaves.

        meanwhile: what the robot does before.
        """
        self.tell(ActorFound, person)
        self.see(person)
        await asyncio.sleep(0.5)
        self.tell(ActionBegan, person, "look", robot)
        await asyncio.sleep(1.0)
        began = self._bus.stamp()
        self.tell(ActionBegan, person, "speak")
        self.see(person, speed=0.5)
        await asyncio.sleep(0.6)
        self.tell(ActionEnded, person, "speak")
        said = Utterance(
            id=f"{person}/1", actor=person, text=f"hello from {person}", began=began, ended=self._bus.stamp(),
            at=self._bus.stamp(), final=True,
        )  # fmt: skip
        self._bus.publish(keys.UTTERANCE, said)
        self.tell(ActionEnded, person, "look", robot)
        self.tell(ActionBegan, person, "act", "cup")
        self.see(person)
        await asyncio.sleep(0.4)
        self.tell(ActionEnded, person, "act", "cup")
        await meanwhile
        self.tell(ActorLost, person)
        self.see()
        await asyncio.sleep(1.5)


async def _in_vain(asked: Awaitable[object]) -> None:
    """Wait for what may be refused, or fail: what is asked for here is not always possible."""
    with suppress(EngageError):
        await asked


async def works(manager: Robot, k: int) -> None:
    """A manager at its task: what is done, refused, failed and cancelled, each under an id of its own."""
    say = {"turn_status": "full", "parts": [{"say": f"take number {k}"}, {"refer": "cup"}]}
    await manager.perform(say)
    await _in_vain(manager.perform({**say, "addressee": f"nobody-{k}"}))
    await _in_vain(manager.realize(f"block-{k}", [Speech(id="s", text=f"yes, {k}"), Gaze(id="g", target="jug")]))
    await _in_vain(manager.realize(f"wrong-{k}", [Gaze(id="g", target=f"nothing-{k}")]))
    cancelled = asyncio.ensure_future(manager.realize(f"long-{k}", [Wait(id="w", duration=50.0)]))
    await asyncio.sleep(0.3)
    cancelled.cancel()
    await asyncio.wait([cancelled])
    with suppress(EngageError):
        async with manager.inhibit_gaze("target", target="jug"):
            await asyncio.sleep(0.2)
    await _in_vain(manager.set_condition(f"condition-{k}", by=f"somebody-{k}"))


Step = Callable[[int], Awaitable[None]]


@asynccontextmanager
async def robot_alive() -> AsyncIterator[tuple[MemoryHub, Robot, Eyes]]:
    """A whole robot with a manager, and eyes for it."""
    config = Config()
    async with MemoryHub(config.robot) as hub:
        services = {name: roster.service(name, config) for name in roster.ROBOT}
        async with running(hub, services), connect(hub=hub) as manager:
            eyes = hub.join("eyes", "perception")
            eyes.declare_alive()
            sees = Eyes(eyes)
            sees.see()
            yield hub, manager, sees
            await eyes.leave()


@asynccontextmanager
async def life(folder: Path, *, windows: bool = True) -> AsyncIterator[Step]:
    """A robot, a manager with all that it can listen to, and a recorder. folder: for the recording.

    windows: two as well. Nobody looks at the one; at the other people sit down, steer and leave, and one looks on.
    """
    async with AsyncExitStack() as more:
        hub, manager, eyes = await more.enter_async_context(robot_alive())
        await more.enter_async_context(recording_to(folder / "life.mcap", hub))
        heard = (manager.actions(), manager.worlds(), manager.feedback(), manager.turns())
        for place, feed in enumerate((manager.connection_events(), *heard)):
            await more.enter_async_context(_during(_read(feed), f"feed {place}"))
        if windows:
            await more.enter_async_context(window(hub, hub.join("unseen", "wizard"), Script()))
            desk = await more.enter_async_context(window(hub, hub.join("desk", "wizard"), Script()))
            await more.enter_async_context(_during(_looks(desk), "browser"))

        async def step(k: int) -> None:
            await eyes.passes(f"track-{k}", manager.id, works(manager, k))
            async with connect(hub=hub, name=f"guest-{k}") as guest:
                await _in_vain(guest.realize(f"guest-block-{k}", [Wait(id="w", duration=0.1)]))
            async with perceive(f"visitor-{k}", hub=hub) as visitor:
                await visitor.say(f"I am number {k}", seconds=0.3)
                await visitor.point_at("cup", 0.2)
            if windows:
                await _visits(desk, k)

        yield step


@asynccontextmanager
async def _during(work: Coroutine[Any, Any, None], name: str) -> AsyncIterator[None]:
    task = asyncio.create_task(work, name=name)
    try:
        yield
    finally:
        task.cancel()
        await asyncio.wait([task])


async def _read(feed: Any) -> None:
    async for _ in feed:
        pass


async def _looks(desk: WindowServer) -> None:
    """A browser that draws each frame at once."""
    receipts, viewer = Receipts("session"), Viewer()
    looker = Visitor(desk, trusted=False, receipts=receipts)
    desk.viewers += 1
    while True:
        looker.frame(viewer)
        receipts.confirm()
        await asyncio.sleep(1.0)


async def _visits(desk: WindowServer, k: int) -> None:
    """Somebody opens the page, sits down, says something, has the robot say something, and closes the page."""
    visitor = Visitor(desk, trusted=True, receipts=Receipts(f"session-{k}"))
    given = (
        {"do": "sit", "name": f"sitter-{k}"}, {"do": "type", "text": f"good day from {k}"},
        {"do": "tell", "text": f"good day to you, {k}", "by": f"wizard-{k}"}, {"do": "hold"}, {"do": "leave"},
    )  # fmt: skip
    for number, order in enumerate(given, 1):
        visitor.take(orders.Given(number=number, order=Raw(json.encode(order))))
        await asyncio.sleep(1.0)
    await visitor.leave()
