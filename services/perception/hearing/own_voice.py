"""The robot's own voice in a microphone: taken out of it, so that a person who breaks in is heard at once. Pure.

What the voice plays is told with its instants (`SoundFrame` of control). A filter learns how it comes to the
microphone, over the loudspeaker and the walls of the room, and what it expects is taken away: a Kalman filter of the
spectrum in parts (Enzner and Vary, 2006; in parts: Kuech and others, 2014). It needs a second to learn that, and as
long as it has not, or cannot, nothing counts as a voice while the robot's sounds.
"""

import numpy as np
from numpy.typing import NDArray

from engage_hri.schemas.units import Probability, Seconds
from engage_hri.services.perception.hearing.sound import Resampler
from engage_hri.services.perception.hearing.voice import ENOUGH, LENGTH, MAYBE, RATE, VOICE, Judge, Samples

STEP = 256
"""Samples that the filter takes at a time."""
PARTS = 24
"""Steps of the past that it knows: 0.38 s, for the way of the sound, and for its echoes in a room."""
STEADY = 0.9995
"""Share of what it knows that it believes after a step: people and microphones move."""
LEAD: Seconds = 0.05
"""Time by which it gets the voice before the microphone could hear it: instants of devices are not exact, and an echo
before its sound cannot be learned."""
JITTER = 64
"""Samples by which instants may waver before the voice is set to them again: 4 ms."""
KEPT = 1 << 16
"""Samples of the voice that are remembered: 4 s."""
FALL, FAINT, SURE = 0.8, 0.02, 16
"""Share of its level that a voice keeps in a step of silence, the level from which on it is loud, and the steps for
which it has to be: by then it is in the room, 0.2 s after `LEAD`."""
TRUSTED, MOST_TRUST = 15, 60
"""Trust from which on the filter is believed, and the most. Silence where the robot's voice was adds 1 a window."""
COST = 5
"""Trust that each of the first windows of a voice takes: the filter may have failed."""
VAIN: Seconds = 10.0
"""Time of the robot's voice without trust after which that is told."""


class OwnVoice:
    """Sound of the robot's voice as it is to be heard, in the time of the loop.

    told: loop time of the latest beginning of its sound that was told.
    """

    def __init__(self) -> None:
        self.told: Seconds = float("-inf")
        self._samples = np.zeros(KEPT, np.int16)
        """Sample number n, counted from loop time 0, is at n modulo its length."""
        self._end = 0
        """Number of the first sample that was not told."""
        self._resampler = (0, Resampler(RATE))
        """The rate of the sound that goes on, and what converts it."""

    def take(self, samples: Samples, rate: int, at: Seconds) -> None:
        """Take sound that is heard from `at` on; without any samples the voice is silent from then on."""
        first = round(at * RATE)
        if not len(samples):
            self._end = min(self._end, first)
            return
        self.told = max(self.told, at)
        if abs(first - self._end) > JITTER or rate != self._resampler[0]:
            self._resampler = rate, Resampler(rate)
            self._put(np.zeros(max(0, min(KEPT, first - self._end)), np.int16), max(self._end, first - KEPT))
            self._end = first
        self._put(self._resampler[1].feed(samples), self._end)

    def _put(self, samples: Samples, first: int) -> None:
        self._samples[np.arange(first, first + len(samples)) % KEPT] = samples
        self._end = first + len(samples)

    def between(self, first: int, count: int) -> Samples:
        """The samples from this number on; silence where nothing was told."""
        numbers = np.arange(first, first + count)
        is_known = (numbers < self._end) & (numbers >= self._end - KEPT)
        return np.where(is_known, self._samples[numbers % KEPT], 0).astype(np.int16)


class Canceller:
    """Filter that takes the robot's voice out of one microphone.

    sounds: whether the voice was to be heard in the last piece, or its echo. is_sure: it was, and is not over yet.
    """

    def __init__(self, voice: OwnVoice) -> None:
        """voice: that of the robot."""
        self.sounds = self.is_sure = False
        self._voice = voice
        self._level, self._loud = 0.0, 0
        """Of the voice, falling slowly; and for how many steps it has been loud."""
        self._rest: Samples = np.zeros(0, np.int16)
        self._next: int | None = None
        """Number of the sample of the voice with which it goes on."""
        self._before = np.zeros(STEP)
        """The step of the voice before."""
        self._spectra = np.zeros((PARTS, STEP + 1), np.complex128)
        """Of the voice, the latest first; and what the filter makes of each: the way from it to the microphone."""
        self._ways = np.zeros((PARTS, STEP + 1), np.complex128)
        self._doubts = np.repeat(np.exp(-np.arange(PARTS) / 6)[:, None], STEP + 1, axis=1)
        """Variance of the ways: early sound is louder."""
        self._noise = np.full(STEP + 1, 1e-3)
        """Power of all that is not the voice."""

    def feed(self, samples: Samples, at: Seconds) -> tuple[Samples, Seconds]:
        """Take the next piece of sound. at: loop time of its first sample. Returns what is left, and from when on.

        What is less than a step waits for more.
        """
        at -= len(self._rest) / RATE
        joined = np.concatenate([self._rest, samples])
        whole = len(joined) // STEP * STEP
        self._rest = joined[whole:]
        number = round((at + LEAD) * RATE)
        if self._next is None or abs(number - self._next) > JITTER:
            self._next = number
        for first in range(0, whole, STEP):
            left = self._step(joined[first : first + STEP] / 32768, self._voice.between(self._next, STEP) / 32768)
            joined[first : first + STEP] = np.clip(np.rint(left * 32768), -32768, 32767)
            self._next += STEP
        return joined[:whole], at

    def _step(self, heard: NDArray[np.float64], voice: NDArray[np.float64]) -> NDArray[np.float64]:
        self._spectra = np.roll(self._spectra, 1, axis=0)
        self._spectra[0] = np.fft.rfft(np.concatenate([self._before, voice]))
        self._before = voice
        self.sounds = bool(self._spectra.any())
        self._level = max(FALL * self._level, float(np.abs(voice).max()))
        self._loud = self._loud + 1 if self._level > FAINT else 0
        self.is_sure = self._loud > SURE
        if not self.sounds:
            return heard
        left = heard - np.fft.irfft((self._ways * self._spectra).sum(axis=0))[STEP:]
        error = np.fft.rfft(np.concatenate([np.zeros(STEP), left]))
        power = np.abs(error) ** 2
        self._noise = np.maximum(0.8 * self._noise + 0.2 * power, 0.5 * power)
        powers = np.abs(self._spectra) ** 2
        gain = self._doubts / (0.5 * (powers * self._doubts).sum(axis=0) + self._noise + 1e-6)
        change = np.fft.irfft(gain * np.conj(self._spectra) * error, axis=1)
        change[:, STEP:] = 0
        self._ways += np.fft.rfft(change, axis=1)
        kept = STEADY**2 * np.clip(1 - 0.5 * gain * powers, 0, None) * self._doubts
        self._doubts = kept + (1 - STEADY**2) * np.abs(self._ways) ** 2
        return left


class CautiousJudge:
    """Judge of what is left of a microphone. While the robot's voice sounds it says what another one says, if the
    canceller is to be trusted: if there has been silence mostly where the voice was taken out.

    in_vain: time for which the voice has sounded without trust, since there was any.
    """

    def __init__(self, judge: Judge, canceller: Canceller) -> None:
        self.in_vain: Seconds = 0.0
        self._judge, self._canceller = judge, canceller
        self._trust = 0
        self._count = 0
        """Windows of voice in a row."""

    def __call__(self, window: NDArray[np.float32]) -> Probability:
        likely = self._judge(window)
        self._count = self._count + 1 if likely >= VOICE else 0
        if not self._canceller.sounds:
            return likely
        is_trusted = self._trust >= TRUSTED
        self.in_vain = 0.0 if is_trusted else self.in_vain + LENGTH
        if likely < MAYBE and self._canceller.is_sure:
            self._trust = min(MOST_TRUST, self._trust + 1)
        elif 0 < self._count <= ENOUGH or (self._count and not is_trusted):
            self._trust = max(0, self._trust - COST)
        return likely if is_trusted else 0.0
