"""A behavior under way, with the authority in the hand of the suite; the waiting that goes with it; a connection."""

import asyncio
from collections.abc import Callable, Sequence, Set
from typing import Any, ClassVar

from engage_hri.schemas.behavior_types import sync_points
from engage_hri.schemas.behaviors import BlockBehavior
from engage_hri.schemas.body import Estimate
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.contract.body import Arrived, Body, MovementAuthority, Progress, Reached
from engage_hri.services.control.testing.findings import NEVER_ENDS, broken, listed, ms

PATIENCE: Seconds = 30.0
"""Time within which any behavior comes to its next hold point, or to its end."""
LOOK_EVERY: Seconds = 0.02


def default(points: Sequence[str]) -> tuple[str, ...]:
    """Leave out `stroke:2` and on, which a body may tell of or not."""
    return tuple(sync for sync in points if not sync.startswith("stroke:"))


def target_point(behavior: BlockBehavior) -> str:
    """The sync point at which a behavior is on target, if it has one."""
    return "stroke" if "stroke" in sync_points(behavior) else "end"


def until_target(estimate: Estimate, behavior: BlockBehavior) -> Seconds:
    """Time from the start to the target, as an estimate has it."""
    points = [phase.to for phase in estimate.phases]
    return sum(phase.natural for phase in estimate.phases[: points.index(target_point(behavior)) + 1])


def times(progress: Sequence[Progress]) -> dict[str, Seconds]:
    """Loop time at which each sync point was passed."""
    return {item.sync: item.at for item in progress if isinstance(item, Reached)}


async def performed(body: Body, behavior: BlockBehavior, through: str = "end") -> list[Progress]:
    """Perform a behavior in this task, and return what the body told."""
    authority = MovementAuthority(behavior, through)
    return [progress async for progress in body.perform(behavior, authority)]


async def done(body: Body, behavior: BlockBehavior) -> list[Progress]:
    """Perform a behavior with all authority, and return what the body told. Raises LawBroken if it never ends."""
    return await Stage(body, behavior, "end").over()


class Stage:
    """A behavior under way.

    progress: what the body has told. heard: when it told each of these, loop time.
    """

    live: ClassVar["list[Stage]"] = []
    """Stages that were begun since `end_all`."""

    def __init__(self, body: Body, behavior: BlockBehavior, through: str = "start") -> None:
        self.authority = MovementAuthority(behavior, through)
        self.behavior = behavior
        self.progress: list[Progress] = []
        self.heard: list[Seconds] = []
        self.began = asyncio.get_running_loop().time()
        self._body = body
        self._news = asyncio.Event()
        self.task = asyncio.create_task(self._perform(), name=f"stage {behavior.id}")
        self.task.add_done_callback(lambda _: self._news.set())
        Stage.live.append(self)

    async def _perform(self) -> None:
        async for progress in self._body.perform(self.behavior, self.authority):
            self.progress.append(progress)
            self.heard.append(asyncio.get_running_loop().time())
            self.hear(progress)
            self._news.set()

    def hear(self, progress: Progress) -> None:
        """Take note of what the body tells, at the instant at which it tells it. By default nothing."""

    @property
    def passed(self) -> list[str]:
        """Sync points that the body has said it has passed."""
        return [item.sync for item in self.progress if isinstance(item, Reached)]

    @property
    def waits_at(self) -> list[str]:
        """Hold points at which the body has said it waits, also those that it has left."""
        return [item.sync for item in self.progress if isinstance(item, Arrived)]

    async def until(self, condition: Callable[[], bool], patience: Seconds = PATIENCE) -> None:
        """Wait until a condition holds that the body's telling brings about, or the behavior has ended."""
        try:
            async with asyncio.timeout(patience):
                while not condition() and not self.task.done():
                    self._news.clear()
                    await self._news.wait()
        except TimeoutError:
            pass

    async def holding(self, count: int = 1) -> None:
        """Wait until the body waits for the `count`-th time. If it never does, what was told so far says so."""
        await self.until(lambda: len(self.waits_at) >= count)

    async def over(self, patience: Seconds = PATIENCE) -> list[Progress]:
        """Wait for the end. Raises LawBroken if it does not come, and what the body raises."""
        await asyncio.wait([self.task], timeout=patience)
        if not self.task.done():
            how = self.authority.revoked
            cut = " of its being taken over" if how == "taken_over" else " of its abort" if how else ""
            is_free = how is None and self.authority.covers(self.authority.points[-1])
            broken(
                self.next_point,
                behavior=self.behavior,
                expected=f"an end within {ms(patience)}{cut}",
                measured=self.told,
                advice="does `perform` look at the authority while it moves and waits (`watch`, `granted`)?",
                cause=f"{NEVER_ENDS}, having passed {listed(self.passed)}" if is_free else "",
            )
        self.task.result()
        return self.progress

    @property
    def told(self) -> str:
        """Words for what has become of it so far."""
        is_over = "it has ended" if self.task.done() else "it goes on"
        how = f" as {self.authority.revoked}" if self.authority.revoked else ""
        waits = f"; has waited at {listed(self.waits_at)}" if self.waits_at else ""
        return f"{is_over}{how}; passed {listed(self.passed)}{waits}"

    @property
    def next_point(self) -> str:
        """The sync point that comes next; empty: none."""
        return next((sync for sync in self.authority.points if sync not in self.passed), "")

    @classmethod
    async def end_all(cls) -> None:
        """Cancel what is left of all stages of this loop, and forget them."""
        loop = asyncio.get_running_loop()
        tasks = [stage.task for stage in cls.live if stage.task.get_loop() is loop]
        cls.live.clear()
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


async def standing(body: Body, patience: Seconds = PATIENCE) -> bool:
    """Wait until the body says that nothing moves. Returns False if it never does."""
    loop = asyncio.get_running_loop()
    deadline = loop.time() + patience
    while body.state().moving:
        if loop.time() > deadline:
            return False
        await asyncio.sleep(LOOK_EVERY)
    return True


class Connection:
    """A task that a body is connected in: what is entered in a task has to be left in the same."""

    def __init__(self, body: Body) -> None:
        self._body = body
        self._is_open = asyncio.Event()
        self._leave = asyncio.Event()
        self._task = asyncio.create_task(self._stay(), name="connection of the body")

    async def _stay(self) -> None:
        async with self._body.connected():
            self._is_open.set()
            await self._leave.wait()

    async def enter(self) -> None:
        opening = asyncio.create_task(self._is_open.wait())
        await asyncio.wait([opening, self._task], return_when=asyncio.FIRST_COMPLETED)
        opening.cancel()
        if self._task.done():
            self._task.result()

    async def leave(self) -> None:
        self._leave.set()
        await self._task


async def still_running(before: Set["asyncio.Task[Any]"]) -> list["asyncio.Task[Any]"]:
    """List tasks that have come since `before`, and do not end by themselves now."""
    for _ in range(3):
        await asyncio.sleep(0)
    came = asyncio.all_tasks() - before - {asyncio.current_task()}
    return sorted((task for task in came if not task.done()), key=lambda task: task.get_name())
