"""LiveKit Agents: the output of a session is the robot: it says the text, and tells how far it has got.

    output = RobotOutput(robot)
    session = AgentSession(llm=..., stt=..., vad=..., tts=output.tts)
    output.attach(session)
    await session.start(agent)

A session plays audio and shows a transcript. Here the transcript is what is said, and `[id]` in it refers to an
object. The audio is a moment of silence for each speech, by which the session knows that there is one; its playback
lasts as long as the robot speaks. Where it is cut, the session's history has the words that were really said. While
the session thinks that somebody may interrupt (`pause`), the robot waits at a word. Tried with livekit-agents 1.8.
"""

import asyncio
import time
from collections.abc import Callable, Coroutine
from contextlib import suppress
from typing import Any

from livekit import rtc
from livekit.agents import DEFAULT_API_CONNECT_OPTIONS, APIConnectOptions, tts
from livekit.agents.utils import shortuuid
from livekit.agents.voice import AgentSession, io

from engage_hri.schemas.faults import InputRefused
from engage_hri.schemas.summary import Summary
from engage_hri.schemas.tool import ToolInput
from engage_hri.services.client.language_models import PLAIN_TURN
from engage_hri.services.client.robot import Robot
from engage_hri.services.frameworks.written_turn import WrittenTurn

RATE = 16000
"""Samples a second of the silence."""
MOMENT = bytes(2 * RATE // 50)
"""The silence of one speech, 20 ms."""


class RobotOutput:
    """The robot as the output of a session.

    robot: as `connect` gives it. turn: what concerns each turn, its addressee for example. on_turn_over: called with
    what became of each: looks, answer, what was cut.
    """

    def __init__(
        self,
        robot: Robot,
        *,
        turn: ToolInput = PLAIN_TURN,
        on_turn_over: Callable[[Summary], None] = lambda told: None,
    ) -> None:
        self.tts = SilentTTS()
        self.audio = RobotAudio(self)
        self.transcription = RobotTranscript(self)
        self._robot = robot
        self._options = turn
        self._on_turn_over = on_turn_over
        self._session: AgentSession[Any] | None = None
        self._numbers = 0
        self._turn: WrittenTurn | None = None
        self._told: Summary | None = None
        """What became of the turn, until the session is told."""
        self._is_playing = False
        """True while the session takes a speech to be played."""
        self._is_interrupted = False
        self._tasks: set[asyncio.Task[None]] = set()

    def attach(self, session: "AgentSession[Any]") -> None:
        """Put the robot in the place of the session's loudspeaker and of its transcript, before it starts."""
        self._session = session
        session.output.audio = self.audio
        session.output.transcription = self.transcription

    async def aclose(self) -> None:
        """Stop the robot, and wait until it is silent."""
        self._stop()
        while self._tasks:
            await asyncio.wait(self._tasks)

    def _write(self, text: str) -> None:
        if self._turn is None:
            self._numbers += 1
            id = f"livekit-{self._robot.id}-{shortuuid()}-{self._numbers}"
            self._is_interrupted = False
            self._turn = WrittenTurn(self._robot, id, turn=self._options, on_start=self._started)
            self._do(self._follow(self._turn))
        self._turn.write(text)

    def _end(self) -> None:
        if self._turn is not None:
            self._turn.end()

    def _play(self) -> None:
        """Take note that a speech is to be played."""
        self._is_playing = True
        self._finish()

    def _flushed(self) -> None:
        """Take note that there is no more of a speech: one without text is over."""
        if self._turn is None and self._told is None and self._is_playing:
            self._told = Summary(status="done")
        self._finish()

    def _stop(self) -> None:
        self._is_interrupted = True
        if self._turn is not None:
            self._turn.stop()
        self._flushed()

    def _started(self) -> None:
        self._began = time.time()
        self.audio.on_playback_started(created_at=self._began)

    async def _follow(self, turn: WrittenTurn) -> None:
        self._began = time.time()
        told = await turn.over()
        self._turn, self._told = None, told
        self._on_turn_over(told)
        if told.status != "done" and not self._is_interrupted and self._session is not None:
            with suppress(RuntimeError):  # it is over already
                self._session.interrupt(force=True)  # a person has taken the floor, or the robot has failed
        self._finish()

    def _finish(self) -> None:
        """Tell the session that the speech is over, if the robot has ended it and the session knows of it."""
        if self._told is not None and self._is_playing:
            told, self._told, self._is_playing = self._told, None, False
            self.audio.on_playback_finished(
                playback_position=time.time() - self._began if told.said else 0.0,
                interrupted=told.status != "done",
                synchronized_transcript=told.said,
            )

    def _steer(self, steer: Callable[[WrittenTurn], Coroutine[Any, Any, None]]) -> None:
        async def steered(turn: WrittenTurn) -> None:
            with suppress(InputRefused):  # nothing of it is being said any more, or yet
                await steer(turn)

        if self._turn is not None:
            self._do(steered(self._turn))

    def _do(self, what: Coroutine[Any, Any, None]) -> None:
        task = asyncio.create_task(what, name="robot of a session")
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)


class RobotAudio(io.AudioOutput):  # type: ignore[misc]
    """Loudspeaker whose playback is what the robot says."""

    def __init__(self, output: RobotOutput) -> None:
        super().__init__(label="robot", capabilities=io.AudioOutputCapabilities(pause=True), sample_rate=RATE)
        self._output = output

    async def capture_frame(self, frame: rtc.AudioFrame) -> None:
        """Take a frame: the first of a speech tells that there is one."""
        await super().capture_frame(frame)
        self._output._play()

    def flush(self) -> None:
        """Take note that a speech has no more frames."""
        super().flush()
        self._output._flushed()

    def clear_buffer(self) -> None:
        """Stop the robot at a word."""
        self._output._stop()

    def pause(self) -> None:
        """Hold the robot at a word."""
        self._output._steer(WrittenTurn.hold)

    def resume(self) -> None:
        """Let the robot go on."""
        self._output._steer(WrittenTurn.resume)


class RobotTranscript(io.TextOutput):  # type: ignore[misc]
    """Transcript that the robot says."""

    def __init__(self, output: RobotOutput) -> None:
        super().__init__(label="robot", next_in_chain=None)
        self._output = output

    async def capture_text(self, text: str) -> None:
        """Say text next."""
        self._output._write(text)

    def flush(self) -> None:
        """Take note that all of a speech is written."""
        self._output._end()


class SilentTTS(tts.TTS):  # type: ignore[misc]
    """Voice without a sound: a moment of silence for each speech."""

    def __init__(self) -> None:
        super().__init__(capabilities=tts.TTSCapabilities(streaming=True), sample_rate=RATE, num_channels=1)

    def synthesize(
        self, text: str, *, conn_options: APIConnectOptions = DEFAULT_API_CONNECT_OPTIONS
    ) -> tts.ChunkedStream:
        """Make the silence of a text."""
        return self._synthesize_with_stream(text, conn_options=conn_options)

    def stream(self, *, conn_options: APIConnectOptions = DEFAULT_API_CONNECT_OPTIONS) -> "SilentStream":
        """Make the silence of a text that comes in bits."""
        return SilentStream(tts=self, conn_options=conn_options)


class SilentStream(tts.SynthesizeStream):  # type: ignore[misc]
    """Silence of a text that comes in bits."""

    async def _run(self, output_emitter: tts.AudioEmitter) -> None:
        output_emitter.initialize(
            request_id=shortuuid(), sample_rate=RATE, num_channels=1, mime_type="audio/pcm", stream=True
        )
        is_in_segment = False
        async for piece in self._input_ch:
            if isinstance(piece, self._FlushSentinel):
                if is_in_segment:
                    output_emitter.end_segment()
                is_in_segment = False
            elif not is_in_segment and piece.strip():
                is_in_segment = True
                self._mark_started()
                output_emitter.start_segment(segment_id=shortuuid())
                output_emitter.push(MOMENT)
                output_emitter.flush()
