"""Alignment of words with sound: by loudness and by how long words of their length take. No recognition. Pure.

Pauses of the sound are matched to the punctuation of the text; between two pauses words have time by their letters.
Against the word times of eSpeak NG, 77 words of six sentences in five languages, a word is off by 61 ms in the median
and by 196 ms in nine of ten (`tests/control/test_own_synthesizer.py`). An engine that knows its words tells better.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from engage_hri.schemas.speakable import Token
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.voice.timeline import PAUSE, natural

Samples = NDArray[np.int16]

FRAME: Seconds = 0.01
"""Length of the frames whose loudness is looked at: one period of a voice of 100 Hz."""
QUIET = 0.012
"""Share of the loudness of loud frames (the 95th percentile) below which a frame is silent: -38 dB."""
SHORTEST_PAUSE: Seconds = 0.08
"""Silence from which on it may be a pause, and no closure of a plosive."""


class Loudness:
    """Loudness of a sound in frames, and where it is silent. Times are seconds from its start."""

    def __init__(self, samples: Samples, rate: int) -> None:
        """Measure a sound. samples: one channel. rate: samples per second."""
        self.size = max(1, round(rate * FRAME))
        self.step: Seconds = self.size / rate
        whole = np.zeros(-(-len(samples) // self.size) * self.size, np.float32)
        whole[: len(samples)] = samples
        self.levels: NDArray[np.float32] = np.sqrt(np.mean(np.square(whole.reshape(-1, self.size)), axis=1))
        self.loud = float(np.percentile(self.levels, 95)) if len(self.levels) else 0.0
        self.heard: NDArray[np.bool_] = self.levels > max(QUIET * self.loud, 2.0)
        self._voiced = np.concatenate([[0.0], np.cumsum(self.heard) * self.step])

    @property
    def begin(self) -> Seconds:
        """Time of the first frame that is heard; 0 if there is none."""
        return float(np.argmax(self.heard)) * self.step if self.heard.any() else 0.0

    @property
    def end(self) -> Seconds:
        """End of the last frame that is heard; 0 if there is none."""
        return float(len(self.heard) - np.argmax(self.heard[::-1])) * self.step if self.heard.any() else 0.0

    def voiced(self, until: Seconds) -> Seconds:
        """Seconds that are heard until a time."""
        return float(np.interp(until / self.step, np.arange(len(self._voiced)), self._voiced))

    def at_voiced(self, voiced: Seconds) -> Seconds:
        """The earliest time until which so many seconds are heard."""
        place = int(np.searchsorted(self._voiced, voiced - 1e-9))
        if place == 0:
            return self.begin
        short = self._voiced[place] - voiced
        return max(0.0, place * self.step - float(short))

    def silence(self, at: Seconds) -> tuple[Seconds, Seconds] | None:
        """The silence in which a time lies, or that ends or begins within a frame of it; None: there is sound."""
        place = min(len(self.heard) - 1, int(at / self.step + 1e-6))
        for near in (place, place - 1, place + 1):
            if 0 <= near < len(self.heard) and not self.heard[near]:
                before, after = self.heard[:near][::-1], self.heard[near:]
                since = near - (int(np.argmax(before)) if before.any() else near)
                until = near + (int(np.argmax(after)) if after.any() else len(after))
                return since * self.step, until * self.step
        return None

    def pauses(self, begin: Seconds, end: Seconds) -> list[tuple[Seconds, Seconds]]:
        """Silences within a time, of at least `SHORTEST_PAUSE`."""
        edges = np.flatnonzero(np.diff(np.concatenate([[True], self.heard, [True]]).astype(np.int8)))
        silent = [(since * self.step, until * self.step) for since, until in edges.reshape(-1, 2).tolist()]
        return [
            (since, until)
            for since, until in silent
            if since > begin and until < end and until - since >= SHORTEST_PAUSE - 1e-6
        ]


def aligned(
    tokens: Sequence[Token], loudness: Loudness, begin: Seconds, end: Seconds
) -> list[tuple[Seconds, Seconds]]:
    """Start and end of each token between two times of a sound. Each token has something to say."""
    weights = [natural(token) for token in tokens]
    pauses = loudness.pauses(begin, end)
    places = _matched(tokens, weights, loudness, pauses, begin, end)
    found: list[tuple[Seconds, Seconds]] = []
    cuts = [0, *places, len(tokens)]
    starts = [begin, *(until for _, until in pauses)]
    ends = [*(since for since, _ in pauses), end]
    # A pause at no word's end is within a word: what is before and behind it is one run.
    runs: list[tuple[int, int, Seconds, Seconds]] = []
    for first, last, since, until in zip(cuts[:-1], cuts[1:], starts, ends, strict=True):
        if runs and (first == last or runs[-1][0] == runs[-1][1]):
            runs[-1] = (runs[-1][0], last, runs[-1][2], until)
        else:
            runs.append((first, last, since, until))
    for first, last, since, until in runs:
        found += _shared(weights[first:last], loudness, since, until)
    return found


def _matched(
    tokens: Sequence[Token],
    weights: Sequence[Seconds],
    loudness: Loudness,
    pauses: Sequence[tuple[Seconds, Seconds]],
    begin: Seconds,
    end: Seconds,
) -> list[int]:
    """For each pause the number of tokens before it: the one with the least cost, by dynamic programming.

    The cost is by how much the words before a pause would be too long or too short, squared, and more where the text
    has no punctuation; a pause that is longer costs more there.
    """
    count = len(tokens)
    said = np.concatenate([[0.0], np.cumsum(weights)]) / max(1e-9, sum(weights))
    heard = loudness.voiced(end) - loudness.voiced(begin)
    expected = said * heard
    punctuated = np.array(
        [0.0, *(max((PAUSE.get(each, 0.0) for each in token.closing), default=0.0) for token in tokens)]
    )
    costs = np.zeros(count + 1)
    choices = []
    for since, until in pauses:
        here = loudness.voiced(since) - loudness.voiced(begin)
        own = (expected - here) ** 2 + np.where(punctuated > 0.0, 0.0, (until - since) * 0.5)
        before = np.minimum.accumulate(costs)
        first = np.array([int(np.argmin(costs[: place + 1])) for place in range(count + 1)])
        choices.append(first)
        costs = before + own
    place = int(np.argmin(costs))
    found = []
    for first in reversed(choices):
        found.append(place)
        place = int(first[place])
    return found[::-1]


def _shared(
    weights: Sequence[Seconds], loudness: Loudness, begin: Seconds, end: Seconds
) -> list[tuple[Seconds, Seconds]]:
    """Share the heard part of a time among words by their weights."""
    if not weights:
        return []
    since, until = loudness.voiced(begin), loudness.voiced(end)
    if until - since < FRAME:  # nothing is heard there
        cuts = [begin + share * (end - begin) for share in _shares(weights)]
    else:
        inner = [loudness.at_voiced(since + share * (until - since)) for share in _shares(weights)[1:-1]]
        cuts = [begin, *(min(end, max(begin, each)) for each in inner), end]
    return list(pairwise(cuts))


def _shares(weights: Sequence[Seconds]) -> list[float]:
    total = sum(weights)
    return [0.0, *(float(each) / total for each in np.cumsum(weights)[:-1]), 1.0]
