"""Client for managers that are language models: tool calls, and speaking while the model still writes.

    async with connect() as robot:
        result = await perform_call(robot, call)                        # the input of the tool of `schemas/tool.py`
        outcomes = await stream(robot, model_output(), id="turn-1")     # text, in which `[red-cup]` is an object
        print(result.json, summary(*outcomes).json)

Of a stream each clause is sent as soon as it is complete (chunking.py); generation performs one fragment right after
the other.
"""

from collections.abc import AsyncIterable
from typing import Any

from engage_hri.schemas.faults import EngageError, Fault, InputRefused
from engage_hri.schemas.fragments import FragmentOutcome
from engage_hri.schemas.summary import Summary, summary
from engage_hri.schemas.tool import ToolInput
from engage_hri.schemas.units import Seconds
from engage_hri.services.client.chunking import Chunker
from engage_hri.services.client.inputs import call_in, shown, taken
from engage_hri.services.client.outcomes import outcome_of, unreadable
from engage_hri.services.client.robot import Robot
from engage_hri.services.client.turn import Piece, RobotTurn

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
    return summary(outcome_of(error, ""))


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
        raise InputRefused(unreadable(f"{type(pieces).__name__!r} is no asynchronous iterable of pieces", id))
    if not isinstance(turn, ToolInput):
        raise InputRefused(
            Fault(reason=f"{shown(turn)} is no ToolInput", where=f"{id}: turn", advice=f"for example {PLAIN_TURN!r}")
        )
    async with RobotTurn(robot, id, turn, chunker, await_answer=await_answer) as speaking:
        async for piece in pieces:
            await speaking.write(piece)
    return speaking.outcomes
