"""Answers that a server gives in steps: each is a task of the server, and ends with it."""

import asyncio
from collections.abc import Coroutine
from typing import Any

from engage_hri.schemas.messages import Message

MOST = 1024
"""Answers of one participant that may be under way at once. Who asks more is refused: it is a flood."""


class Answering:
    """The answers of one participant that are under way."""

    def __init__(self) -> None:
        self._tasks: set[asyncio.Task[Any]] = set()

    @property
    def is_full(self) -> bool:
        return len(self._tasks) >= MOST

    def begin(self, answer: Coroutine[Any, Any, Message | None], key: str) -> "asyncio.Task[Any]":
        """Run an answer to a question on `key`, whoever still waits for it."""
        task = asyncio.create_task(answer, name=f"answer on {key}")
        self._tasks.add(task)
        task.add_done_callback(self._ended)
        return task

    def _ended(self, task: "asyncio.Task[Any]") -> None:
        self._tasks.discard(task)
        if not task.cancelled():
            task.exception()  # told to whoever waits; nobody has to

    def end(self) -> None:
        """Break off all answers: their server leaves."""
        for task in tuple(self._tasks):
            task.cancel()
