"""Sound as numbers: WAV files, samples of other rates, and when samples of a device were captured. Pure."""

import wave
from typing import BinaryIO

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.units import Seconds
from engage_hri.services.perception.hearing.voice import RATE, Samples

ADVICE = "make it one: ffmpeg -i FILE -ar 16000 -c:a pcm_s16le FILE.wav"
RATES = range(4000, 192_001)
"""Samples per second that a file may have, as those of a `SoundFrame`: what says another number is damaged."""
UNKNOWN = 2**31 - 2**16
"""Bytes from which on what a file says of its length means that whoever wrote it, into a pipe, did not know."""
TAPS = 16
"""Zero crossings of the filter on each side of a sample, where the rate is changed."""
AT_ONCE = 1 << 15
"""Samples that are converted at once."""


class Piece(Struct, frozen=True):
    """A piece of sound. samples: a row for each instant, a column for each channel. at: loop time of the first."""

    samples: Samples
    at: Seconds


def read_wav(file: BinaryIO, name: str) -> Samples:
    """Read a WAV file, at `RATE`: a row for each instant, a column for each channel.

    file: open. name: for people. Raises InputRefused: it is no whole WAV file of 16 bits and such a rate.
    """
    try:
        with wave.open(file) as read:
            channels, width, rate, count = (
                read.getnchannels(),
                read.getsampwidth(),
                read.getframerate(),
                read.getnframes(),
            )
            content = read.readframes(count)
    except (wave.Error, EOFError, RuntimeError) as error:  # the last one: a part is longer than all of it
        reason = f"it is no WAV file that can be read: {str(error) or 'it ends too early'}"
        raise InputRefused(Fault(reason=reason, where=name, advice=ADVICE)) from error
    if width != 2:
        raise InputRefused(Fault(reason=f"its samples have {8 * width} bits, not 16", where=name, advice=ADVICE))
    if rate not in RATES:
        reason = f"it says that it has {rate} samples per second: expected {RATES[0]} to {RATES[-1]}"
        raise InputRefused(Fault(reason=reason, where=name, advice=ADVICE))
    said, there = count / rate, len(content) / (2 * channels * rate)
    if len(content) < 2 * channels * count < UNKNOWN:
        reason = f"it ends after {there:.1f} s, and says that it has {said:.1f} s of sound"
        raise InputRefused(Fault(reason=reason, where=name, advice=ADVICE))
    if (whole := len(content) - len(content) % (2 * channels)) == 0:
        raise InputRefused(Fault(reason="there is no sound in it", where=name, advice=ADVICE))
    samples = np.frombuffer(content[:whole], "<i2").reshape(-1, channels)
    return np.column_stack([resampled(samples[:, channel], rate) for channel in range(channels)])


class Resampler:
    """Converts a channel to `RATE`, piece by piece, by a sinc in a cosine window: nothing above half the rate folds
    down. What it returns lags behind by its `reach`.

    reach: samples on each side that it needs.
    """

    def __init__(self, rate: int) -> None:
        """rate: samples per second of what comes."""
        self._rate = rate
        self._cut = min(1.0, RATE / rate)
        """Share of the frequencies that remain."""
        self.reach = int(np.ceil(TAPS / self._cut))
        self._rest = np.zeros(self.reach)
        self._first = -self.reach
        """Number of the first sample of the rest."""
        self._count = 0
        """Samples that were returned."""

    def feed(self, samples: Samples) -> Samples:
        """Convert the next piece."""
        if self._rate == RATE:
            return samples.astype(np.int16)
        self._rest = np.concatenate([self._rest, samples])
        known = self._first + len(self._rest)
        count = max(self._count, -((self.reach - known) * RATE // self._rate))  # those whose reach is known
        steps = np.arange(-self.reach + 1, self.reach + 1)
        made = [np.zeros(0, np.int16)]
        for first in range(self._count, count, AT_ONCE):
            places = np.arange(first, min(count, first + AT_ONCE)) * (self._rate / RATE)
            whole = places.astype(np.int64)
            away: NDArray[np.float64] = steps[None, :] - (places - whole)[:, None]
            window = np.cos(np.clip(away / self.reach, -1, 1) * (np.pi / 2)) ** 2
            weights = self._cut * np.sinc(self._cut * away) * window
            summed = (self._rest[whole[:, None] + steps[None, :] - self._first] * weights).sum(axis=1)
            made.append(np.clip(np.rint(summed), -32768, 32767).astype(np.int16))
        self._count = count
        begin = count * self._rate // RATE - self.reach + 1
        self._rest, self._first = self._rest[max(0, begin - self._first) :], max(begin, self._first)
        return np.concatenate(made)


def resampled(samples: Samples, rate: int) -> Samples:
    """Convert one channel to `RATE`. rate: samples per second that it has."""
    resampler = Resampler(rate)
    made = [resampler.feed(samples), resampler.feed(np.zeros(resampler.reach + 1, np.int16))]
    return np.concatenate(made)[: len(samples) * RATE // rate]


LATE: Seconds = 0.1
"""Time by which samples are later than the others from which on some before them may have been lost."""
FOR: Seconds = 0.5
"""Time for which all have to be late before that is believed: the machine may stand still."""
DRIFT = 1e-3
"""Share by which the clock of a device may be slower than ours; those of sound cards differ by less than a tenth."""


class SampleClock:
    """Times at which samples were captured, of a device that counts them by a clock of its own.

    A sample cannot come before it was captured, and what comes soonest has been on its way for the shortest time. So
    the stream began at the earliest of all beginnings that its pieces let one think of, and a slow clock lets this
    moment wander later. Where samples were lost, all that follow are late.
    """

    def __init__(self) -> None:
        self._begin: Seconds | None = None
        """Loop time of sample 0, as far as one can tell."""
        self._late: tuple[Seconds, Seconds] | None = None
        """Since when all were late, and the earliest beginning that they let one think of."""
        self._count = 0
        self._last: Seconds = 0.0

    def take(self, count: int, arrived: Seconds) -> Seconds:
        """Take note of the next samples. Returns the loop time of the first. arrived: loop time of their arrival."""
        begin = arrived - (self._count + count) / RATE
        if self._begin is None:
            self._begin = begin
        if begin <= self._begin + LATE:
            self._late = None
        else:
            since, earliest = self._late or (arrived, begin)
            self._late = since, min(earliest, begin)
            if arrived - since >= FOR:
                self._begin, self._late = self._late[1], None
        self._begin = min(begin, self._begin + DRIFT * max(0.0, arrived - self._last))
        at = self._begin + self._count / RATE
        self._count, self._last = self._count + count, arrived
        return at
