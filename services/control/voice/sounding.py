"""Voices that sound: a synthesizer in its own process, and a body of one part that says what it makes.

class MyVoice(SoundingVoice):
    name, synthesizer = "mine", MySynthesizer      # a driver: --voice my_voice.py:MyVoice
"""

import asyncio
import logging
import time
from collections.abc import AsyncGenerator, AsyncIterator, Awaitable, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from functools import partial
from math import inf
from typing import Any, ClassVar

from msgspec.structs import replace

from engage_hri.schemas.behaviors import BlockBehavior, Speech
from engage_hri.schemas.body_faults import BodyFault
from engage_hri.schemas.faults import InputRefused, RunFailed, raised_as
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.contract.body import (
    BehaviorRefused,
    BodyFailed,
    MovementAuthority,
    Progress,
)
from engage_hri.services.control.voice import player
from engage_hri.services.control.voice.espeak import EspeakSettings, EspeakSynthesizer
from engage_hri.services.control.voice.outlets import Outlet, Several, ToldSound, WavFile
from engage_hri.services.control.voice.speaker import Speaker
from engage_hri.services.control.voice.speaking import Part, expected, joined, silent, sounding, utter_parts
from engage_hri.services.control.voice.studio import MAKING, Studio
from engage_hri.services.control.voice.synthesis import SynthesisFailed, Synthesizer, VoiceSettings
from engage_hri.services.control.voice.timeline import Piece, Utterance, pieces, utter, uttered


class SoundingVoice(Speaker):
    """A voice with a synthesizer, as a body with one part. Subclass it, and say which.

    name: of the body. synthesizer: its class, with the type of its settings, which are those of the body, too.
    """

    name: ClassVar[str] = "voice"
    synthesizer: ClassVar[type[Synthesizer]]
    Settings: ClassVar[type[VoiceSettings]] = VoiceSettings

    def __init__(self, settings: Any = None) -> None:
        """Make the voice. settings: None: as they are by default."""
        super().__init__(self.name)
        self._settings: VoiceSettings = self.Settings() if settings is None else settings
        self._loop = asyncio.get_running_loop()
        takes = self.synthesizer.Settings is not None
        self._studio = Studio(self.synthesizer, self._settings if takes else None, self._settings.phrase_limit)
        self._studio.on_fault = lambda fault: self.on_fault(fault)
        self._outlet = Several(self._loop.time)
        self._player: player.Player | None = None
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
            if self._is_real and program is None and self._settings.device != "none":
                reason = "no program here plays sound, so the voice is heard in the pages of a window alone"
                logging.getLogger("engage").warning("control: %s (%s)", reason, player.INSTALL)
            if program is not None:
                self._player = player.Player(program, self._studio.rate)
                await stack.enter_async_context(self._player.connected())
                outlets.append(self._player)
            if self._settings.file:
                outlets.append(stack.enter_context(self._file()))
            for each in outlets:
                stack.callback(each.watch(partial(self._tell_fault, each)))
                self._tell_fault(each)
            outlets.append(
                ToldSound(
                    self._loop.time, self._studio.rate, lambda told: self.on_sound(told), lambda: self.wants_sound()
                )
            )
            self._outlet.outlets = outlets
            yield

    def _file(self) -> WavFile:
        name, origin = self._settings.file, self._loop.time() if self._is_real else 0.0
        advice = "it is the `file` of the voice; a relative path counts from the folder of the process"
        with raised_as(RunFailed, OSError, name, advice=advice):
            return WavFile(open(name, "wb", buffering=0), name, self._studio.rate, origin, self._loop.time)

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

    def timed(self, behavior: Speech) -> Utterance:
        found = pieces(behavior, self._settings.language)
        if not found:
            return uttered(behavior)
        self._studio.ask([piece.phrase for piece in found], self._wait)
        return joined([self._part(piece) or expected(piece, self._pace) for piece in found])

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

    async def said(self, behavior: Speech, authority: MovementAuthority) -> AsyncGenerator[Progress, None]:
        if self._player is not None:
            await self._player.ready()
            if (fault := self._player.fault) is not None:
                raise BehaviorRefused(replace(fault, where=behavior.id))
        self._outlet.revive()
        found = pieces(behavior, self._settings.language)
        self._want(found)
        part_of = partial(self._part_of, behavior, found)
        try:
            part_of(0)
        except BodyFailed as error:
            raise BehaviorRefused(error.fault) from error
        return utter_parts(
            behavior, authority, part_of, self._outlet, lambda shapes: self.on_lips(shapes), self._studio.watch
        )

    def _part_of(self, behavior: Speech, found: Sequence[Piece], number: int) -> Part | None:
        """The part of a number, if it is synthesized; else it is asked for. Raises BodyFailed."""
        if not found:
            return silent(behavior)
        try:
            if (part := self._part(found[number])) is None:
                self._want([found[number]])
                part = self._part(found[number])
            return part
        except SynthesisFailed as error:
            raise BodyFailed(replace(error.fault, where=behavior.id)) from error

    def _want(self, asked: Sequence[Piece]) -> None:
        """Ask for phrases, before all others."""
        self._studio.ask([piece.phrase for piece in asked], self._wait, first=True)


class EspeakVoice(SoundingVoice):
    """The voice `espeak`: eSpeak NG, with sound on a device, in a file, or nowhere."""

    name, synthesizer, Settings = "espeak", EspeakSynthesizer, EspeakSettings
