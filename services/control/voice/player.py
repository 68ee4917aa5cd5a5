"""A sound device, by the player program of its system, fed through a pipe. Whatever blocks there blocks the player.

A player starts as soon as it has a little sound, and then consumes what it has in real time. So the moment at which a
sample is heard is known: where the pipe is empty `latency` after it was written, else right after the sample before
it.
"""

import asyncio
import os
import shutil
import signal
import struct
import subprocess
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager, suppress
from math import inf
from typing import NamedTuple

from engage_hri.schemas.faults import Fault, InputRefused, RunFailed
from engage_hri.schemas.text import printable
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.voice.outlets import STUCK, Outlet
from engage_hri.services.control.voice.synthesis import VoiceSettings

try:
    import fcntl
    import termios
except ImportError:  # on Windows the pipe keeps its size, and does not say what is in it
    fcntl = termios = None  # type: ignore[assignment]


WORDS = 1000
"""Bytes that are kept of the beginning and of the end of what it says."""


class FedProcess:
    """A process with a pipe to its standard input.

    What it has not taken is known: what is still here, and what is in the pipe. What it has taken and keeps is not.
    """

    def __init__(self, command: Sequence[str], pipe: int, on_end: Callable[[], None]) -> None:
        """Start it. pipe: bytes that the pipe is to hold. on_end: called when it closes its input, or ends.

        Raises:
            OSError: it does not start.
        """
        self._loop, self._on_end = asyncio.get_running_loop(), on_end
        self._unsent = bytearray()
        self._is_open = True
        # Not asyncio's own: it starts a thread for each child in Python 3.11. A group: to end its children, too.
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, process_group=0
        )
        assert self.process.stdin is not None
        assert self.process.stderr is not None
        self._said = b""
        """The first and the last that it has said on standard error, where players tell of every pause."""
        self._errors = self.process.stderr.fileno()
        os.set_blocking(self._errors, False)
        self._loop.add_reader(self._errors, self._hear)
        self._pipe = self.process.stdin.fileno()
        os.set_blocking(self._pipe, False)
        if fcntl is not None and hasattr(fcntl, "F_SETPIPE_SZ"):
            with suppress(OSError):
                fcntl.fcntl(self._pipe, fcntl.F_SETPIPE_SZ, pipe)
        self._loop.add_reader(self._pipe, self._closed)  # the end of a pipe that is written to wakes as it is closed

    @property
    def untaken(self) -> int:
        """Bytes that were written and that the process has not read."""
        if not self._is_open or termios is None:
            return len(self._unsent)
        count = bytearray(4)
        with suppress(OSError):
            fcntl.ioctl(self._pipe, termios.FIONREAD, count)
        return len(self._unsent) + int(struct.unpack("i", count)[0])

    @property
    def words(self) -> str:
        """Return what it has said last on standard error: before that come complaints of its libraries."""
        lines = [line.strip() for line in self._said.decode(errors="replace").splitlines() if line.strip()]
        return printable(lines[-1])[:200] if lines else ""

    def write(self, content: bytes) -> None:
        """Let it have some bytes, after those before; once it is gone they are lost."""
        if self._is_open:
            was_empty = not self._unsent
            self._unsent += content
            if was_empty:
                self._send()

    def kill(self) -> None:
        """End it, and all that it has started, with all that it has taken. It is dead when `is_dead`."""
        self._close()
        with suppress(OSError):
            os.killpg(self.process.pid, signal.SIGKILL)

    @property
    def is_dead(self) -> bool:
        return self.process.poll() is not None

    def _send(self) -> None:
        try:
            del self._unsent[: os.write(self._pipe, self._unsent)]
        except BlockingIOError:
            pass
        except OSError:  # `_closed` is called for that, too
            self._unsent.clear()
        if self._unsent:
            self._loop.add_writer(self._pipe, self._send)
        else:
            self._loop.remove_writer(self._pipe)

    def _hear(self) -> None:
        try:
            more = os.read(self._errors, 4096)
        except BlockingIOError:
            return
        if not more:
            self._loop.remove_reader(self._errors)
        self._said += more
        if len(self._said) > 2 * WORDS:
            self._said = self._said[:WORDS] + b"\n" + self._said[-WORDS:]

    def _closed(self) -> None:
        self._hear()
        self._close()
        self._on_end()

    def _close(self) -> None:
        if self._is_open:
            self._is_open = False
            self._loop.remove_reader(self._pipe)
            self._loop.remove_writer(self._pipe)
            assert self.process.stdin is not None
            with suppress(OSError):
                self.process.stdin.close()
            self._loop.remove_reader(self._errors)
            assert self.process.stderr is not None
            self.process.stderr.close()


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
INSTALL = "Debian: alsa-utils, pulseaudio-utils, pipewire-bin or sox"
ADVICE = f"install one of them ({INSTALL}); {WITHOUT}"


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


class Player(Outlet):
    """An outlet to a sound device. After a fault, or a cut, the next `ready` starts the player anew."""

    def __init__(self, program: PlayerProgram, rate: int) -> None:
        """Start nothing yet. rate: samples per second."""
        self._loop = asyncio.get_running_loop()
        super().__init__(self._loop.time)
        self._command = tuple(word.replace("{rate}", str(rate)) for word in program.command)
        self._rate, self._latency = rate, program.latency
        self._fault = Fault(reason="the player was not started", service="control")
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

    @property
    def is_live(self) -> bool:
        return True

    @property
    def lead(self) -> Seconds:
        return self._latency + MARGIN

    @asynccontextmanager
    async def connected(self) -> AsyncIterator[None]:
        """Run the player. Raises RunFailed: it does not run, or ends at once."""
        try:
            await self.ready()
            await self._live()
            if self.fault is not None:
                raise RunFailed(self.fault)
            yield
        finally:
            await self._end()

    async def ready(self) -> None:
        """Start the player if it is not running, when the one before it is dead."""
        if self.fault is not None:
            self._drop()
            self._fault = None
        for _ in range(DYING):
            if self._try_to_start():
                return
            await asyncio.sleep(_STEP)
        self._fail(f"the player {self._command[0]} does not die", "does its sound device hang?")

    def earliest(self) -> Seconds:
        now = self.now()
        self._heard_until = max(self._heard_until, now + self._untaken)
        return max(self._heard_until, now + self.lead)

    def play(self, samples: bytes, at: Seconds) -> None:
        if self.fault is not None or self._process is None:
            return
        now = self.now()
        since = max(self._heard_until, now + self._untaken, now + self._latency)
        silence = max(0, round((at - since) * self._rate))
        self._write(bytes(2 * silence) + samples)
        self._heard_until = since + (silence + len(samples) // 2) / self._rate

    def rest(self) -> None:
        if self.fault is None and self._process is not None:
            self._write(bytes(2 * round(FLUSH * self._rate)))
            self._heard_until = max(self._heard_until, self.now() + self._latency) + FLUSH

    def late(self) -> Seconds | None:
        if self.fault is not None or self._process is None:
            return None
        now, untaken = self.now(), self._untaken
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
        self._heard_until, self._written, self._started = 0.0, 0, self.now()
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
        self._fault = Fault(reason=reason, where="sound device", advice=advice, service="control")
        self._drop()
        self.tell_fault()

    async def _live(self) -> None:
        """Wait until the player has taken a little silence, and has lived for a while, or until there is a fault."""
        begin = self.now()
        self.rest()
        while self.fault is None and (now := self.now()) < begin + STARTING:
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
    """Find the player that the settings ask for; None: no device. Raises InputRefused.

    Without any program here that plays sound, `auto` is no device: the pages of a window play it all the same.
    """
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
    if program is None and settings.device != "auto":
        raise InputRefused(_refusal(f"no program here plays sound: tried {', '.join(names)}", ADVICE))
    if program is None or settings.latency is None:
        return program
    return program._replace(latency=settings.latency)


def _takes_raw(program: PlayerProgram) -> bool:
    """Tell whether a program has the option `--raw` if it is to be called with it: pw-cat 0.3.65 has it not."""
    if "--raw" not in program.command or program.command[0] != "pw-cat":
        return True
    asked = subprocess.run([program.command[0], "--help"], capture_output=True, text=True, check=False, timeout=5.0)
    return "--raw" in asked.stdout + asked.stderr


def _refusal(reason: str, advice: str) -> Fault:
    return Fault(reason=reason, where="control.drivers, device", advice=advice, service="control")
