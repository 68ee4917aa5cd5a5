"""A sound device, by the player program of its system, fed through a pipe. Whatever blocks there blocks the player.

A player starts as soon as it has a little sound, and then consumes what it has in real time. So the moment at which a
sample is heard is known: where the pipe is empty `latency` after it was written, else right after the sample before
it.
"""

import asyncio
import shutil
import subprocess
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from math import inf
from typing import NamedTuple

from engage_hri.schemas.faults import Fault, InputRefused, RunFailed
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.voice.outlets import STUCK
from engage_hri.services.control.voice.pipe import FedProcess
from engage_hri.services.control.voice.settings import VoiceSettings

MARGIN: Seconds = 0.08
"""How much earlier than needed sound is handed over: for the buffer of the player, and a loop that is late."""
FLUSH: Seconds = 0.12
"""Silence after the last sound: a player may keep a little until there is more."""
LATE: Seconds = 0.02
"""So much sound may be due that the player has not taken, before what is told waits for it."""
STARTING: Seconds = 3.0
"""So long a player that was just started may take nothing: a device may have to wake up. Words wait for it."""
PIPE = 4096
"""Bytes in the pipe: a tenth of a second. What is there is known, and what the player has taken is not."""
PROBE: Seconds = 0.25
"""How long a player that is started has to live before it is believed to have a device."""
DYING = 50
"""Steps for which it is waited until a player is dead that was killed: a second."""
_STEP: Seconds = 0.02
WITHOUT = "`--set control.drivers.espeak.device=none` goes on without sound (espeak, or the name of your own voice)"
ADVICE = f"install one of them (Debian: alsa-utils, pulseaudio-utils, pipewire-bin or sox); {WITHOUT}"


class PlayerProgram(NamedTuple):
    """A program that plays raw samples from its standard input.

    latency: seconds from the first sample in an empty pipe until it is heard, but for what the hardware adds, 0 to 50
    ms. Measured on a null sink of PulseAudio: sound of pacat and aplay (through ALSA's plugin) is where it is told
    within 12 ms, that of play within 60 ms. That of pw-cat is an estimate.
    """

    command: tuple[str, ...]
    latency: Seconds


PLAYERS: dict[str, PlayerProgram] = {
    "pacat": PlayerProgram(
        ("pacat", "--raw", "--format=s16le", "--rate={rate}", "--channels=1", "--latency-msec=100",
         "--client-name=engage"), 0.02,
    ),
    "aplay": PlayerProgram(
        ("aplay", "-q", "-t", "raw", "-f", "S16_LE", "-r", "{rate}", "-c", "1", "--buffer-time=60000",
         "--period-time=20000"), 0.02,
    ),
    "play": PlayerProgram(
        ("play", "-q", "--buffer", "1024", "-t", "raw", "-e", "signed-integer", "-b", "16", "-L", "-r", "{rate}",
         "-c", "1", "-"), 0.1,
    ),
    "pw-cat": PlayerProgram(
        ("pw-cat", "--playback", "--raw", "--format", "s16", "--rate", "{rate}", "--channels", "1", "--latency",
         "40ms", "-"), 0.04,
    ),
}  # fmt: skip
"""Player programs by name, in the order in which they are tried."""


class Player:
    """An outlet to a sound device. After a fault, or a cut, the next `ready` starts the player anew."""

    is_live = True

    def __init__(self, program: PlayerProgram, rate: int) -> None:
        """Start nothing yet. rate: samples per second."""
        self._command = tuple(word.replace("{rate}", str(rate)) for word in program.command)
        self._rate, self._latency = rate, program.latency
        self._loop = asyncio.get_running_loop()
        self.lead: Seconds = program.latency + MARGIN
        self.fault: Fault | None = Fault(reason="the player was not started", service="control")
        self._on_fault: list[Callable[[], None]] = []
        self._process: FedProcess | None = None
        self._dying: FedProcess | None = None
        """The player before this one: until it is dead the device may be taken."""
        self._timer: asyncio.TimerHandle | None = None
        self._heard_until: Seconds = 0.0
        """Loop time at which all that was written has been heard."""
        self._written = 0
        """Bytes."""
        self._started: Seconds = 0.0
        """Loop time."""
        self._stands: tuple[Seconds, int] | None = None
        """Since when, in loop time, the player has taken no more than so many bytes, though it is late."""

    @asynccontextmanager
    async def connected(self) -> AsyncIterator[None]:
        """Run the player. Raises RunFailed: it does not run, or ends at once."""
        try:
            await self.ready()
            await self._live()
            if self.fault is not None:
                fault = self.fault
                raise RunFailed(fault)
            yield
        finally:
            await self._end()

    async def ready(self) -> None:
        """Start the player if it is not running, when the one before it is dead."""
        if self.fault is not None:
            self._drop()
            self.fault = None
        for _ in range(DYING):
            if self._try_to_start():
                return
            await asyncio.sleep(_STEP)
        self._fail(f"the player {self._command[0]} does not die", "does its sound device hang?")

    def earliest(self) -> Seconds:
        now = self._loop.time()
        self._heard_until = max(self._heard_until, now + self._untaken)
        return max(self._heard_until, now + self.lead)

    def play(self, samples: bytes, at: Seconds) -> None:
        if self.fault is not None or self._process is None:
            return
        now = self._loop.time()
        since = max(self._heard_until, now + self._untaken, now + self._latency)
        silence = max(0, round((at - since) * self._rate))
        self._write(bytes(2 * silence) + samples)
        self._heard_until = since + (silence + len(samples) // 2) / self._rate

    def rest(self) -> None:
        if self.fault is None and self._process is not None:
            self._write(bytes(2 * round(FLUSH * self._rate)))
            self._heard_until = max(self._heard_until, self._loop.time() + self._latency) + FLUSH

    def late(self) -> Seconds | None:
        if self.fault is not None or self._process is None:
            return None
        now, untaken = self._loop.time(), self._untaken
        taken = self._written - self._process.untaken
        stands = self._stands is not None and taken == self._stands[1]
        late = untaken - (self._heard_until - now) if untaken else 0.0
        if late <= LATE and not stands:
            self._stands = None
            if not untaken and self._written > PIPE:
                self._started = -inf  # it has taken more than what it may read ahead as it starts
            return None
        if self._stands is None or not stands:
            self._stands = now, taken
        elif now > max(self._stands[0] + STUCK, self._started + STARTING):
            reason = f"the sound device has taken no sound for {now - self._stands[0]:.1f} s"
            self._fail(reason, "is it held by another program?")
            return None
        self._heard_until = max(self._heard_until, now + untaken)
        return max(0.0, late)

    def cut(self, at: Seconds, tail: bytes) -> None:
        """End the player: that is the only way to take sound back. Another one is started at once."""
        if self.fault is None:
            self._drop()
            self._start_again()

    def watch(self, on_fault: Callable[[], None]) -> Callable[[], None]:
        self._on_fault.append(on_fault)
        return lambda: self._on_fault.remove(on_fault)

    # -- the program --------------------------------------------------------------------------------------------

    @property
    def _untaken(self) -> Seconds:
        """Seconds of sound that the player has not taken."""
        return 0.0 if self._process is None else self._process.untaken / 2 / self._rate

    def _write(self, samples: bytes) -> None:
        assert self._process is not None
        self._process.write(samples)
        self._written += len(samples)

    def _drop(self) -> None:
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            self._dying = process

    def _start_again(self) -> None:
        self._timer = None
        if self.fault is None and not self._try_to_start():
            self._timer = self._loop.call_later(_STEP, self._start_again)

    def _try_to_start(self) -> bool:
        """Start the player if it is not running, unless the one before it is not dead yet: then return False."""
        if self._process is not None:
            return True
        if self._dying is not None and not self._dying.is_dead:
            return False
        self._dying = self._stands = None
        self._heard_until, self._written, self._started = 0.0, 0, self._loop.time()
        try:
            self._process = FedProcess(self._command, PIPE, self._lost)
        except OSError as error:
            self._fail(f"the player {self._command[0]} does not start: {error.strerror or error}", ADVICE)
        return True

    def _lost(self) -> None:
        assert self._process is not None
        code = self._process.process.poll()
        how = "has closed its input" if code is None else f"has ended with code {code}"
        words = f": {self._process.words}" if self._process.words else ""
        self._fail(f"the player {self._command[0]} {how}{words}", f"is there a sound card? {WITHOUT}")

    def _fail(self, reason: str, advice: str) -> None:
        self.fault = Fault(reason=reason, where="sound device", advice=advice, service="control")
        self._drop()
        for each in list(self._on_fault):
            each()

    async def _live(self) -> None:
        """Wait until the player has taken a little silence, and has lived for a while, or until there is a fault."""
        begin = self._loop.time()
        self.rest()
        while self.fault is None and (now := self._loop.time()) < begin + STARTING:
            if now >= begin + PROBE and not self._untaken:
                return
            await asyncio.sleep(_STEP)

    async def _end(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
        self._drop()
        for _ in range(DYING):
            if self._dying is None or self._dying.is_dead:
                return
            await asyncio.sleep(_STEP)


def found(settings: VoiceSettings) -> PlayerProgram | None:
    """Find the player that the settings ask for; None: no device. Raises InputRefused."""
    if settings.device == "none":
        return None
    if settings.player:
        return PlayerProgram(settings.player, 0.05 if settings.latency is None else settings.latency)
    names: Sequence[str] = tuple(PLAYERS) if settings.device == "auto" else (settings.device,)
    if unknown := [name for name in names if name not in PLAYERS]:
        raise InputRefused(_refusal(f"no player {unknown[0]!r}", f"auto, none, {', '.join(PLAYERS)}"))
    here = [PLAYERS[name] for name in names if shutil.which(PLAYERS[name].command[0])]
    program = next(filter(_takes_raw, here), None)
    if program is None and here:
        reason = f"{here[0].command[0]} takes no raw sound from a pipe here: it has no option --raw, it is too old"
        raise InputRefused(_refusal(reason, ADVICE))
    if program is None:
        raise InputRefused(_refusal(f"no program here plays sound: tried {', '.join(names)}", ADVICE))
    return program if settings.latency is None else program._replace(latency=settings.latency)


def _takes_raw(program: PlayerProgram) -> bool:
    """Tell whether a program has the option `--raw` if it is to be called with it: pw-cat 0.3.65 has it not."""
    if "--raw" not in program.command or program.command[0] != "pw-cat":
        return True
    asked = subprocess.run([program.command[0], "--help"], capture_output=True, text=True, check=False, timeout=5.0)
    return "--raw" in asked.stdout + asked.stderr


def _refusal(reason: str, advice: str) -> Fault:
    return Fault(reason=reason, where="control.drivers, device", advice=advice, service="control")
