"""Sound as it comes: a file in the time of the loop, or a program that records.

A program is asked for 16 bit, little-endian, at `RATE`. Where none is installed, the package `sounddevice` records in
a process of its own:

    python -m engage_hri.services.perception.hearing.microphone CHANNELS
"""

import asyncio
import shutil
import sys
from collections import deque
from collections.abc import AsyncGenerator, Callable
from functools import partial
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from engage_hri.schemas.faults import EngageError, Fault, InputRefused, raised_as
from engage_hri.schemas.units import Seconds
from engage_hri.services.perception.child import PipedProcess
from engage_hri.services.perception.hearing.config import PAGE
from engage_hri.services.perception.hearing.sound import Piece, SampleClock, read_wav
from engage_hri.services.perception.hearing.voice import RATE, Samples
from engage_hri.services.runtime.installation import packages_command

PIECE: Seconds = 0.02
"""Length of the pieces in which a file is played."""
SILENT: Seconds = 1.5
"""Time without any sample, not even of silence, after which a device is taken for dead."""
STARTING: Seconds = 5.0
"""Time until the first sample: devices have to wake up."""
KEPT = 256
"""Pieces that wait at most while the loop is busy."""
OURS = "engage_hri.services.perception.hearing.microphone"
RECORDERS = {
    "parec": ("parec", "--raw", "--format=s16le", "--rate={rate}", "--channels={channels}", "--latency-msec=20"),
    "arecord": ("arecord", "-q", "-t", "raw", "-f", "S16_LE", "-r", "{rate}", "-c", "{channels}", "-F", "20000"),
    "rec": ("rec", "-q", "--buffer", "1024", "-t", "raw", "-e", "signed", "-b", "16", "-L", "-r", "{rate}",
            "-c", "{channels}", "-"),
    "sounddevice": (sys.executable, "-m", OURS, "{channels}"),
}  # fmt: skip
"""Commands of programs that record, by name, in the order in which they are tried."""


class SoundLost(EngageError):
    """No more sound comes from a device. The fault says why."""


def is_file(source: str | tuple[str, ...]) -> bool:
    """Tell whether a source is a file, and no device, nor the pages of windows."""
    return isinstance(source, str) and source not in ("auto", PAGE, *RECORDERS)


def read_file(path: Path, channels: int) -> Samples:
    """Read a WAV file. Raises InputRefused: it cannot be read.

    channels: that it has to have at least; 1: the mean of all that it has, since a voice may be in any of them.
    """
    if path.exists() and not path.is_file():  # a pipe may let us wait for ever
        advice = "name a program that records as `hearing.source`, for example ffmpeg: docs/hearing.md"
        raise InputRefused(Fault(reason="it is no file", where=str(path), advice=advice))
    with raised_as(InputRefused, OSError, path), path.open("rb") as file:
        samples = read_wav(file, str(path))
    if samples.shape[1] < channels:
        reason = f"it has {samples.shape[1]} channels, and `hearing.people` names {channels}"
        raise InputRefused(Fault(reason=reason, where=str(path)))
    if channels == 1:
        samples = np.rint(samples.mean(axis=1, keepdims=True)).astype(np.int16)
    return samples[:, :channels]


async def played(samples: Samples) -> AsyncGenerator[Piece, None]:
    """Play the sound of a file in the time of the loop, from now on."""
    loop = asyncio.get_running_loop()
    begin, step = loop.time(), round(PIECE * RATE)
    for first in range(0, len(samples), step):
        piece = samples[first : first + step]
        await asyncio.sleep(begin + (first + len(piece)) / RATE - loop.time())
        yield Piece(piece, begin + first / RATE)


def command(source: str | tuple[str, ...], channels: int) -> tuple[str, ...]:
    """Find the command that records. Raises InputRefused: there is none here."""
    if not isinstance(source, str):
        return source
    names = tuple(RECORDERS) if source == "auto" else (source,)
    for name in names:
        is_here = find_spec(name) if name == "sounddevice" else shutil.which(RECORDERS[name][0])
        if is_here:
            return tuple(part.format(rate=RATE, channels=channels) for part in RECORDERS[name])
    advice = f"install one, or {packages_command('sounddevice')}, or `--from FILE.wav`"
    reason = f"nothing here records sound: tried {', '.join(names)}"
    raise InputRefused(Fault(reason=reason, where="hearing.source", advice=advice))


async def recorded(program: tuple[str, ...], channels: int) -> AsyncGenerator[Piece, None]:
    """Record for ever. Raises SoundLost."""
    loop = asyncio.get_running_loop()
    clock, frame, rest = SampleClock(), 2 * channels, b""
    arrived: deque[tuple[bytes, Seconds]] = deque(maxlen=KEPT)
    news, end, patience = asyncio.Event(), "", STARTING

    def take(more: bytes) -> None:
        arrived.append((more, loop.time()))
        news.set()

    def ended(how: str) -> None:
        nonlocal end
        end = how
        news.set()

    def lost(how: str) -> SoundLost:
        advice = "is the microphone plugged in, and allowed? hearing tries again"
        return SoundLost(Fault(reason=f"the microphone: {program[0]} {how}", where="hearing.source", advice=advice))

    try:
        child = PipedProcess(program, take, ended)
    except OSError as error:
        raise lost(f"does not start: {error.strerror or error}") from error
    try:
        while True:
            try:
                async with asyncio.timeout(patience):
                    await news.wait()
            except TimeoutError:
                raise lost(f"gives no sample for {patience:g} s") from None
            news.clear()
            patience = SILENT
            while arrived:
                more, at = arrived.popleft()
                content = rest + more
                whole = len(content) // frame * frame
                rest = content[whole:]
                if whole:
                    samples = np.frombuffer(content[:whole], "<i2").reshape(-1, channels)
                    yield Piece(samples, clock.take(len(samples), at))
            if end:
                raise lost(end)
    finally:
        child.close()


def opened(source: str | tuple[str, ...], channels: int) -> Callable[[], AsyncGenerator[Piece, None]]:
    """Find a file or a device. Returns what gives its sound, whenever it is called, and may raise SoundLost.

    Raises InputRefused: there is none.
    """
    if is_file(source):
        return partial(played, read_file(Path(str(source)), channels))
    return partial(recorded, command(source, channels), channels)


def main() -> None:
    """Record with `sounddevice`, to standard output, until that is closed."""
    import sounddevice

    with sounddevice.RawInputStream(
        samplerate=RATE, channels=int(sys.argv[1]), dtype="int16", blocksize=round(PIECE * RATE), latency="low"
    ) as stream:
        while True:
            samples, _ = stream.read(round(PIECE * RATE))
            sys.stdout.buffer.write(bytes(samples))
            sys.stdout.buffer.flush()


if __name__ == "__main__":
    main()
