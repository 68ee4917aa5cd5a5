"""Pipecat: a processor that speaks through the robot, in the place of a text-to-speech service and of the output.

    Pipeline([transport.input(), stt, context.user(), llm, RobotSpeech(robot), context.assistant()])

Text of a response goes to the robot as it comes, `[id]` in it refers to an object. Behind the processor each word
appears when it has sounded (`TTSTextFrame`), so that the context has what people have heard, and nothing of what was
cut. Tried with pipecat-ai 1.14.
"""

import asyncio

from pipecat.frames.frames import (
    BotStartedSpeakingFrame,
    BotStoppedSpeakingFrame,
    CancelFrame,
    EndFrame,
    Frame,
    InputTextRawFrame,
    InterimTranscriptionFrame,
    InterruptionFrame,
    LLMAssistantPushAggregationFrame,
    LLMFullResponseEndFrame,
    LLMFullResponseStartFrame,
    StopFrame,
    TextFrame,
    TranscriptionFrame,
    TranslationFrame,
    TTSSpeakFrame,
    TTSStartedFrame,
    TTSStoppedFrame,
    TTSTextFrame,
)
from pipecat.processors.frame_processor import FrameDirection, FrameProcessor

from engage_hri.schemas.faults import EngageError
from engage_hri.schemas.summary import Summary
from engage_hri.schemas.tool import ToolInput
from engage_hri.services.client.language_models import PLAIN_TURN
from engage_hri.services.client.robot import Robot
from engage_hri.services.frameworks.written_turn import WrittenTurn

NOT_SPOKEN = (TranscriptionFrame, InterimTranscriptionFrame, TranslationFrame, InputTextRawFrame)
"""Frames with text that people have said."""
WORD = "word"
"""Type of the text of a `TTSTextFrame`."""


class RobotSpeech(FrameProcessor):  # type: ignore[misc]
    """Speaks responses through a robot. Its event `on_turn_over` has the `Summary`: looks, answer, what was cut.

    robot: as `connect` gives it. turn: what concerns each turn, its addressee for example.
    """

    def __init__(self, robot: Robot, *, turn: ToolInput = PLAIN_TURN) -> None:
        super().__init__()
        self._robot = robot
        self._options = turn
        self._numbers = 0
        self._turn: WrittenTurn | None = None
        self._following: asyncio.Task[None] | None = None
        self._is_response = False
        """True from the start of a response of a model to its end."""
        self._is_interrupted = False
        """True if the pipeline has interrupted the turn: then nobody has to be told."""
        self._register_event_handler("on_turn_over")

    async def process_frame(self, frame: Frame, direction: FrameDirection) -> None:
        """Take a frame: text is spoken, the ends wait for the robot, all else passes."""
        await super().process_frame(frame, direction)
        match frame:
            case _ if direction is not FrameDirection.DOWNSTREAM:
                await self.push_frame(frame, direction)
            case InterruptionFrame() | CancelFrame():
                await self._stop()
                await self.push_frame(frame, direction)
            case LLMFullResponseStartFrame():
                await self._silence()
                self._is_response = True
                await self.push_frame(frame, direction)
            case LLMFullResponseEndFrame():
                self._is_response = False
                await self._end(frame)
            case TTSSpeakFrame():
                await self._silence()
                self._write(frame.text)
                is_kept = frame.append_to_context
                await self._end(LLMAssistantPushAggregationFrame() if is_kept else None)
            case EndFrame() | StopFrame():
                if self._turn is not None:
                    self._turn.end()
                await self._silence()
                await self.push_frame(frame, direction)
            case TextFrame() if not isinstance(frame, NOT_SPOKEN) and not frame.skip_tts:
                self._write(frame.text)
                if not self._is_response:
                    await self._end(None)
            case _:
                await self.push_frame(frame, direction)

    async def cleanup(self) -> None:
        """Stop the robot."""
        await self._stop()
        await super().cleanup()

    def _write(self, text: str) -> None:
        if self._turn is None:
            self._begin()
        assert self._turn is not None
        self._turn.write(text)

    def _begin(self) -> None:
        self._numbers += 1
        words: asyncio.Queue[str | None] = asyncio.Queue()
        id = f"pipecat-{self._robot.id}-{self.id}-{self._numbers}"
        self._is_interrupted = False
        turn = WrittenTurn(
            self._robot, id, turn=self._options, on_start=lambda: words.put_nowait(""), on_word=words.put_nowait
        )
        self._turn, self._closing = turn, None
        self._following = asyncio.create_task(self._follow(turn, words), name=f"frames of {id}")

    async def _end(self, closing: Frame | None) -> None:
        """Let the turn end. closing: the frame that follows its last word."""
        if self._turn is None:
            if closing is not None:
                await self.push_frame(closing)
        else:
            self._closing = closing
            self._turn.end()

    async def _silence(self) -> None:
        """Wait until the turn before is over."""
        if self._following is not None:
            await asyncio.shield(self._following)

    async def _stop(self) -> None:
        self._is_response = False
        if self._turn is not None and self._following is not None:
            self._is_interrupted = True
            self._turn.stop()
            await asyncio.shield(self._following)

    async def _follow(self, turn: WrittenTurn, words: "asyncio.Queue[str | None]") -> None:
        """Push a frame for each word that sounds, and those at the end."""
        over = asyncio.ensure_future(turn.over())
        over.add_done_callback(lambda _: words.put_nowait(None))
        has_begun, said = False, 0
        try:
            while (word := await words.get()) is not None:
                if not has_begun:
                    has_begun = True
                    await self.push_frame(TTSStartedFrame())
                    await self.broadcast_frame(BotStartedSpeakingFrame)
                if word:
                    said += 1
                    await self.push_frame(TTSTextFrame(word, WORD))
            told: Summary = over.result()
            for word in told.said.split()[said:]:  # told by generation alone
                await self.push_frame(TTSTextFrame(word, WORD))
            if has_begun:
                await self.push_frame(TTSStoppedFrame())
                await self.broadcast_frame(BotStoppedSpeakingFrame)
            self._turn = self._following = None
            await self._call_event_handler("on_turn_over", told)
            if told.status != "done" and not self._is_interrupted:
                self._is_response = False
                await self.broadcast_interruption()  # a person has taken the floor, or the robot has failed
            elif self._closing is not None and not self._is_interrupted:
                await self.push_frame(self._closing)
        except EngageError as error:
            self._turn = self._following = None
            await self.push_error(str(error), exception=error)
        finally:
            over.cancel()
