"""One behavior that a law is judged by, the connection of the body meanwhile, and what went wrong in words."""

import asyncio
from collections.abc import Sequence, Set
from contextlib import suppress
from types import TracebackType
from typing import Any

from engage_hri.schemas.behaviors import BlockBehavior
from engage_hri.schemas.faults import EngageError
from engage_hri.services.control.body import BehaviorRefused, Body, BodyFailed
from engage_hri.services.control.testing.laws import Finding, LawBroken, named
from engage_hri.services.control.testing.stage import PATIENCE, Stage
from engage_hri.services.runtime.virtual_time import Deadlock, TimeRanOut


class Case:
    """One behavior that a law is judged by. Whatever is wrong inside of its `async with` is a finding."""

    def __init__(self, body: Body, behavior: BlockBehavior, findings: list[Finding]) -> None:
        self._body, self._behavior = body, behavior
        self._findings = findings

    async def __aenter__(self) -> BlockBehavior:
        return self._behavior

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> bool:
        if error is None:
            return False
        findings = findings_of(error, named(self._behavior))
        if findings is None:
            return False
        self._findings += findings
        await Stage.end_all()
        with suppress(Exception):
            async with asyncio.timeout(PATIENCE):
                await self._body.home()
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


def findings_of(error: BaseException, behavior: str = "") -> Sequence[Finding] | None:
    """Put what went wrong with a body in words; None: it is no fault of a body."""
    match error:
        case LawBroken():
            return [
                each
                if each.behavior
                else Finding(
                    behavior=behavior,
                    sync=each.sync,
                    expected=each.expected,
                    measured=each.measured,
                    advice=each.advice,
                )
                for each in error.findings
            ]
        case BodyFailed() | BehaviorRefused():
            did = "failed" if isinstance(error, BodyFailed) else "refused"
            return [Finding(behavior=behavior, expected="that it can do this", measured=f"it {did}: {error.fault}")]
        case EngageError():
            return [Finding(behavior=behavior, expected="a body that can be had", measured=str(error.fault))]
        case Deadlock() | TimeRanOut():
            return [
                Finding(
                    behavior=behavior,
                    expected="that it comes to an end",
                    measured=str(error),
                    advice="something waits for what never comes",
                )
            ]
        case AssertionError() | Exception():
            return [
                Finding(
                    behavior=behavior,
                    expected="no error but BehaviorRefused and BodyFailed",
                    measured=f"{type(error).__name__}: {error}{place_of(error)}",
                    advice="control fails the behavior and takes the body home at such an error",
                )
            ]
    return None


def place_of(error: BaseException) -> str:
    """Say where an error was raised: ` at pan_tilt.py, line 14`, the innermost place that is not the suite's own."""
    trace, found = error.__traceback__, ""
    while trace is not None:
        file = trace.tb_frame.f_code.co_filename
        if "/control/testing/" not in file.replace("\\", "/"):
            found = f" at {file.replace(chr(92), '/').rpartition('/')[2]}, line {trace.tb_lineno}"
        trace = trace.tb_next
    return found


async def still_running(before: Set["asyncio.Task[Any]"]) -> list["asyncio.Task[Any]"]:
    """List tasks that have come since `before`, and do not end by themselves now."""
    for _ in range(3):
        await asyncio.sleep(0)
    came = asyncio.all_tasks() - before - {asyncio.current_task()}
    return sorted((task for task in came if not task.done()), key=lambda task: task.get_name())
