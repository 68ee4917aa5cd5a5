"""Spoken sound, made when a test runs: eSpeak NG in two voices, silence around, noise; and where the voice is."""

import wave
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from engage_hri.services.control.voice.clauses import clause
from engage_hri.services.control.voice.espeak import EspeakSettings, EspeakSynthesizer
from engage_hri.services.control.voice.synthesis import Phrase
from engage_hri.services.perception.hearing.sound import resampled
from engage_hri.services.perception.hearing.voice import RATE, Samples

pytest.importorskip("espeakng_loader", reason="needs the extra `voice`")

PHRASES = (
    "yes", "no", "which one", "the blue one", "is this right", "i do not know", "move the purple triangle to the top",
    "what is the next piece", "this one here", "thank you very much",
)  # fmt: skip
VOICES = ("", "f3")
"""Variants of eSpeak NG."""
LOUD = 10000
FAINT = 0.06
"""Share of its loudest 10 ms above which there is voice: 24 dB below. That is the truth."""


class Spoken(NamedTuple):
    """Sound in which somebody speaks. since, until: seconds at which the voice can be heard."""

    samples: Samples
    since: float
    until: float


@cache
def voice(text: str, variant: str = "") -> Samples:
    """A text as it is said, at the rate of hearing."""
    said = clause(EspeakSynthesizer(EspeakSettings(variant=variant)), Phrase(text))
    samples = resampled(np.frombuffer(said.samples, "<i2"), said.rate).astype(np.float64)
    return (samples / np.abs(samples).max() * LOUD).astype(np.int16)


def spoken(
    text: str, variant: str = "", *, before: float = 1.0, after: float = 1.0, noise: float | None = None
) -> Spoken:
    """Sound of a text with silence around. noise: decibels by which the voice is louder than pink noise."""
    said = voice(text, variant)
    level = np.sqrt(np.convolve(said.astype(np.float64) ** 2, np.ones(160) / 160, "same"))
    heard = np.flatnonzero(level > FAINT * level.max()) / RATE
    samples = placed([(before, said)], before + len(said) / RATE + after).astype(np.float64)
    if noise is not None:
        voiced = said[round(heard[0] * RATE) : round(heard[-1] * RATE)].astype(np.float64)
        samples += pink(len(samples)) * np.sqrt(np.mean(voiced**2)) / 10 ** (noise / 20)
    return Spoken(np.clip(samples, -32768, 32767).astype(np.int16), before + heard[0], before + heard[-1])


def pink(count: int) -> NDArray[np.float64]:
    """Noise as of rooms and fans: the deeper the louder. Its standard deviation is 1."""
    spectrum = np.fft.rfft(np.random.default_rng(3).normal(size=count))
    noise = np.fft.irfft(spectrum / np.sqrt(np.maximum(np.fft.rfftfreq(count, 1 / RATE), 50.0)), count)
    return np.asarray(noise / noise.std())


def placed(said: Sequence[tuple[float, Samples]], seconds: float) -> Samples:
    """Silence of so many seconds, with sounds at some of them."""
    samples = np.zeros(round(seconds * RATE), np.int16)
    for at, sound in said:
        samples[round(at * RATE) : round(at * RATE) + len(sound)] = sound
    return samples


def write_wav(path: Path, *channels: Samples, rate: int = RATE) -> Path:
    """Write channels of one length as a file."""
    with wave.open(str(path), "wb") as file:
        file.setnchannels(len(channels))
        file.setsampwidth(2)
        file.setframerate(rate)
        file.writeframes(np.column_stack(channels).astype("<i2").tobytes())
    return path
