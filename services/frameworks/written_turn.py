"""A turn of the robot that another program writes bit by bit, follows word by word, and may end at any word.

Voice frameworks differ in their frames and events, and agree in what they need of a voice: text comes in bits; they
are told when it begins to sound, which words have sounded, and that it is over; they may break it off, and then want
to know how far it got. `RobotTurn` is all that, for a body that awaits. A framework calls, and waits for nothing: so
what it writes waits here in a line, and a task is the body.
"""

import asyncio
from collections.abc import Callable, Iterator
from contextlib import suppress

from engage_hri.schemas.faults import EngageError, Fault, InputRefused
from engage_hri.schemas.fragments import FragmentOutcome
from engage_hri.schemas.summary import Summary, summary
from engage_hri.schemas.tool import ToolInput
from engage_hri.services.client.language_models import PLAIN_TURN, summary_of
from engage_hri.services.client.robot import Robot
from engage_hri.services.client.turn import Piece, RobotTurn

LONGEST_TURN = 2**16
"""Characters of one turn, more than an hour of talk. What is written is kept until it has been said."""


class WrittenTurn:
    """A turn that begins at once, on the loop that makes it. Await `over` to the end, whatever becomes of it.

    robot: as `connect` gives it. id: of the turn, which no other one has. turn: what concerns the whole turn.
    await_answer: it is over only when it has been answered, or it is too late.
    on_start: called when the robot begins. on_word: called with each word when it has sounded.
    """

    def __init__(
        self,
        robot: Robot,
        id: str,
        *,
        turn: ToolInput = PLAIN_TURN,
        await_answer: bool = False,
        on_start: Callable[[], None] = lambda: None,
        on_word: Callable[[str], None] = lambda word: None,
    ) -> None:
        self.id = id
        self._turn = RobotTurn(robot, id, turn, await_answer=await_answer)
        self._on_start = on_start
        self._on_word = on_word
        self._waiting: asyncio.Queue[Piece | None] = asyncio.Queue()
        self._written = 0
        self._is_ended = self._is_stopped = False
        self._speaking: asyncio.Task[None] | None = None
        self._task = asyncio.create_task(self._run(), name=f"turn {id}")

    @property
    def said(self) -> str:
        """The words that have sounded so far; at the end exactly what was said, as `Summary.said`."""
        return self._task.result().said if self.is_over else self._turn.said

    @property
    def is_over(self) -> bool:
        """True once nothing more is said."""
        return self._task.done() and not self._task.cancelled() and self._task.exception() is None

    def write(self, piece: Piece) -> None:
        """Add text, in which `[id]` refers to an object, or a part. It is dropped if the turn is over.

        Raises InputRefused: the turn has ended, or becomes longer than `LONGEST_TURN`; it goes on without the piece.
        """
        if self._is_ended and not self._task.done():
            raise InputRefused(Fault(reason="the turn has been ended, and takes no more text", where=self.id))
        length = len(piece) if isinstance(piece, str) else len(repr(piece))
        if self._written + length > LONGEST_TURN:
            advice = "end the turn, and go on in another one"
            reason = f"the turn becomes longer than {LONGEST_TURN} characters"
            raise InputRefused(Fault(reason=reason, where=self.id, advice=advice))
        self._written += length
        if not self._task.done():
            self._waiting.put_nowait(piece)

    def end(self) -> None:
        """Say that no more is written. The turn goes on until all is said, and is then the person's."""
        if not self._is_ended:
            self._is_ended = True
            self._waiting.put_nowait(None)

    def stop(self) -> None:
        """End the turn at the next word. `over` tells what was said until then."""
        if not self._is_stopped and self._speaking is not None:
            self._speaking.cancel()  # once: it may be stopping already, and then it tells what was said
        self._is_ended = self._is_stopped = True

    async def hold(self) -> None:
        """Let the robot wait at the next word, and where a movement can, until `resume`.

        Raises InputRefused if nothing of the turn is being performed at this moment.
        """
        self._check_live()
        await self._turn.hold()

    async def resume(self) -> None:
        """Let it go on from there. Raises as `hold` does."""
        self._check_live()
        await self._turn.resume()

    async def over(self) -> Summary:
        """Wait for the end of the turn, however it comes, and return what became of it. Cancelling this stops it."""
        try:
            return await asyncio.shield(self._task)
        except asyncio.CancelledError:
            self.stop()
            await asyncio.wait([self._task])
            raise

    def _check_live(self) -> None:
        if not self._turn.is_performed:
            raise InputRefused(Fault(reason="nothing of it is being said", where=self.id))

    async def _run(self) -> Summary:
        beginning = asyncio.create_task(self._begin(), name=f"start of {self.id}")
        hearing = asyncio.create_task(self._hear(), name=f"words of {self.id}")
        self._speaking = asyncio.create_task(self._speak(), name=f"speech of {self.id}")
        try:
            with suppress(asyncio.CancelledError):  # it was stopped, which is no error of whoever waits
                await self._speaking
            return summary(*self._turn.outcomes, *self._never_written())
        except EngageError as error:
            return summary_of(error)
        finally:
            for task in (beginning, hearing):
                task.cancel()
            await asyncio.wait([beginning, hearing])

    def _never_written(self) -> Iterator[FragmentOutcome]:
        """Outcome of what was still in line when the turn was stopped: the turn itself knows nothing of it."""
        waits = not self._waiting.empty() and self._waiting.get_nowait() is not None
        if self._is_stopped and (waits or self._turn.unsaid):
            stopped = Fault(reason="it was stopped", where=self.id)
            yield FragmentOutcome(
                id=self.id, fragment=self.id, status="interrupted", unsaid=(self.id,), fault=stopped
            )

    async def _speak(self) -> None:
        if self._is_stopped:
            return
        async with self._turn as turn:
            while (piece := await self._waiting.get()) is not None:
                await turn.write(piece)

    async def _hear(self) -> None:
        async for word in self._turn.words():
            self._on_word(word)

    async def _begin(self) -> None:
        await self._turn.begun()
        self._on_start()
