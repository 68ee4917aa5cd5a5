"""Sinks that show what a robot does: a picture of the scene that is drawn anew, and lines of the log."""

import asyncio
from typing import Self

from rich.console import Console, RenderableType
from rich.live import Live

from engage_hri.schemas.messages import Message
from engage_hri.schemas.text import printable
from engage_hri.schemas.units import Seconds
from engage_hri.services.console import nets, view, wording
from engage_hri.services.console.terminal import log, tally
from engage_hri.services.console.terminal.render import render

REDRAW: Seconds = 0.1
"""Least time between two pictures; each is drawn because of a message."""


class LiveView:
    """Sink that keeps a picture of the scene on the terminal. Rich's own refresh thread stays off."""

    def __init__(self, console: Console, robot: str, began: Seconds) -> None:
        self.scene = view.empty(robot, began)
        self._console = console
        self._live = Live(self._picture(), console=console, auto_refresh=False, vertical_overflow="crop")
        self._due: asyncio.TimerHandle | None = None

    def __call__(self, message: Message, at: Seconds) -> None:
        self.scene = view.feed(self.scene, message, at)
        if self._due is None:
            self._due = asyncio.get_running_loop().call_later(REDRAW, self._draw)

    def _picture(self) -> RenderableType:
        return render(self.scene, self._console.width, self._console.height)

    def _draw(self) -> None:
        self._due = None
        self._live.update(self._picture(), refresh=True)

    def __enter__(self) -> Self:
        self._live.start(refresh=True)
        return self

    def __exit__(self, *raised: object) -> None:
        if self._due is not None:
            self._due.cancel()
        self._draw()
        self._live.stop()


class NetLog:
    """Sink that prints a line for each change in the nets of live blocks."""

    def __init__(self, console: Console, began: Seconds) -> None:
        self.nets: nets.Nets = {}
        self._scene = view.empty("", began)
        self._console = console
        self._began = began

    def __call__(self, message: Message, at: Seconds) -> None:
        now = asyncio.get_running_loop().time()
        scene, self._scene = self._scene, view.feed(self._scene, message, at)
        for text in log.holds(scene, self._scene, at):
            _print(self._console, f"{wording.clock(now - self._began):>8}  {text}")
        before, self.nets = self.nets, nets.without_old(nets.feed(self.nets, message, at, now), now)
        for block, net in self.nets.items():
            if net is not before.get(block):
                for text in nets.told(before.get(block), net):
                    _print(self._console, f"{wording.clock(now - self._began):>8}  {text}")


class Log:
    """Sink that prints a line for each message that matters."""

    def __init__(self, console: Console, robot: str, began: Seconds, telling: log.Telling | None = None) -> None:
        self.scene = view.empty(robot, began)
        self._console = console
        self._telling = telling or log.Telling()

    def __call__(self, message: Message, at: Seconds) -> None:
        before, self.scene = self.scene, view.feed(self.scene, message, at)
        line = log.line(message, before, self.scene, at, self._telling)
        if line is not None:
            _print(self._console, line)

    def say(self, text: str, at: Seconds) -> None:
        """Print a line about what no message tells."""
        _print(self._console, log.timed(text, self.scene, at))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *raised: object) -> None:
        return None


class Tallying:
    """A sink that keeps the tally."""

    def __init__(self, began: Seconds) -> None:
        self.tally = tally.empty(began)

    def __call__(self, message: Message, at: Seconds) -> None:
        self.tally = tally.feed(self.tally, message, at)


def scene_view(console: Console, robot: str, began: Seconds, live: bool) -> LiveView | Log:
    """Choose the sink that shows the scene: a live view on a terminal, log lines anywhere else."""
    return (
        LiveView(console, robot, began) if live else Log(console, robot, began, log.Telling(points=False, head=False))
    )


def _print(console: Console, line: str) -> None:
    console.print(printable(line), markup=False, highlight=False, soft_wrap=True)
