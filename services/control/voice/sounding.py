"""Voices that sound: a synthesizer in its own process, and a body of one part that says what it makes.

class MyVoice(SoundingVoice):
    name, synthesizer = "mine", MySynthesizer      # a driver: --voice my_voice.py:MyVoice
"""

import asyncio
import time
from collections.abc import AsyncGenerator, AsyncIterator, Awaitable, Callable, Sequence
from contextlib import AsyncExitStack, aclosing, asynccontextmanager
from functools import partial
from math import inf
from typing import Any, ClassVar

from msgspec.structs import replace

from engage_hri.schemas.behaviors import BlockBehavior, Speech
from engage_hri.schemas.body import BodyPose, Capabilities, Estimate
from engage_hri.schemas.body_faults import BodyFault
from engage_hri.schemas.faults import Fault, InputRefused, RunFailed
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import World
from engage_hri.services.control.contract.bell import Bell
from engage_hri.services.control.contract.body import (
    BehaviorRefused,
    BodyFailed,
    MovementAuthority,
    Progress,
    Reached,
)
from engage_hri.services.control.contract.refusals import unsupported
from engage_hri.services.control.voice import player
from engage_hri.services.control.voice.espeak import EspeakSettings, EspeakSynthesizer
from engage_hri.services.control.voice.estimate import speech_estimate
from engage_hri.services.control.voice.outlets import Gag, Nowhere, Outlet, Several
from engage_hri.services.control.voice.parts import Part, expected, joined, silent, sounding, unspeakable
from engage_hri.services.control.voice.phrases import Piece, pieces
from engage_hri.services.control.voice.settings import VoiceSettings
from engage_hri.services.control.voice.speaker import FAULTS, Speaker, speech, voiceless
from engage_hri.services.control.voice.speaking import Parts, utter_parts
from engage_hri.services.control.voice.studio import MAKING, Studio
from engage_hri.services.control.voice.synthesis import SynthesisFailed, Synthesizer
from engage_hri.services.control.voice.timeline import utter, uttered
from engage_hri.services.control.voice.wav import WavFile


class SoundingVoice(Speaker):
    """A voice with a synthesizer, as a body with one part. Subclass it, and say which.

    name: of the body. synthesizer: its class, with the type of its settings, which are those of the body, too.
    """

    name: ClassVar[str] = "voice"
    synthesizer: ClassVar[type[Synthesizer]]
    Settings: ClassVar[type[VoiceSettings]] = VoiceSettings

    def __init__(self, settings: Any = None) -> None:
        """Make the voice. settings: None: as they are by default."""
        super().__init__()
        self._settings: VoiceSettings = self.Settings() if settings is None else settings
        self.capabilities = Capabilities(body=self.name, types=("speech",), parts=("voice",), faults=FAULTS)
        self._loop = asyncio.get_running_loop()
        takes = self.synthesizer.Settings is not None
        self._studio = Studio(self.synthesizer, self._settings if takes else None, self._settings.phrase_limit)
        self._studio.on_fault = lambda fault: self.on_fault(fault)
        self._outlet = Gag(Nowhere(self._loop.time), self._loop.time)
        self._player: player.Player | None = None
        self._wav: WavFile | None = None
        self._pace = 1.0
        """How much longer this voice takes than the model of `timeline`, from what it has said so far."""

    @property
    def _is_real(self) -> bool:
        """True if loop time is real time: in virtual time nobody waits by the clock, and nothing is played."""
        return abs(self._loop.time() - time.monotonic()) < 1.0

    @property
    def _wait(self) -> Seconds:
        """Seconds by the clock for which the loop may stand still for a phrase."""
        return 0.0 if self._is_real else inf

    @asynccontextmanager
    async def connected(self) -> AsyncIterator[None]:
        async with AsyncExitStack() as stack:
            stack.callback(self._studio.close)
            try:
                if self._is_real:
                    self._studio.listen(self._loop)
                    await self._studio.made()
                else:
                    self._studio.make(2 * MAKING)
            except SynthesisFailed as error:
                raise InputRefused(error.fault) from error
            outlets: list[Outlet] = []
            program = player.found(self._settings) if self._is_real else None
            if program is not None:
                self._player = player.Player(program, self._studio.rate)
                await stack.enter_async_context(self._player.connected())
                outlets.append(self._player)
            if self._settings.file:
                self._wav = stack.enter_context(self._file())
                outlets.append(self._wav)
            for each in outlets:
                stack.callback(each.watch(partial(self._tell_fault, each)))
                self._tell_fault(each)
            if outlets:
                self._outlet.outlet = Several(outlets)
            yield

    def _file(self) -> WavFile:
        name, origin = self._settings.file, self._loop.time() if self._is_real else 0.0
        try:
            return WavFile(open(name, "wb", buffering=0), name, self._studio.rate, origin, self._loop.time)
        except OSError as error:
            advice = "it is the `file` of the voice; a relative path counts from the folder of the process"
            raise RunFailed(Fault(reason=error.strerror or str(error), where=name, advice=advice)) from error

    def _tell_fault(self, outlet: Outlet) -> None:
        if outlet.fault is not None:
            self.on_fault(outlet.fault)

    def switch_faults(self, faults: Sequence[BodyFault]) -> None:
        super().switch_faults(faults)
        self._outlet.switch(is_mute=self._voice.is_mute)

    # -- planning -----------------------------------------------------------------------------------------------

    def prepare(self, behaviors: Sequence[BlockBehavior]) -> Awaitable[None] | None:
        speeches = [each for each in behaviors if isinstance(each, Speech)]
        phrases = [piece.phrase for each in speeches for piece in pieces(each, self._settings.language)]
        if not self._is_real or self._studio.ask(phrases, 0.0):
            return None
        return self._studio.asked(phrases, self._settings.patience)

    def estimate(self, behavior: BlockBehavior, pose: BodyPose | None, world: World) -> Estimate:
        if not isinstance(behavior, Speech):
            return unsupported(behavior)
        if self._is_voiceless:
            return unspeakable(behavior, voiceless(behavior))
        found = pieces(behavior, self._settings.language)
        if not found:
            return speech_estimate(behavior, uttered(behavior), pose or BodyPose())
        self._studio.ask([piece.phrase for piece in found], self._wait)
        try:
            parts = [self._part(piece) or expected(piece, self._pace) for piece in found]
        except SynthesisFailed as error:
            return unspeakable(behavior, error.fault)
        warnings = [each for piece in found for each in self.synthesizer.warnings(piece.phrase)]
        return speech_estimate(behavior, joined(parts, len(behavior.text)), pose or BodyPose(), warnings)

    def _part(self, piece: Piece) -> Part | None:
        """The part of a phrase, if it is synthesized. Raises SynthesisFailed."""
        clause = self._studio.known(piece.phrase)
        if clause is None:
            return None
        model = utter(piece.phrase.text, prosody=piece.phrase.prosody).seconds
        if model > 0.5:
            self._pace += 0.1 * (clause.seconds / model - self._pace)
        return sounding(piece, clause)

    # -- speaking -----------------------------------------------------------------------------------------------

    async def perform(self, behavior: BlockBehavior, authority: MovementAuthority) -> AsyncGenerator[Progress, None]:
        behavior = speech(behavior)
        if self._is_voiceless:
            raise BehaviorRefused(voiceless(behavior))
        await self._voice.wait_for_silence(authority)
        if authority.revoked is not None:
            return
        if self._player is not None:
            await self._player.ready()
            if (fault := self._player.fault) is not None:
                raise BehaviorRefused(replace(fault, where=behavior.id))
        if self._wav is not None:
            self._wav.revive()
        self._outlet.revive()
        parts = _Phrases(behavior, self)
        if (refused := parts.refused()) is not None:
            raise BehaviorRefused(replace(refused, where=behavior.id))
        words = utter_parts(behavior, authority, parts, self._outlet, lambda shapes: self.on_lips(shapes))
        async with aclosing(self._voice.say(behavior, authority, words)) as utterance:
            async for progress in utterance:
                yield progress
                if isinstance(progress, Reached) and progress.sync == "end":
                    return
        if self._is_voiceless:
            raise BodyFailed(voiceless(behavior))

    def parts_of(self, behavior: Speech) -> Sequence[Piece]:
        """Cut a speech into phrases, and have them synthesized."""
        found = pieces(behavior, self._settings.language)
        self._studio.ask([piece.phrase for piece in found], self._wait, first=True)
        return found


class _Phrases(Parts):
    """The parts of a speech, as its phrases are synthesized."""

    def __init__(self, behavior: Speech, voice: SoundingVoice) -> None:
        self._behavior, self._voice = behavior, voice
        self._pieces = voice.parts_of(behavior)

    def refused(self) -> Fault | None:
        """The reason why the first phrase cannot be said; None: it can, or it is not known yet."""
        try:
            self.part(0)
        except BodyFailed as error:
            return error.fault
        return None

    def part(self, number: int) -> Part | None:
        if not self._pieces:
            return silent(self._behavior)
        voice, piece = self._voice, self._pieces[number]
        try:
            if (part := voice._part(piece)) is None:
                voice._studio.ask([piece.phrase], voice._wait, first=True)
                part = voice._part(piece)
            return part
        except SynthesisFailed as error:
            raise BodyFailed(replace(error.fault, where=self._behavior.id)) from error

    def watch(self, bell: Bell) -> Callable[[], None]:
        self._voice._studio.watch(bell)
        return lambda: self._voice._studio.unwatch(bell)


class EspeakVoice(SoundingVoice):
    """The voice `espeak`: eSpeak NG, with sound on a device, in a file, or nowhere."""

    name, synthesizer, Settings = "espeak", EspeakSynthesizer, EspeakSettings
