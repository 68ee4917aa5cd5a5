"""Means of measuring: steps of an event loop, the parts that time goes to, and another work tree beside this one."""

import asyncio
import gc
import inspect
import json
import os
import subprocess
import sys
from collections import defaultdict
from collections.abc import Callable, Generator, Sequence
from contextvars import Context
from functools import wraps
from importlib import import_module
from pathlib import Path
from time import process_time, thread_time
from typing import Any, TypeVarTuple

from engage_hri.schemas.units import Seconds

Given = TypeVarTuple("Given")
LONG: Seconds = 0.003
"""A step that takes longer is counted."""


class SteppedLoop(asyncio.SelectorEventLoop):
    """Knows the longest of its steps, how many were long, and the longest collection of garbage, which is no step."""

    def __init__(self) -> None:
        super().__init__()
        self._collected = self._since = 0.0
        gc.callbacks.append(self._collects)
        self.forget()

    def forget(self) -> None:
        self.longest, self.long, self.what = 0.0, 0, ""
        self.longest_collection = 0.0

    def close(self) -> None:
        if not self.is_closed():
            gc.callbacks.remove(self._collects)
        super().close()

    def _collects(self, phase: str, info: dict[str, int]) -> None:
        if phase == "start":
            self._since = thread_time()
        else:
            taken = thread_time() - self._since
            self._collected += taken
            self.longest_collection = max(self.longest_collection, taken)

    def call_soon(
        self, callback: Callable[[*Given], object], *args: *Given, context: Context | None = None
    ) -> asyncio.Handle:
        return super().call_soon(self._timed, callback, *args, context=context)

    def call_soon_threadsafe(
        self, callback: Callable[[*Given], object], *args: *Given, context: Context | None = None
    ) -> asyncio.Handle:
        return super().call_soon_threadsafe(self._timed, callback, *args, context=context)

    def call_at(
        self, when: float, callback: Callable[[*Given], object], *args: *Given, context: Context | None = None
    ) -> asyncio.TimerHandle:
        return super().call_at(when, self._timed, callback, *args, context=context)

    def _timed(self, callback: Callable[[*Given], object], *arguments: *Given) -> None:
        task = getattr(callback, "__self__", callback)
        before = thread_time() - self._collected
        callback(*arguments)
        taken = thread_time() - self._collected - before
        self.long += taken > LONG
        if taken > self.longest:
            self.longest = taken
            self.what = task.get_name() if isinstance(task, asyncio.Task) else repr(task)[:60]


class Stopwatch:
    """Processor time by part; of nested parts the inner one counts."""

    def __init__(self) -> None:
        self.spent: dict[str, Seconds] = defaultdict(float)
        self._running: list[str] = []
        self._since = 0.0

    def _note(self) -> None:
        now = process_time()
        if self._running:
            self.spent[self._running[-1]] += now - self._since
        self._since = now

    def enter(self, part: str) -> None:
        self._note()
        self._running.append(part)

    def leave(self) -> None:
        self._note()
        self._running.pop()

    def watched(self, function: Callable[..., Any], part: str) -> Callable[..., Any]:
        def steps(generator: Any) -> Generator[Any, Any, Any]:
            value = None
            while True:
                self.enter(part)
                try:
                    told = generator.send(value)
                except StopIteration as end:
                    return end.value
                finally:
                    self.leave()
                value = yield told

        class Awaited:
            def __init__(self, coroutine: Any) -> None:
                self._coroutine = coroutine

            def __await__(self) -> Generator[Any, Any, Any]:
                return steps(self._coroutine)

        async def awaited(coroutine: Any) -> Any:
            return await Awaited(coroutine)

        @wraps(function)
        def timed(*arguments: Any, **named: Any) -> Any:
            if inspect.isgeneratorfunction(function):
                return steps(function(*arguments, **named))
            if inspect.iscoroutinefunction(function):
                return awaited(function(*arguments, **named))
            self.enter(part)
            try:
                return function(*arguments, **named)
            finally:
                self.leave()

        return timed

    def install(self, parts: Sequence[tuple[str, str, Sequence[str]]]) -> None:
        """Watch functions: of each part its name, a module, and those of these functions that the module has."""
        for part, module, names in parts:
            for name in names:
                owner: Any = import_module(module)
                *path, last = name.split(".")
                for each in path:
                    owner = getattr(owner, each)
                if hasattr(owner, last):
                    setattr(owner, last, self.watched(getattr(owner, last), part))


class Measurer:
    """A process that measures the code of one work tree: `file` with `--obey`, which answers each line with one."""

    def __init__(self, file: str, tree: Path) -> None:
        environment = {**os.environ, "PYTHONPATH": str(tree)}
        self._process = subprocess.Popen(
            [sys.executable, file, "--obey"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=environment,
            cwd=tree,
        )
        self._line()

    def _line(self) -> str:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise RuntimeError("a measuring process has ended")
        return line

    def measure(self, *order: object) -> dict[str, Any]:
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps(order) + "\n")
        self._process.stdin.flush()
        said: dict[str, Any] = json.loads(self._line())
        return said

    def close(self) -> None:
        self._process.communicate()
