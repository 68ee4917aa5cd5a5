"""Lay-out of a synthesized phrase: words in time, shapes of the mouth, and sound without silence around it.

Word times come from the engine where it has them, and from the sound where it has not. What an engine says of words
is
matched to the tokens of the text by its positions: a number may be five words, two words one, and a position wrong.
Pure.
"""

from bisect import bisect_right
from collections.abc import Sequence
from itertools import groupby
from typing import Any

import numpy as np
from msgspec import Struct

from engage_hri.schemas.speakable import Token, tokens
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.voice.alignment import Loudness, Samples, aligned
from engage_hri.services.control.voice.synthesis import Heard, Phrase, Said, Synthesizer, refused
from engage_hri.services.control.voice.timeline import Word
from engage_hri.services.control.voice.visemes import Lips, lips, loud

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
    lips: tuple[Lips, ...]

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


def _lips(said: Said, loudness: Loudness, begin: Seconds, end: Seconds) -> tuple[Lips, ...]:
    if said.phones:
        shown = lips([(phone.name, phone.at) for phone in said.phones if phone.at < end], end)
        return tuple(Lips(max(0.0, each.at - begin), each.opening, each.width) for each in shown)
    size = 6  # frames of the loudness in one shape of the mouth
    levels = loudness.levels / (loudness.loud or 1.0)
    means = [float(min(1.0, levels[at : at + size].mean())) for at in range(0, int(end / loudness.step), size)]
    return tuple(
        Lips(max(0.0, each.at - begin), each.opening, each.width) for each in loud(means, size * loudness.step)
    )


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
