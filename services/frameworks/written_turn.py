"""A turn of the robot that another program writes bit by bit, follows word by word, and may end at any word.

Voice frameworks differ in their frames and events, and agree in what they need of a voice: text comes in bits; they
are told when it begins to sound, which words have sounded, and that it is over; they may break it off, and then want
to know how far it got. `stream` alone takes an iterator and, if it is cancelled, tells nothing. Here a turn is an
object; what it said follows from generation's own account of the turn (`TurnClosed`) where it was broken off.
"""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable

from engage_hri.schemas.blocks import BlockProgress, Feedback
from engage_hri.schemas.body import WordSpoken
from engage_hri.schemas.faults import EngageError, Fault, InputRefused
from engage_hri.schemas.fragments import FragmentOutcome, TurnClosed
from engage_hri.schemas.summary import Summary, summary
from engage_hri.schemas.text import joined
from engage_hri.schemas.tool import ToolInput
from engage_hri.schemas.units import Seconds
from engage_hri.services.client.feeds import Feed
from engage_hri.services.client.language_models import PLAIN_TURN, Piece, stream, summary_of
from engage_hri.services.client.robot import Robot

LONGEST_TURN = 2**16
"""Characters of one turn, more than an hour of talk. What is written is kept until it has been said."""
ACCOUNT_PATIENCE: Seconds = 2.0
"""Time for which the account of a turn that was stopped is waited for: a voice ends its word, which takes less."""
BEGINNING: Seconds = 0.3
"""Time after a stop in which what was on its way to the robot has begun, or never will: nobody tells that of it."""

STEERING: Seconds = 5.0
"""Time that the realizer has to hold a block, or to let it go on."""


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
        self._robot = robot
        self._turn = turn
        self._await_answer = await_answer
        self._on_start = on_start
        self._on_word = on_word
        self._words: list[str] = []
        self._has_begun = False
        self._live: dict[str, None] = {}
        """Its blocks that have begun and not ended, in order."""
        self._waiting: asyncio.Queue[Piece | None] = asyncio.Queue()
        self._written = 0
        self._is_ended = self._is_stopped = False
        self._speaking: asyncio.Task[Summary] | None = None
        self._task = asyncio.create_task(self._run(), name=f"turn {id}")

    @property
    def said(self) -> str:
        """The words that have sounded so far; at the end exactly what was said, as `Summary.said`."""
        return self._task.result().said if self.is_over else joined(self._words)

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
        self._is_ended = self._is_stopped = True
        if self._speaking is not None:
            self._speaking.cancel()

    async def hold(self) -> None:
        """Let the robot wait at the next word, and where a movement can, until `resume`.

        Raises InputRefused if nothing of the turn is being performed at this moment.
        """
        await self._steer(self._robot.hold)

    async def resume(self) -> None:
        """Let it go on from there. Raises as `hold` does."""
        await self._steer(self._robot.resume)

    async def over(self) -> Summary:
        """Wait for the end of the turn, however it comes, and return what became of it. Cancelling this stops it."""
        try:
            return await asyncio.shield(self._task)
        except asyncio.CancelledError:
            self.stop()
            await asyncio.wait([self._task])
            raise

    async def _steer(self, steer: Callable[..., Awaitable[tuple[str, ...]]]) -> None:
        """Steer all blocks of the turn that are live: the next begins before the one that speaks has ended."""
        refusal = InputRefused(Fault(reason="nothing of it is being said", where=self.id))
        steered = False
        for block in tuple(self._live):
            try:
                steered |= bool(await steer(block, timeout=STEERING))
            except InputRefused as error:  # it has ended meanwhile
                refusal = error
        if not steered:
            raise refusal

    async def _run(self) -> Summary:
        with self._robot.words() as words, self._robot.feedback() as feedback, self._robot.turns() as turns:
            hearing = asyncio.create_task(self._hear(words), name=f"words of {self.id}")
            following = asyncio.create_task(self._follow(feedback), name=f"blocks of {self.id}")
            self._speaking = asyncio.create_task(self._speak(), name=f"speech of {self.id}")
            if self._is_stopped:  # before it began
                self._speaking.cancel()
            try:
                await asyncio.wait([self._speaking])
                if self._speaking.cancelled():
                    return await self._account(turns)
                return self._speaking.result()
            finally:
                for task in (tasks := (hearing, following, self._speaking)):
                    task.cancel()
                await asyncio.wait(tasks)

    async def _speak(self) -> Summary:
        try:
            outcomes = await stream(
                self._robot, self._pieces(), id=self.id, turn=self._turn, await_answer=self._await_answer
            )
        except EngageError as error:
            return summary_of(error)
        return summary(*outcomes)

    async def _pieces(self) -> AsyncIterator[Piece]:
        while (piece := await self._waiting.get()) is not None:
            yield piece

    async def _hear(self, words: Feed[WordSpoken]) -> None:
        async for word in words:
            if self._is_own(word.block):
                self._words.append(word.word)
                self._on_word(word.word)

    async def _follow(self, feedback: Feed[Feedback]) -> None:
        async for told in feedback:
            if not isinstance(told, BlockProgress) or told.block is None or not self._is_own(told.block):
                continue
            if told.progress == "end":
                self._live.pop(told.block, None)
                continue
            self._live[told.block] = None
            if not self._has_begun:
                self._has_begun = True
                self._on_start()

    def _is_own(self, block: str) -> bool:
        name, _, number = block.rpartition("-")
        return name == self.id and number.isdecimal()

    async def _account(self, turns: Feed[TurnClosed]) -> Summary:
        """Account of a turn that was stopped."""
        first = f"{self.id}-1"
        told = await self._closed(turns, first, BEGINNING)
        if told is None and self._has_begun:
            told = await self._closed(turns, first, ACCOUNT_PATIENCE - BEGINNING)
        stopped = FragmentOutcome(
            id=first,
            fragment=first,
            status="interrupted",
            unsaid=(self.id,),
            spoken=told.spoken if told else (),
            events=told.events if told else (),
            heard=told.heard if told else (),
            interjections=told.interjections if told else (),
            fault=Fault(reason="it was stopped", where=self.id),
        )
        return summary(self._robot._with_new_words(stopped))

    async def _closed(self, turns: Feed[TurnClosed], first: str, patience: Seconds) -> TurnClosed | None:
        deadline = self._robot.now() + patience
        while (told := await turns.next(max(0.0, deadline - self._robot.now()))) is not None:
            if told.turn == first:
                return told
        return None
