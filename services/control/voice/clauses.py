"""Lay-out of a synthesized phrase: words in time, shapes of the mouth, and sound without silence around it.

Word times come from the engine where it has them, and from the sound where it has not. What an engine says of words
is matched to the tokens of the text by its positions: a number may be five words, two words one, and a position
wrong.

Without an engine's times words are aligned with the sound, by loudness and by how long words of their length take; no
word is recognized. Pauses of the sound are matched to the punctuation of the text; between two pauses words have time
by their letters. Against the word times of eSpeak NG, 77 words of six sentences in five languages, a word is off by
61 ms in the median and by 196 ms in nine of ten (`tests/control/test_own_synthesizer.py`). Pure.
"""

from bisect import bisect_right
from collections.abc import Sequence
from itertools import groupby, pairwise
from typing import Any

import numpy as np
from msgspec import Struct
from msgspec.structs import replace
from numpy.typing import NDArray

from engage_hri.schemas.text import Token, tokens
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.contract.body import MouthShape
from engage_hri.services.control.voice.synthesis import Heard, Phrase, Said, Synthesizer, refused
from engage_hri.services.control.voice.timeline import PAUSE, Word, lips, loud, natural

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


SETTLED: Seconds = 0.03
"""Silence before a word from which on the word begins where it is heard, and not where the engine says."""
MARGIN: Seconds = 0.005
"""Silence that is left before and after the sound."""
SILENT = 33
"""Samples none of which is larger are no speech: -60 dB of the largest there can be, as noise of a converter is."""


class Clause(Struct, frozen=True):
    """A phrase as sound. samples: 16 bit, little-endian, one channel. words, lips: seconds from its start.

    A word of it has its place in the phrase. An emoji, or a token of which nothing is heard, takes no time.
    """

    samples: bytes
    rate: int
    words: tuple[Word, ...]
    lips: tuple[MouthShape, ...]

    @property
    def seconds(self) -> Seconds:
        return len(self.samples) / 2 / self.rate


def clause(synthesizer: Synthesizer, phrase: Phrase) -> Clause:
    """Synthesize and lay out a phrase. Raises SynthesisFailed, also for what is no sound, and for silent words."""
    made = laid_out(phrase.text, synthesizer.say(phrase), synthesizer.rate)
    if any(token.letters for token in tokens(phrase.text)) and not _is_heard(made.samples):
        language = f" in the language {phrase.language!r}" if phrase.language else ""
        raise refused(
            f"{type(synthesizer).__name__} makes no sound of {phrase.text.strip()!r}{language}",
            "does the engine read this script, and is it loud enough?",
        )
    return made


def _is_heard(samples: bytes) -> bool:
    return bool(samples) and int(np.abs(np.frombuffer(samples, "<i2").astype(np.int32)).max()) > SILENT


def laid_out(text: str, said: Said, rate: int) -> Clause:
    """Lay out what an engine has said of a text. rate: samples per second. Raises SynthesisFailed."""
    samples = _samples(said.samples)
    loudness = Loudness(samples, rate)
    all_tokens = list(tokens(text))
    end = loudness.end or len(samples) / rate
    if not len(samples) or not all_tokens:
        return Clause(b"", rate, tuple(Word(token.text, 0.0, 0.0, token.end) for token in all_tokens), ())
    first = max(0, int((loudness.begin - MARGIN) * rate))
    last = min(len(samples), int((end + MARGIN) * rate))
    begin, stop = first / rate, last / rate
    words = []
    for token, (since, until) in zip(all_tokens, _times(all_tokens, said, loudness, end), strict=True):
        since, until = (min(max(each, begin), stop) - begin for each in (since, until))
        words.append(Word(token.text, since, until, token.end))
    return Clause(
        np.ascontiguousarray(samples[first:last], "<i2").tobytes(),
        rate,
        tuple(words),
        _lips(said, loudness, begin, end),
    )


def _samples(given: object) -> Samples:
    """16-bit samples of what an engine returns. Raises SynthesisFailed."""
    advice = "`Said.samples` is to be one channel of 16-bit integers, or of floats from -1 to 1"
    if isinstance(given, bytes | bytearray | memoryview):
        if len(given) % 2:
            raise refused("an odd number of bytes", advice)
        sound: Samples = np.frombuffer(given, "<i2").astype(np.int16)
        return sound
    array: Any = np.asarray(given)
    if array.ndim != 1 or array.dtype.kind not in "fi" or (array.dtype.kind == "i" and array.dtype.itemsize != 2):
        raise refused(f"samples of {array.dtype} in the shape {array.shape}", advice)
    if array.dtype.kind == "i":
        whole: Samples = array.astype(np.int16)
        return whole
    if not np.isfinite(array).all():
        raise refused("samples that are no numbers", advice)
    scaled: Samples = (np.clip(array, -1.0, 1.0) * 32767.0).astype(np.int16)
    return scaled


def _lips(said: Said, loudness: Loudness, begin: Seconds, end: Seconds) -> tuple[MouthShape, ...]:
    if said.phones:
        shown = lips([(phone.name, phone.at) for phone in said.phones if phone.at < end], end)
    else:
        size = 6  # frames of the loudness in one shape of the mouth
        levels = loudness.levels / (loudness.loud or 1.0)
        means = [float(min(1.0, levels[at : at + size].mean())) for at in range(0, int(end / loudness.step), size)]
        shown = loud(means, size * loudness.step)
    return tuple(replace(each, at=max(0.0, each.at - begin)) for each in shown)


def _times(
    all_tokens: Sequence[Token], said: Said, loudness: Loudness, end: Seconds
) -> list[tuple[Seconds, Seconds]]:
    """Start and end of each token. Tokens of which nothing is heard have no time between their neighbours."""
    known = _anchors(all_tokens, said.words)
    spoken = [number for number, token in enumerate(all_tokens) if token.letters or number in known]
    if not spoken:
        return [(loudness.begin, end) for _ in all_tokens[:1]] + [(end, end) for _ in all_tokens[1:]]
    # Each run begins with a token that the engine tells of, and those after it share its time.
    first = spoken[0]
    starts = {number: at for number, at in known.items() if number in set(spoken)}
    starts[first] = loudness.begin
    order = sorted(starts)
    runs = [list(run) for _, run in groupby(spoken, key=lambda number: bisect_right(order, number))]
    began = [starts[run[0]] for run in runs]
    found: dict[int, tuple[Seconds, Seconds]] = {}
    for run, since, until in zip(runs, began, [*began[1:], end], strict=True):
        last = until if until >= end else _word_end(loudness, since, until)
        onset = _onset(loudness, since, last)
        times = [(onset, max(onset, last))]
        if len(run) > 1:
            times = aligned([all_tokens[number] for number in run], loudness, *times[0])
        found |= dict(zip(run, times, strict=True))
    now = loudness.begin
    told = []
    for number in range(len(all_tokens)):
        since, until = found.get(number, (now, now))
        now = max(now, until)
        told.append((min(since, now), now))
    return told


def _anchors(all_tokens: Sequence[Token], heard: Sequence[Heard]) -> dict[int, Seconds]:
    """Times at which the engine begins a token, by its number.

    What goes back in the text or in time is not believed.
    """
    begins = [token.end - len(token.text) for token in all_tokens]
    found: dict[int, Seconds] = {}
    latest, at = -1, -1.0
    for each in heard:
        number = bisect_right(begins, each.position) - 1
        if number >= 0 and each.position >= all_tokens[number].end:  # in the white space before the next
            number += 1
        if max(0, number) > latest and each.at > at and number < len(all_tokens):
            found[max(0, number)] = each.at
            latest = max(0, number)
            at = each.at
    return found


def _word_end(loudness: Loudness, since: Seconds, until: Seconds) -> Seconds:
    """The end of a word after which the next begins at `until`: earlier, if it is silent before that."""
    silence = loudness.silence(until)
    if silence is None or silence[0] <= since or until - silence[0] < SETTLED:
        return until
    return silence[0]


def _onset(loudness: Loudness, since: Seconds, until: Seconds) -> Seconds:
    """The start of a word: where it is heard, if there was silence before it."""
    silence = loudness.silence(since)
    if silence is None or since - silence[0] < SETTLED or silence[1] >= until:
        return since
    return max(since, silence[1])
