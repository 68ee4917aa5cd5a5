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
from functools import cached_property
from typing import Any, Literal

from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.faults import EngageError, Fault, InputRefused, OutcomeUnknown
from engage_hri.schemas.fragments import FragmentOutcome, TurnClosed, TurnFragment, TurnStatus
from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.schemas.requests import Accepted
from engage_hri.schemas.summary import Summary, summary
from engage_hri.schemas.tool import Part, ToolInput, fragment_of
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import COVERED_FOR, CoveredObjects, World
from engage_hri.services.client.chunking import UNKNOWN, Chunk, Chunker
from engage_hri.services.client.feeds import Feed
from engage_hri.services.client.inputs import call_in, shown, taken
from engage_hri.services.client.robot import PerformFailed, Robot
from engage_hri.services.requests.ends import Patience, Pending
from engage_hri.services.text.pieces import Ids

Piece = str | Part
"""A bit of text, however short, in which `[id]` refers to an object; or a part by itself."""
WORLD_PATIENCE: Seconds = 0.3
"""Time from the start of a stream for which a bracket waits for the world: it alone says what a reference is."""
SETTLED: Seconds = 1.0
"""Silence after which a finished sentence is sent: bits of one sentence come faster, a look-up takes longer."""
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


def _outcome_of(error: EngageError, id: str, unsaid: tuple[str, ...] = ()) -> FragmentOutcome:
    if isinstance(error, PerformFailed) and isinstance(error.outcome, FragmentOutcome):
        return error.outcome
    is_unknown = isinstance(error, OutcomeUnknown)
    status: Literal["unknown", "refused"] = "unknown" if is_unknown else "refused"
    return FragmentOutcome(id=id, fragment=id, status=status, unsaid=unsaid, fault=error.fault)


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
        InputRefused: `pieces` cannot be followed, `id` is no text or `turn` no `ToolInput`, and nothing was said; or
            a piece is neither text nor a part, and the turn is broken off there.
        Exception: what `pieces` raised.
    """
    taken(id, str, "id")
    if not isinstance(pieces, AsyncIterable):
        raise InputRefused(_unreadable(f"{type(pieces).__name__!r} is no asynchronous iterable of pieces", id))
    if not isinstance(turn, ToolInput):
        raise InputRefused(
            Fault(reason=f"{shown(turn)} is no ToolInput", where=f"{id}: turn", advice=f"for example {PLAIN_TURN!r}")
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
        settling: asyncio.TimerHandle | None = None
        try:
            async for piece in pieces:
                if settling is not None:
                    settling.cancel()
                if not isinstance(piece, Piece):
                    raise _NoPiece(_unreadable(f"the piece {shown(piece)} is neither text nor a `Part`", speaking.id))
                ids = await objects.ids(is_needed=isinstance(piece, str) and "[" in piece)
                for chunk in chunker.feed(piece, ids):
                    speaking.go_on(chunk)
                settling = asyncio.get_running_loop().call_later(SETTLED, _settle, chunker, ids, speaking)
            chunk = chunker.rest(await objects.ids(is_needed=False))
            speaking.left_out = chunker.left_out
            speaking.finish(chunk)
        finally:
            if settling is not None:
                settling.cancel()
            speaking.left_out += chunker.left_out


def _settle(chunker: Chunker, ids: Ids, speaking: "_Speaking") -> None:
    """Send what is finished, since no piece comes."""
    for chunk in chunker.settled(ids):
        speaking.go_on(chunk)


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
        self._sent: dict[str, Pending] = {}
        """Fragments that were sent, by id."""
        self._line = asyncio.Lock()
        """Held by a fragment from when it is sent until it is accepted: of a turn that is refused no more is sent."""
        self._is_over = False
        """True once one was not accepted, or ended badly: no more are sent."""
        self._is_finished = False
        self._closed: TurnClosed | None = None
        """Set when the turn was aborted while no piece came."""

    @asynccontextmanager
    async def watched(self) -> AsyncIterator[None]:
        """Read no more as soon as the turn is over, though no fragment is: somebody spoke while no piece came."""
        kinds = (TurnClosed, PeerAlive, PeerGone)
        with self._robot._feed(kinds, keys.TURN_CLOSED, keys.ANY_ROBOT_ALIVE) as news:
            watching = asyncio.create_task(self._watch(news), name=f"turn {self.id}")
            try:
                yield
            finally:
                watching.cancel()
                await asyncio.gather(watching, return_exceptions=True)

    async def _watch(self, news: Feed[TurnClosed | PeerAlive | PeerGone]) -> None:
        gone_until: Seconds | None = None
        while True:
            patience = None if gone_until is None else max(0.0, gone_until - self._robot.now())
            match await news.next(patience):
                case TurnClosed(status="aborted") as closed if closed.turn == f"{self.id}-1":
                    if not self._reading.done():
                        self._closed = closed
                        self._reading.cancel()
                case PeerGone(participant="generation"):
                    gone_until = self._robot.now() + Patience().grace
                case PeerAlive(participant="generation"):
                    gone_until = None
                case None:
                    if gone_until is None:
                        return  # the client has ended
                    gone_until = None
                    self._lose()

    def _lose(self) -> None:
        """Send no more of a turn that has begun: another life of generation knows nothing of it."""
        accepted = {id for id, pending in self._sent.items() if pending.accepted.done()}
        if accepted:
            self._is_over = True
            self._reading.cancel()
            for task in self._performing:
                if task.get_name() not in accepted:
                    task.cancel()

    def begin(self, tasks: asyncio.TaskGroup, reading: "asyncio.Task[None]") -> None:
        self._tasks = tasks
        self._reading = reading

    @cached_property
    def outcomes(self) -> tuple[FragmentOutcome, ...]:
        """Outcomes of all that was sent, and of what never was; to be asked for when all tasks are done."""
        lost = OutcomeUnknown(Fault(reason="generation is gone", where=self.id))
        outcomes = [
            _outcome_of(lost, task.get_name()) if task.cancelled() else task.result() for task in self._performing
        ]
        if outcomes and self._reading.cancelled():
            rest = self._fragment((), "end").id
            if {each.status for each in outcomes} == {"done"}:
                outcomes.append(_outcome_of(lost, rest))
                if (closed := self._closed) is not None:
                    fault = Fault(reason=closed.reason, where=self.id)
                    cut = replace(
                        outcomes[-1],
                        status="interrupted",
                        events=closed.events,
                        heard=closed.heard,
                        interjections=closed.interjections,
                        fault=fault,
                    )
                    outcomes[-1] = self._robot._with_new_words(cut)
            outcomes[-1] = replace(outcomes[-1], unsaid=(*outcomes[-1].unsaid, rest))
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
        statuses = [each.status for each in self.outcomes]
        if "refused" in statuses[1:] and statuses[0] != "refused" and not {"interrupted", "unknown"} & {*statuses}:
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
        # Requests keep the order of these tasks: each stands in line in its task's first step.
        self._performing.append(self._tasks.create_task(self._perform(fragment), name=fragment.id))

    def _fragment(self, chunk: Chunk, status: TurnStatus) -> TurnFragment:
        id = f"{self.id}-{len(self._performing) + 1}"
        return fragment_of(chunk, replace(self._turn, turn_status=status), id)

    async def _perform(self, fragment: TurnFragment) -> FragmentOutcome:
        await self._line.acquire()
        if self._is_over:
            self._line.release()
            return FragmentOutcome(id=fragment.id, fragment=fragment.id, status="refused", unsaid=fragment.worded)
        try:
            pending = self._sent[fragment.id] = self._robot._send(fragment)
            pending.accepted.add_done_callback(self._decided)
            outcome = await self._robot._end_of(pending, await_answer=self._await_answer)
        except EngageError as error:
            outcome = _outcome_of(error, fragment.id, fragment.worded)
        if outcome.status != "done":
            self._is_over = True
            self._reading.cancel()
        if fragment.id not in self._sent:
            self._line.release()
        return outcome

    def _decided(self, accepted: "asyncio.Future[Accepted | None]") -> None:
        self._is_over |= accepted.exception() is not None
        self._line.release()
