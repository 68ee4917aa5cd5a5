"""Client for managers that are language models: tool calls, and speaking while the model still writes.

    async with connect() as robot:
        result = await perform_call(robot, call)                        # the input of the tool of `schemas/tool.py`
        outcomes = await stream(robot, model_output(), id="turn-1")     # text, in which `[red-cup]` is an object
        print(result.json, summary(*outcomes).json)

Of a stream each clause is sent as soon as it is complete (chunking.py); generation performs one fragment right after
the other.
"""

import asyncio
from collections.abc import AsyncIterable, AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from typing import Any

from msgspec.structs import replace

from engage_hri.schemas.covered import COVERED_FOR, CoveredObjects
from engage_hri.schemas.faults import EngageError, Fault, InputRefused, OutcomeUnknown
from engage_hri.schemas.fragments import FragmentOutcome, TurnClosed, TurnFragment, TurnStatus
from engage_hri.schemas.summary import Summary, summary
from engage_hri.schemas.tool import Part, ToolInput
from engage_hri.schemas.tool_call import fragment_of
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import World
from engage_hri.services.client.chunking import UNKNOWN, Chunk, Chunker
from engage_hri.services.client.feeds import Feed
from engage_hri.services.client.inputs import call_in
from engage_hri.services.client.results import PerformFailed
from engage_hri.services.client.robot import Robot
from engage_hri.services.text.pieces import Ids

Piece = str | Part
"""A bit of text, however short, in which `[id]` refers to an object; or a part by itself."""
WORLD_PATIENCE: Seconds = 0.3
"""Time from the start of a stream for which a bracket waits for the world: it alone says what a reference is."""
PLAIN_TURN = ToolInput(turn_status="full", parts=())


async def perform_call(
    robot: Robot, call: dict[str, Any] | str | bytes, *, await_answer: bool = False, timeout: Seconds | None = None
) -> Summary:
    """Perform a model's tool call; returns the tool's result, also where the call is refused or fails.

    robot: as `connect` gives it.
    call: the input of the tool, as its API gives it, decoded or as JSON; also in a fence, or encoded once more.
    await_answer: if it ends a turn, return only when that has been answered, or it is too late.
    timeout: seconds to wait for it to be accepted; None: for ever.
    """
    try:
        fragment = call_in(call, robot._unnamed())
        return summary(await robot.perform(fragment, await_answer=await_answer, timeout=timeout))
    except EngageError as error:
        return summary_of(error)


def summary_of(error: EngageError) -> Summary:
    """Summary of a fragment for which `Robot.perform` raised `error`."""
    return summary(_outcome_of(error, ""))


def _outcome_of(error: EngageError, id: str) -> FragmentOutcome:
    if isinstance(error, PerformFailed) and isinstance(error.outcome, FragmentOutcome):
        return error.outcome
    is_unknown = isinstance(error, OutcomeUnknown)
    return FragmentOutcome(id=id, fragment=id, status="unknown" if is_unknown else "refused", fault=error.fault)


async def stream(
    robot: Robot,
    pieces: AsyncIterable[Piece],
    *,
    id: str,
    turn: ToolInput = PLAIN_TURN,
    chunker: Chunker | None = None,
    await_answer: bool = False,
) -> tuple[FragmentOutcome, ...]:
    """Speak the pieces as they come, as one turn; returns the outcomes of its fragments `<id>-1`, `<id>-2`...

    Where a fragment is refused, fails or is interrupted no more pieces are read, and the outcomes say so. Cancelling
    this interrupts the robot, and so does what `pieces` raises.

    robot: as `connect` gives it.
    pieces: bits of text, however short, in which `[id]` refers to an object; or parts by themselves.
    id: of the turn; its fragments are named by it.
    turn: what concerns the whole turn (parts and status are found here); with `thinking` the robot looks away while
    pieces fail to come.
    chunker: what makes clauses of the pieces; None: as is usual.
    await_answer: return only when the turn has been answered, or it is too late.

    Raises:
        InputRefused: `pieces` cannot be followed, or `turn` is no `ToolInput`, and nothing was said; or a piece is
            neither text nor a part, and the turn is broken off there.
        Exception: what `pieces` raised.
    """
    if not isinstance(pieces, AsyncIterable):
        raise InputRefused(_unreadable(f"{type(pieces).__name__!r} is no asynchronous iterable of pieces", id))
    if not isinstance(turn, ToolInput):
        raise InputRefused(
            Fault(reason=f"{turn!r:.60} is no ToolInput", where=f"{id}: turn", advice=f"for example {PLAIN_TURN!r}")
        )
    speaking = _Speaking(robot, id, turn, await_answer)
    try:
        async with speaking.watched(), asyncio.TaskGroup() as tasks:
            read = _read(robot, pieces, chunker or Chunker(), speaking)
            reading = tasks.create_task(read, name=f"read {id}")
            speaking.begin(tasks, reading)
    except BaseException as error:
        speaking.break_off()
        if isinstance(error, BaseExceptionGroup) and len(error.exceptions) == 1:
            only = error.exceptions[0]
            raise (InputRefused(only.fault) if isinstance(only, _NoPiece) else only) from only.__cause__
        raise
    await speaking.leave_no_turn_open()
    return speaking.outcomes


class _NoPiece(InputRefused):
    """A piece that cannot be spoken."""


def _unreadable(reason: str, id: str) -> Fault:
    shown = reason if len(reason) <= 200 else f"{reason[:197]}..."
    return Fault(reason=shown, where=id, advice="an `async def` that yields text; or `perform_call`")


async def _read(robot: Robot, pieces: AsyncIterable[Piece], chunker: Chunker, speaking: "_Speaking") -> None:
    with robot.worlds() as worlds:
        objects = _Objects(worlds, robot.now)
        try:
            async for piece in pieces:
                if not isinstance(piece, Piece):
                    raise _NoPiece(_unreadable(f"the piece {piece!r} is neither text nor a `Part`", speaking.id))
                ids = await objects.ids(is_needed=isinstance(piece, str) and "[" in piece)
                for chunk in chunker.feed(piece, ids):
                    speaking.go_on(chunk)
            chunk = chunker.rest(await objects.ids(is_needed=False))
            speaking.left_out = chunker.left_out
            speaking.finish(chunk)
        finally:
            speaking.left_out += chunker.left_out


class _Objects:
    """Ids of the objects in the world as it is, with those that are covered for a moment."""

    def __init__(self, worlds: Feed[World], now: Callable[[], Seconds]) -> None:
        self._worlds = worlds
        self._now = now
        self._objects = CoveredObjects(COVERED_FOR)
        self._ids = UNKNOWN
        self._until = now() + WORLD_PATIENCE

    async def ids(self, *, is_needed: bool) -> Ids:
        """Return the ids, or `UNKNOWN`. is_needed: wait for a world that nobody has told yet."""
        patience = max(0.0, self._until - self._now()) if is_needed and self._ids.is_unknown else 0.0
        while (world := await self._worlds.next(patience)) is not None:
            self._objects.see(world, self._now())
            patience = 0.0
        if (known := self._objects.at(self._now())) is not None:
            found = frozenset(each.id for each in known.objects)
            self._ids = self._ids if not self._ids.is_unknown and found == self._ids.ids else Ids(found)
        return self._ids


class _Speaking:
    """The fragments of one turn, each performed by a task of its own."""

    def __init__(self, robot: Robot, id: str, turn: ToolInput, await_answer: bool) -> None:
        self._robot = robot
        self.id = id
        self._turn = turn
        self._await_answer = await_answer
        self._performing: list[asyncio.Task[FragmentOutcome]] = []
        self.left_out: tuple[str, ...] = ()
        """What of the text was not said, or otherwise than it may have been meant."""
        self._sent: set[str] = set()
        """Ids of the fragments with a task that has begun, and so has sent its request."""
        self._is_finished = False
        self._closed: TurnClosed | None = None
        """Set when the turn was aborted while no piece came."""

    @asynccontextmanager
    async def watched(self) -> AsyncIterator[None]:
        """Read no more as soon as the turn is over, though no fragment is: somebody spoke while no piece came."""
        with self._robot.turns() as turns:
            watching = asyncio.create_task(self._watch(turns), name=f"turn {self.id}")
            try:
                yield
            finally:
                watching.cancel()
                await asyncio.gather(watching, return_exceptions=True)

    async def _watch(self, turns: Feed[TurnClosed]) -> None:
        async for closed in turns:
            if closed.turn == f"{self.id}-1" and closed.status == "aborted" and not self._reading.done():
                self._closed = closed
                self._reading.cancel()

    def begin(self, tasks: asyncio.TaskGroup, reading: "asyncio.Task[None]") -> None:
        self._tasks = tasks
        self._reading = reading

    @property
    def outcomes(self) -> tuple[FragmentOutcome, ...]:
        outcomes = [task.result() for task in self._performing]
        if (closed := self._closed) is not None and {each.status for each in outcomes} == {"done"}:
            id, fault = self._fragment((), "end").id, Fault(reason=closed.reason, where=self.id)
            heard = closed.heard
            cut = FragmentOutcome(
                id=id, fragment=id, status="interrupted", events=closed.events, heard=heard, fault=fault
            )
            outcomes.append(self._robot._with_new_words(cut))
        if outcomes and self.left_out:
            told = tuple(dict.fromkeys((*outcomes[-1].warnings, *self.left_out)))
            outcomes[-1] = replace(outcomes[-1], warnings=told)
        return tuple(outcomes)

    def go_on(self, chunk: Chunk) -> None:
        self._send(chunk, "middle" if self._performing else "beginning")

    def finish(self, chunk: Chunk) -> None:
        """Send the last chunk, with which the turn ends. Where nobody has written anything there is no turn."""
        if self._performing or chunk or self.left_out:
            self._send(chunk, "end" if self._performing else "full")

    async def leave_no_turn_open(self) -> None:
        """End a turn of which a fragment was refused: that may have been the one to end it, or the last one read."""
        statuses = [task.result().status for task in self._performing]
        if "refused" in statuses[1:] and statuses[0] != "refused":
            with suppress(EngageError):  # there was none
                await self._robot.perform(self._fragment((), "end"))

    def break_off(self) -> None:
        """End the turn after a break in which the robot was silent: no fragment was interrupted, so it is open."""
        sent = [task for task in self._performing if task.get_name() in self._sent]
        ended = [task.result() for task in sent if not task.cancelled() and task.exception() is None]
        is_silent = bool(sent) and [outcome.status for outcome in ended] == ["done"] * len(sent)
        if is_silent and (len(sent) < len(self._performing) or not self._is_finished):
            self._robot.begin_to_perform(self._fragment((), "end"))

    def _send(self, chunk: Chunk, status: TurnStatus) -> None:
        self._is_finished = status in ("end", "full")
        fragment = self._fragment(chunk, status)
        # Requests keep the order of these tasks: each is sent in its task's first step.
        self._performing.append(self._tasks.create_task(self._perform(fragment), name=fragment.id))

    def _fragment(self, chunk: Chunk, status: TurnStatus) -> TurnFragment:
        id = f"{self.id}-{len(self._performing) + 1}"
        return fragment_of(chunk, replace(self._turn, turn_status=status), id)

    async def _perform(self, fragment: TurnFragment) -> FragmentOutcome:
        self._sent.add(fragment.id)
        try:
            outcome = await self._robot.perform(fragment, await_answer=self._await_answer)
        except EngageError as error:
            outcome = _outcome_of(error, fragment.id)
        if outcome.status != "done":
            self._reading.cancel()
        return outcome
