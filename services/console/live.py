"""Two sinks that show a changing scene: redrawn in place on a terminal, or line by line anywhere else."""

import asyncio
from typing import Self

from rich.console import Console, RenderableType
from rich.live import Live

from engage_hri.schemas.messages import Message
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.utf8 import printable
from engage_hri.services.console import log, view
from engage_hri.services.console.render import render

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
        self._live.start()
        return self

    def __exit__(self, *raised: object) -> None:
        if self._due is not None:
            self._due.cancel()
        self._live.update(self._picture(), refresh=True)
        self._live.stop()


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
            self._console.print(printable(line), markup=False, highlight=False, soft_wrap=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *raised: object) -> None:
        return None
