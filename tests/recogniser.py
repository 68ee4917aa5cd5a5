"""An independent recogniser of speech, PocketSphinx, which says where given words are in a sound."""

import re
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

RATE = 16000
"""Samples per second that it takes."""
QUIET = 0.3
"""Seconds of silence around what it hears."""
UNKNOWN = {"trapezoid": "T R AE P AH Z OY D", "tangram": "T AE NG G R AE M", "ummmm": "AH M"}
"""Words that its dictionary lacks, with their sounds."""


class Recogniser:
    """Forced alignment. Skips the test where PocketSphinx is not installed."""

    def __init__(self) -> None:
        sphinx = pytest.importorskip("pocketsphinx", reason="pip install pocketsphinx")
        self._decoder: Any = sphinx.Decoder(samprate=RATE, loglevel="FATAL")
        for number, (word, phones) in enumerate(UNKNOWN.items(), 1):
            self._decoder.add_word(word, phones, number == len(UNKNOWN))

    def aligned(
        self, sound: NDArray[np.float64], rate: int, since: float, until: float, words: Sequence[str]
    ) -> list[tuple[float, float]]:
        """Seconds at which words begin and end, between two seconds of a sound; empty: it finds no way.

        sound: samples. rate: of them per second.
        """
        first = max(0, int(since * rate))
        piece = sound[first : int(until * rate)]
        times = np.arange(0.0, len(piece) / rate, 1 / RATE)
        samples = np.interp(times, np.arange(len(piece)) / rate, piece).astype("<i2").tobytes()
        quiet = bytes(2 * round(QUIET * RATE))
        self._decoder.set_align_text(" ".join(re.sub("[^a-z']", "", word.lower()) for word in words))
        self._decoder.start_utt()
        self._decoder.process_raw(quiet + samples + quiet, full_utt=True)
        self._decoder.end_utt()
        if self._decoder.hyp() is None:
            return []
        begin = max(0.0, since) - QUIET
        heard = [each for each in self._decoder.seg() if each.word[0] not in "<(["]
        return [(begin + each.start_frame / 100, begin + (each.end_frame + 1) / 100) for each in heard]
