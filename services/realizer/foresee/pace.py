"""Pace that a body has shown: of each part that moves, and of the voice from word to word.

Estimates are wrong by what they do not know: a worn joint, a slow voice. A part that took longer than was said will
do so again, so what is still to come is corrected by what was measured (`Experience`).

A mark may be seconds after the last sync point. By that point alone a voice that speaks a third slower is found out
at the mark, when what is tied to it has come too early. So a speech is followed from place to place (`Utterances`):
the sync point that it passed last, then each word that it tells. From the latest place the rest is expected at the
pace that the voice has shown, and a place that does not come is overdue as a sync point is. All of this goes into one
number, the time at which the speech would have passed its latest sync point if it had spoken at its present pace
since, and had waited nowhere: what knows nothing of words counts from there as from the point itself.
"""

from collections import deque
from collections.abc import Collection, Mapping, Sequence
from itertools import accumulate
from statistics import median_low
from typing import NamedTuple

from engage_hri.schemas.body import Estimate, WordTime
from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.plan.phases import Chain
from engage_hri.services.realizer.points import EPSILON

SHORT: Seconds = 0.05
"""A phase shorter than this says nothing about speed."""
PLAUSIBLE = (0.5, 4.0)
"""Least and most ratio of measured to estimated time that says something about speed.

Less, and the part was nearer than believed; more, and it stood still.
"""
NOISE = 0.02
"""Difference of a ratio from 1 below which the estimate counts as right."""
REMEMBERED = 9
"""Number of the latest phases of a part that count, and of the latest words of a speech."""
FINE = 0.01
"""As `NOISE`, for a speech that tells its words: what it has shown itself is worth more than what its part has."""
ALIKE = 0.25
"""Difference from the median of words, as a share of it, from which on one says nothing: the voice stood."""


class Experience:
    """Measured speed of each part. A joint that was twice as slow will be twice as slow in the next phases, too.

    estimates: of the body, by behavior.
    """

    def __init__(self, estimates: Mapping[str, Estimate]) -> None:
        self._parts = {id: estimate.parts for id, estimate in estimates.items()}
        self._users: dict[str, list[str]] = {}
        for id, parts in self._parts.items():
            for part in parts:
                self._users.setdefault(part, []).append(id)
        self._ratios: dict[str, deque[float]] = {}
        self._factor: dict[str, float] = {}
        self._words: dict[str, deque[tuple[Seconds, Seconds]]] = {}
        """Of speeches that tell their words, the seconds that the latest of these took, and those expected."""
        self._paces: dict[str, float] = {}
        """The factor of each of these."""

    def factor(self, behavior: str) -> float:
        """Factor by which the behavior is expected to take longer than estimated."""
        if (pace := self._paces.get(behavior)) is not None:
            return pace
        return max((self._factor.get(part, 1.0) for part in self._parts.get(behavior, ())), default=1.0)

    def learn_words(self, behavior: str, expected: Seconds, took: Seconds) -> Collection[str]:
        """Note that words of a speech took so long, as `learn`; from then on it has a factor of its own.

        It is that of all its latest words together but for those that are no measure: an error in when one word ended
        is the next word's with the other sign, and cancels out.
        """
        known = self.factor(behavior)
        changed = dict.fromkeys(self.learn(behavior, expected, took))
        if expected < SHORT or not PLAUSIBLE[0] <= took / expected <= PLAUSIBLE[1]:
            return tuple(changed)
        words = self._words.setdefault(behavior, deque(maxlen=REMEMBERED))
        words.append((took, expected))
        median = median_low(each / natural for each, natural in words)
        alike = [each for each in words if abs(each[0] / each[1] - median) <= ALIKE * median]
        pace = sum(each for each, _ in alike) / sum(natural for _, natural in alike)
        pace = pace if abs(pace - 1.0) > FINE else 1.0
        self._paces[behavior] = pace if abs(pace - known) > FINE * known else known
        return tuple(changed if self._paces[behavior] == known else {**changed, behavior: None})

    def learn(self, behavior: str, expected: Seconds, took: Seconds) -> Collection[str]:
        """Note that a phase of `behavior` took so long; returns the behaviors that have another `factor` now."""
        if expected < SHORT or not PLAUSIBLE[0] <= took / expected <= PLAUSIBLE[1]:
            return ()
        changed: dict[str, None] = {}
        for part in self._parts.get(behavior, ()):
            ratios = self._ratios.setdefault(part, deque(maxlen=REMEMBERED))
            ratios.append(took / expected)
            known, factor = self._factor.get(part, 1.0), median_low(ratios)
            factor = factor if abs(factor - 1.0) > NOISE else 1.0
            if abs(factor - known) > NOISE * known:
                self._factor[part] = factor
                changed.update(dict.fromkeys(self._users[part]))
        return tuple(changed)


PUNCTUAL: Seconds = 0.001
"""Difference from the expected time, in seconds, up to which a word changes nothing: clocks of two processes are
compared, and an exact voice is to have an exact plan."""


class Interval(NamedTuple):
    """Words that a voice said between two places: since when, and the seconds that were estimated for it."""

    since: Seconds
    natural: Seconds


class _Speech:
    """One speech with word times. All seconds of its estimate are from its start, as if it waited nowhere."""

    def __init__(self, chain: Chain, words: Sequence[WordTime]) -> None:
        self.points = [0.0, *accumulate(segment.natural for segment in chain.segments)]
        self.words = words
        self.number_of = {word.position: number for number, word in enumerate(words)}
        self.passed = 0
        """Number of its sync points that were passed."""
        self.word = 0
        """Number of the next word to be told."""
        self.place = self.at = 0.0
        """The latest place, by the estimate, and when it was there."""
        self.taught = (0.0, 0.0)
        """The place up to which it has taught its pace, and when it was there."""
        self.since = 0.0
        """See the module."""

    def come(self, place: Seconds, at: Seconds) -> None:
        self.place, self.at = place, at

    @property
    def latest_point(self) -> Seconds:
        return self.points[self.passed - 1]

    @property
    def next_point(self) -> Seconds:
        return self.points[self.passed]

    def skip(self, place: Seconds) -> int:
        """Expect no word that ends by `place` any more; returns how many of them were not told."""
        before = self.word
        while self.word < len(self.words) and self.words[self.word].end <= place + EPSILON:
            self.word += 1
        return self.word - before


class Utterances:
    """The speeches of a block that have begun and whose estimates have the times of their words.

    since: the time at which each would have passed its latest sync point; see the module.
    """

    def __init__(self, experience: Experience) -> None:
        self._experience = experience
        self._speeches: dict[str, _Speech] = {}
        self.since: dict[str, Seconds] = {}
        self._lag = 0.0
        """Seconds between the end of the latest word and the news of it: silence is not known sooner."""
        self._skipped = 0
        """Most words in a row that the voice has not told: so many may be missing without being overdue."""

    def pass_point(self, chain: Chain, words: Sequence[WordTime], passed: int, at: Seconds) -> None:
        """Note that so many points of a speech are passed, the last one at `at`. What is known already is no news.

        words: of its estimate; without them nothing is followed.
        """
        id = chain.behavior.id
        speech = self._speeches.get(id)
        if speech is not None and speech.words is words and speech.passed == passed:
            return
        if not words or not 0 < passed < len(chain.points):
            self._speeches.pop(id, None)
            self.since.pop(id, None)
            return
        is_known = speech is not None and speech.passed == passed
        if speech is None or speech.words is not words:
            number, before = 0 if speech is None else speech.word, speech
            speech = self._speeches[id] = _Speech(chain, words)
            speech.word = number
            if is_known and before is not None:  # the same words at other times, in another plan
                speech.passed, speech.since = passed, before.since
                place = words[number - 1].end if 0 < number <= len(words) else 0.0
                speech.come(max(speech.latest_point, place), before.at)
                speech.taught = (speech.place, speech.at)
                return
        speech.passed = passed
        if passed > 1:
            self._skipped = max(self._skipped, speech.skip(speech.latest_point))
        speech.come(speech.latest_point, at)
        speech.taught = (speech.place, at)
        self.since[id] = speech.since = at

    def hear(self, id: str, position: int, at: Seconds, now: Seconds) -> bool:
        """Take a word; False: it is not of the phase that the speech is in, or no news. at: when it was finished."""
        speech = self._speeches.get(id)
        number = None if speech is None else speech.number_of.get(position)
        if speech is None or number is None:
            return False
        self._lag = max(0.0, now - at)
        place = speech.words[number].end
        if number < speech.word or place > speech.next_point + EPSILON:
            return False
        self._skipped = max(self._skipped, number - speech.word)
        speech.word = number + 1
        speech.come(place, max(at, speech.at))
        return True

    def interval(self, id: str, *, to_point: bool = False) -> Interval | None:
        """Words that the speech has said since it taught its pace last, up to its latest place or to its next point.

        None: it is not followed, or that is too short to say something.
        """
        if (speech := self._speeches.get(id)) is None:
            return None
        place, at = speech.taught
        here = speech.next_point if to_point else speech.place
        return Interval(at, here - place) if here - place >= SHORT else None

    def teach(self, id: str) -> None:
        """Note that what was said up to the latest place is known by now."""
        speech = self._speeches[id]
        speech.taught = (speech.place, speech.at)

    def go_on(self, id: str, now: Seconds) -> None:
        """Note that a voice that stood after a word goes on now: with the next word, unless it pauses longer."""
        if (speech := self._speeches.get(id)) is None:
            return
        pace = self._experience.factor(id)
        starts = [word.start for word in speech.words[speech.word :][:1]]
        place = max(speech.place, min([*starts, speech.next_point]))
        speech.come(place, max(now, speech.at + pace * (place - speech.place)))
        self.teach(id)

    def measured(self, id: str) -> Seconds | None:
        """Time at which the speech was at its latest place; None: it is not followed."""
        return None if (speech := self._speeches.get(id)) is None else speech.at

    def follows(self, id: str) -> bool:
        """True if the words of this speech are followed."""
        return id in self._speeches

    def settle(self, id: str, now: Seconds) -> Seconds:
        """Draw the conclusion of what was heard by now; returns the seconds by which the speech is later than before.

        A word that is overdue by a second is expected a second from now, as a sync point would be.
        """
        speech, pace = self._speeches[id], self._experience.factor(id)
        place, due = self._next(speech, pace)
        overdue = now - self._lag - due
        if overdue > EPSILON:
            due += 2.0 * overdue
        else:
            place, due = speech.place, speech.at
        since = due - pace * (place - speech.latest_point)
        later = since - speech.since
        if abs(later) <= PUNCTUAL and overdue <= EPSILON:
            return 0.0
        self.since[id] = speech.since = since
        return later

    def next_check(self) -> Seconds | None:
        """The time from which on a word is overdue that has yet to come; None: none is expected."""
        due = [self._next(each, self._experience.factor(id))[1] for id, each in self._speeches.items()]
        return min(due) + self._lag if due else None

    def _next(self, speech: _Speech, pace: float) -> tuple[Seconds, Seconds]:
        """The next place that the voice is to tell, and when it is expected there."""
        number = speech.word + self._skipped
        word = speech.words[number].end if number < len(speech.words) else speech.next_point
        place = min(word, speech.next_point)
        return place, speech.at + pace * (place - speech.place)
