"""A sound device, by the player program of its system, fed through a pipe. Whatever blocks there blocks the player.

A player starts as soon as it has a little sound, and then consumes what it has in real time. So the moment at which a
sample is heard is known: where the pipe is empty `latency` after it was written, else right after the sample before
it.
"""

import asyncio
import shutil
import subprocess
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager, suppress
from typing import NamedTuple

from engage_hri.schemas.faults import Fault, InputRefused, RunFailed
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.voice.settings import VoiceSettings

try:
    import fcntl
except ImportError:  # on Windows the pipe keeps its size
    fcntl = None  # type: ignore[assignment]

MARGIN: Seconds = 0.08
"""How much earlier than needed sound is handed over: for the buffer of the player, and a loop that is late."""
FLUSH: Seconds = 0.12
"""Silence after the last sound: a player may keep a little until there is more."""
STUCK: Seconds = 0.8
"""So much sound may be overdue in our own buffer before the device counts as dead."""
PIPE = 4096
"""Bytes in the pipe: a tenth of a second. What does not fit there is seen to be stuck."""
PROBE: Seconds = 0.25
"""How long a player that is started has to live before it is believed to have a device."""
ADVICE = "install one of them (Debian: alsa-utils, pulseaudio-utils, pipewire-bin or sox), or set device=none or file"


class PlayerProgram(NamedTuple):
    """A program that plays raw samples from its standard input.

    latency: seconds from the first sample in an empty pipe until it is heard. That of pacat is measured but for what
    the hardware adds, 0 to 50 ms: on a null sink, sound is where it is told within 12 ms for 0. Others are estimates.
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
        ("play", "-q", "-t", "raw", "-e", "signed-integer", "-b", "16", "-L", "-r", "{rate}", "-c", "1", "-"), 0.1,
    ),
    "pw-cat": PlayerProgram(
        ("pw-cat", "--playback", "--raw", "--format", "s16", "--rate", "{rate}", "--channels", "1", "--latency",
         "40ms", "-"), 0.04,
    ),
}  # fmt: skip
"""Player programs by name, in the order in which they are tried."""


class Player:
    """An outlet to a sound device. After a fault the next `revive` starts the player anew."""

    def __init__(self, program: PlayerProgram, rate: int) -> None:
        self._command = tuple(word.replace("{rate}", str(rate)) for word in program.command)
        self._rate, self._latency = rate, program.latency
        self._loop = asyncio.get_running_loop()
        self.lead: Seconds = program.latency + MARGIN
        self.fault: Fault | None = Fault(reason="the player was not started", service="control")
        self._on_fault: list[Callable[[], None]] = []
        self._process: subprocess.Popen[bytes] | None = None
        self._transport: asyncio.WriteTransport | None = None
        self._heard_until: Seconds = 0.0
        """Loop time at which all that was written has been heard."""

    @asynccontextmanager
    async def connected(self) -> AsyncIterator[None]:
        """Run the player. Raises RunFailed: it does not run, or ends at once."""
        try:
            await self.revive()
            await self._live(PROBE)
            if self.fault is not None:
                fault = self.fault
                raise RunFailed(fault)
            yield
        finally:
            await self._end()

    async def revive(self) -> None:
        """Start the player if it is not running."""
        if self.fault is None and self._process is not None:
            return
        await self._end()
        try:
            # Not asyncio's own: it starts a thread for each child in Python 3.11.
            self._process = subprocess.Popen(  # noqa: ASYNC220
                self._command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL
            )
        except OSError as error:
            self._fail(f"the player {self._command[0]} does not start: {error.strerror or error}", ADVICE)
            return
        pipe = self._process.stdin
        assert pipe is not None
        if fcntl is not None and hasattr(fcntl, "F_SETPIPE_SZ"):
            with suppress(OSError):
                fcntl.fcntl(pipe.fileno(), fcntl.F_SETPIPE_SZ, PIPE)
        self.fault, self._heard_until = None, 0.0
        self._transport, _ = await self._loop.connect_write_pipe(lambda: _Ending(self._lost), pipe)
        self._transport.set_write_buffer_limits(high=2**40)

    def earliest(self) -> Seconds:
        return max(self._heard_until, self._loop.time() + self.lead)

    def play(self, samples: bytes, at: Seconds) -> None:
        if self.fault is not None or self._transport is None:
            return
        self._check()
        dry = self._loop.time() + self._latency
        since = max(self._heard_until, dry)
        silence = max(0, round((at - since) * self._rate))
        self._transport.write(bytes(2 * silence) + samples)
        self._heard_until = since + (silence + len(samples) // 2) / self._rate

    def rest(self) -> None:
        if self.fault is None and self._transport is not None:
            self._transport.write(bytes(2 * round(FLUSH * self._rate)))
            self._heard_until = max(self._heard_until, self._loop.time() + self._latency) + FLUSH

    def watch(self, on_fault: Callable[[], None]) -> Callable[[], None]:
        self._on_fault.append(on_fault)
        return lambda: self._on_fault.remove(on_fault)

    def check(self) -> None:
        """Look whether the device takes the sound in time."""
        if self.fault is None:
            self._check()

    def _check(self) -> None:
        assert self._transport is not None
        unsent = self._transport.get_write_buffer_size() / 2 / self._rate
        ahead = max(0.0, self._heard_until - self._loop.time())
        if unsent > ahead + STUCK:
            self._fail(
                f"the sound device takes no sound: {unsent:.1f} s of it wait", "is it held by another program?"
            )

    def _lost(self) -> None:
        process, self._transport = self._process, None
        if process is None or self.fault is not None:
            return
        code = process.poll()
        how = "has closed its input" if code is None else f"has ended with code {code}"
        self._fail(f"the player {self._command[0]} {how}", "its own words are on standard error; is there a device?")

    def _fail(self, reason: str, advice: str) -> None:
        self.fault = Fault(reason=reason, where="sound device", advice=advice, service="control")
        for each in list(self._on_fault):
            each()

    async def _live(self, seconds: Seconds) -> None:
        """Wait for so long, or until there is a fault; sound of silence shows whether there is a device."""
        failed = asyncio.Event()
        unwatch = self.watch(failed.set)
        self.rest()
        try:
            if self.fault is None:
                with suppress(TimeoutError):
                    await asyncio.wait_for(failed.wait(), seconds)
        finally:
            unwatch()

    async def _end(self) -> None:
        transport, process = self._transport, self._process
        self._transport = self._process = None
        if transport is not None:
            transport.abort()
        if process is not None:
            with suppress(ProcessLookupError):
                process.terminate()
            for _ in range(40):
                if process.poll() is not None:
                    return
                await asyncio.sleep(0.025)
            process.kill()
            process.wait()


class _Ending(asyncio.BaseProtocol):
    """Tells when the other end of the pipe is closed."""

    def __init__(self, on_end: Callable[[], None]) -> None:
        self._on_end = on_end

    def connection_lost(self, error: Exception | None) -> None:
        self._on_end()


def found(settings: VoiceSettings) -> PlayerProgram | None:
    """Find the player that the settings ask for; None: no device. Raises InputRefused."""
    if settings.device == "none":
        return None
    if settings.player:
        return PlayerProgram(settings.player, 0.05 if settings.latency is None else settings.latency)
    names: Sequence[str] = tuple(PLAYERS) if settings.device == "auto" else (settings.device,)
    if unknown := [name for name in names if name not in PLAYERS]:
        raise InputRefused(_refusal(f"no player {unknown[0]!r}", f"auto, none, {', '.join(PLAYERS)}"))
    program = next((PLAYERS[name] for name in names if shutil.which(PLAYERS[name].command[0])), None)
    if program is None:
        raise InputRefused(_refusal(f"no program here plays sound: tried {', '.join(names)}", ADVICE))
    return program if settings.latency is None else program._replace(latency=settings.latency)


def _refusal(reason: str, advice: str) -> Fault:
    return Fault(reason=reason, where="control.drivers, device", advice=advice, service="control")
