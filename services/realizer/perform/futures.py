"""Futures of one block, which its running net resolves: one for each sync point and each instant that is awaited."""

import asyncio
from typing import NamedTuple, TypeVar

from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.net.running import Observer, RunningNet
from engage_hri.services.realizer.points import FINISH, Point

T = TypeVar("T")


class PointPassed(NamedTuple):
    """A behavior has passed `point`. arrived: when it had come there, if it waited. by_body: told by the body."""

    point: Point
    at: Seconds
    arrived: Seconds | None = None
    by_body: bool = False


class SyncPointFutures(Observer):
    """Futures by sync point, each made when first awaited. They outlive the net."""

    def __init__(self) -> None:
        self._granted: dict[Point, asyncio.Future[None]] = {}
        self._fired: dict[Point, asyncio.Future[Seconds]] = {}
        self._reached: dict[Point, asyncio.Future[Seconds]] = {}
        self._reported: dict[Point, asyncio.Future[PointPassed | None]] = {}

    def adopt(self, net: RunningNet) -> "SyncPointFutures":
        """Observe another net of the same block from now on."""
        self._net = net
        for transition in net.instants if self._fired else ():
            self.on_fired(transition, net.instants[transition])
        return self

    def granted(self, point: Point) -> "asyncio.Future[None]":
        """Resolved when the behavior may pass `point`; of its start: when it is to begin."""
        return _future(self._granted, point)

    def fired(self, point: Point) -> "asyncio.Future[Seconds]":
        """Resolved when the transition of `point` fires, with the time. `FINISH`: when the block is over."""
        future = _future(self._fired, point)
        transition = self._net.end if point == FINISH else self._net.at[point]
        if transition in self._net.instants:
            _resolve(self._fired, point, self._net.instants[transition])
        return future

    def grant(self, point: Point) -> None:
        """Let the behavior pass `point`."""
        if not (future := self.granted(point)).done():  # done: its task was cancelled
            future.set_result(None)

    def reached(self, point: Point) -> "asyncio.Future[Seconds]":
        """Resolved when the behavior itself has passed `point`, with the time, whatever else is of that instant."""
        return _future(self._reached, point)

    def reach(self, point: Point, at: Seconds) -> None:
        """Note that the behavior has passed `point`."""
        _resolve(self._reached, point, at)

    def reported(self, point: Point) -> "asyncio.Future[PointPassed | None]":
        """Resolved with the report of the body about `point`; with None if it was lost, or there will be none."""
        return _future(self._reported, point)

    def report(self, point: Point, news: PointPassed | None) -> None:
        """Note what the body has reported of `point`; what comes after the first is ignored."""
        if not (future := _future(self._reported, point)).done():
            future.set_result(news)

    def cancel(self) -> None:
        """Cancel all that is still awaited: the block has ended."""
        for futures in (self._granted, self._fired, self._reached, self._reported):
            for future in futures.values():
                future.cancel()

    # -- what happens (see `Observer`) ---------------------------------------------------------------------------

    def on_fired(self, transition: int, at: Seconds) -> None:
        if self._fired:
            for point in self._net.net.transitions[transition].points or (FINISH,):
                _resolve(self._fired, point, at)


def _future(futures: dict[Point, "asyncio.Future[T]"], point: Point) -> "asyncio.Future[T]":
    if (future := futures.get(point)) is None:
        future = futures[point] = asyncio.get_running_loop().create_future()
    return future


def _resolve(futures: dict[Point, "asyncio.Future[Seconds]"], point: Point, at: Seconds) -> None:
    if (future := futures.get(point)) is not None and not future.done():
        future.set_result(at)
