"""PocketSphinx: it brings its own model, of English, and is good for a handful of known phrases, and for no more.

Of free speech it gets most words wrong. So it needs the phrases, takes each speech for one of them, and says nothing
where none fits well. Noise is taken out before, as far as it goes on evenly: the model knows none.
"""

import re
from math import log
from typing import Any

import numpy as np
from numpy.typing import NDArray

from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.services.perception.hearing.recognizing import (
    Listening,
    RecognizerSettings,
    SpeechRecognizer,
    SpeechWords,
    Whole,
    missing,
)
from engage_hri.services.perception.hearing.voice import RATE, Samples

FLOOR = 30.0
"""Loudness of noise that is added: where sound is digitally silent the model goes wrong."""
FRAME, HOP = 512, 128
"""Samples of a frame in which noise is taken out, and from one to the next."""
SHORTEST = RATE // 10
"""Samples that may have a word in them."""
QUIETEST = 0.15
"""Share of the frames that are taken for noise alone."""
OVER, LEAST = 1.5, 0.25
"""How much more noise than there is is taken out, and what remains at least: by trial, on phrases in pink noise."""
BEAMS = {"beam": 1e-72, "pbeam": 1e-72, "wbeam": 1e-44}
"""How much less likely than the best what is still looked into may be. With the usual 1e-48 and 7e-29 some of forty
phrases are given up half-way."""
FIT = -4.8
"""Fit of sound and phrase, a logarithm for each frame, below which it was something else: by trial, with these
beams (docs/decisions/0175)."""


class Sphinx(SpeechRecognizer):
    """A recognizer for known phrases."""

    def __init__(self, settings: RecognizerSettings) -> None:
        try:
            import pocketsphinx
        except ImportError as error:
            raise missing("pocketsphinx", error) from error
        if settings.language.lower().replace("_", "-").split("-")[0] != "en":
            reason = f"sphinx understands English alone, and no {settings.language!r}"
            advice = "another recognizer of docs/hearing.md, or hearing.recognizer= for none: people can type"
            raise InputRefused(Fault(reason=reason, where="hearing.language", advice=advice))
        phrases = {plain: phrase for phrase in settings.phrases if (plain := _plain(phrase))}
        if not phrases:
            advice = 'hearing.phrases=\'["yes", "no", "the blue one"]\'; for free speech take another recognizer'
            reason = "sphinx needs the phrases that people may say"
            raise InputRefused(Fault(reason=reason, where="hearing.phrases", advice=advice))
        self._phrases = phrases
        self._decoder: Any = pocketsphinx.Decoder(samprate=RATE, loglevel="FATAL", lm=None, **BEAMS)
        for phrase in phrases:
            if unknown := [word for word in phrase.split() if self._decoder.lookup_word(word) is None]:
                reason = f"the dictionary has no {', '.join(map(repr, unknown))}"
                advice = "say it with words of everyday English: this recognizer knows no other"
                raise InputRefused(Fault(reason=reason, where=f"hearing.phrases: {phrase}", advice=advice))
        self._decoder.add_jsgf_string("phrases", f"#JSGF V1.0; grammar g; public <p> = {' | '.join(phrases)};")
        self._decoder.activate_search("phrases")

    def listen(self) -> Listening:
        return Whole(self._understand)

    def _understand(self, samples: Samples) -> SpeechWords:
        if len(samples) < SHORTEST:
            return SpeechWords("")
        self._decoder.start_utt()
        self._decoder.process_raw(without_noise(samples).tobytes(), full_utt=True)
        self._decoder.end_utt()
        found = self._decoder.hyp()
        if found is None:
            return SpeechWords("")
        parts = [*self._decoder.seg()]
        frames = 1 + parts[-1].end_frame
        fit = sum(log(max(part.ascore, 1e-300)) for part in parts) / frames
        return SpeechWords(self._phrases.get(found.hypstr.strip(), "") if fit >= FIT else "")


def _plain(phrase: str) -> str:
    """The words of a phrase as the dictionary has them."""
    return " ".join(re.findall(r"[a-z]+(?:'[a-z]+)*", phrase.lower().replace("’", "'")))


def without_noise(samples: Samples) -> Samples:
    """Take out noise that goes on evenly (Wiener's filter); a faint hiss remains."""
    count = len(samples)
    padded = np.pad(samples.astype(np.float64), FRAME)
    window = np.hanning(FRAME + 1)[:FRAME]
    places = range(0, len(padded) - FRAME, HOP)
    frames: NDArray[np.complex128] = np.array([np.fft.rfft(padded[at : at + FRAME] * window) for at in places])
    power = np.abs(frames) ** 2
    inner = power[FRAME // HOP : -(FRAME // HOP)] if count > 2 * FRAME else power
    quiet = np.argsort(inner.sum(axis=1))[: max(4, int(QUIETEST * len(inner)))]
    gain = np.maximum(LEAST, 1 - OVER * inner[quiet].mean(axis=0) / (power + 1e-9))
    gain[1:] = (gain[1:] + gain[:-1]) / 2
    made = np.zeros(len(padded))
    for at, frame in zip(places, frames * gain, strict=True):
        made[at : at + FRAME] += np.fft.irfft(frame) * window
    hiss = np.random.default_rng(1).normal(0.0, FLOOR, count)
    clean = made[FRAME : FRAME + count] / 1.5 + hiss  # windows that overlap so add up to 1.5
    return np.clip(clean, -32768, 32767).astype(np.int16)
