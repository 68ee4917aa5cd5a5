"""Answers of a participant: to those in its process without a wire; an answer in steps is a task of its own."""

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any

from engage_hri.schemas.faults import EngageError, InputRefused
from engage_hri.schemas.messages import Message
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Answer, Bus, is_asked_to_stop

MOST = 1024
"""Answers of one participant that may be under way at once. Who asks more is refused: it is a flood."""


class Answering:
    """The answers of one participant. served: how it answers, by key."""

    def __init__(self, bus: Bus) -> None:
        self.served: dict[str, Answer] = {}
        self._bus = bus
        self._tasks: set[asyncio.Task[Any]] = set()
        self._is_open = True

    @property
    def is_full(self) -> bool:
        return len(self._tasks) >= MOST

    def begin(self, answer: Coroutine[Any, Any, Message | None], key: str) -> "asyncio.Task[Any]":
        """Run an answer to a question on `key`, whoever still waits for it."""
        task = asyncio.create_task(answer, name=f"answer on {key}")
        self._tasks.add(task)
        task.add_done_callback(self._ended)
        return task

    async def ask(
        self, key: str, question: Message, deadline: Seconds, carried: Callable[[Message], Message]
    ) -> Message | None:
        """Ask this participant, from its own process. None: there is no answer by `deadline`, or it has left.

        carried: makes of an answer what its receiver gets. Raises InputRefused: it answered a fault.
        """
        try:
            told = self.served[key](question)
            if not isinstance(told, Coroutine):
                return carried(told)
            task = self.begin(told, key)
            await asyncio.wait([task], timeout=max(deadline - self._bus.now(), 0.0))
            return carried(task.result()) if task.done() and self._is_open else None
        except EngageError as error:
            raise InputRefused(error.fault) from error
        except (Exception, asyncio.CancelledError) as error:
            if is_asked_to_stop():
                raise
            raise InputRefused(self._bus.failed(error, f"a question on {key}")) from error

    def _ended(self, task: "asyncio.Task[Any]") -> None:
        self._tasks.discard(task)
        if not task.cancelled():
            task.exception()  # told to whoever waits; nobody has to

    def end(self) -> None:
        """Answer nothing any more, and break off all answers: their server leaves."""
        self._is_open = False
        self.served.clear()
        for task in tuple(self._tasks):
            task.cancel()
