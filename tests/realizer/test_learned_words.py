"""What a voice teaches by its words, against a slow computation from its definition (decision 0094)."""

from itertools import pairwise
from random import Random
from statistics import median_low

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec import Struct, field

from engage_hri.schemas.behaviors import Speech
from engage_hri.schemas.body import Estimate, Phase, WordTime
from engage_hri.services.realizer.foresee.experience import Experience
from engage_hri.services.realizer.foresee.utterances import Utterances
from engage_hri.services.realizer.plan.phases import chain
from tests.random_cases import share_of


class Definition(Struct):
    """All that was heard of a speech without marks, from which everything is computed anew each time.

    ends: of its words, and of the speech, by the estimate. heard: number of each word, when it ended, and when that
    was told. settled: the times at which it was asked when the speech would have begun at its present pace.
    """

    ends: list[float]
    began: float
    heard: list[tuple[int, float, float]] = field(default_factory=list)
    settled: list[tuple[int, float]] = field(default_factory=list)

    def lessons(self, heard: int) -> list[tuple[float, float]]:
        """Seconds that words took and were estimated to take; what is shorter than 50 ms goes with what follows."""
        found, since, place = [], self.began, 0.0
        for number, at, _ in self.heard[:heard]:
            if self.ends[number] - place >= 0.05:
                found.append((at - since, self.ends[number] - place))
                since, place = at, self.ends[number]
        return found

    def pace(self, heard: int) -> float:
        """The time that the latest nine words took, times their estimate; those far off the median do not count."""
        pace, counted = 1.0, list[tuple[float, float]]()
        for took, natural in self.lessons(heard):
            if not 0.5 <= took / natural <= 4.0:
                continue
            counted = [*counted, (took, natural)][-9:]
            median = median_low([one / other for one, other in counted])
            alike = [each for each in counted if abs(each[0] / each[1] - median) <= median / 4.0]
            new = sum(one for one, _ in alike) / sum(other for _, other in alike)
            new = 1.0 if abs(new - 1.0) <= 0.01 else new
            pace = new if abs(new - pace) > 0.01 * pace else pace
        return pace

    def since(self) -> float:
        """When it would have begun at its pace: counted from its latest word, or from one that is overdue."""
        since = self.began
        for heard, now in self.settled:
            told, pace = self.heard[:heard], self.pace(heard)
            number, at, news = told[-1] if told else (-1, self.began, self.began)
            gaps = [two - one - 1 for one, two in pairwise([-1, *(each[0] for each in told)])]
            place = self.ends[number] if told else 0.0
            awaited = self.ends[min(number + 1 + max(gaps, default=0), len(self.ends) - 1)]
            due = at + pace * (awaited - place)
            overdue = now - max(0.0, news - at) - due
            if overdue > 1e-6:
                since = due + 2.0 * overdue - pace * awaited
            elif abs(at - pace * place - since) > 0.001:
                since = at - pace * place
        return since


@settings(max_examples=share_of(200), deadline=None)
@given(st.integers(0, 10**9))
def test_a_voice_teaches_what_the_definition_says(seed: int) -> None:
    chance = Random(seed)
    words, end = [], 0.0
    for number in range(chance.randint(1, 14)):
        start = end + chance.choice((0.0, 0.0, 0.1, chance.uniform(0.0, 0.8)))
        end = start + chance.choice((0.03, 0.2, chance.uniform(0.05, 0.9)))
        words.append(WordTime(position=3 * number + 2, start=start, end=end))
    phases = (Phase(since="start", to="end", shortest=end + 0.1, natural=end + 0.1, longest=end + 0.1),)
    estimate = Estimate(behavior="s", feasible=True, parts=("voice",), phases=phases, words=tuple(words))
    experience = Experience({"s": estimate})
    utterances = Utterances(experience)
    began, lag = chance.uniform(0.0, 5.0), chance.random() / 10
    pace = chance.choice((1.0, 1.0, chance.uniform(0.7, 1.6)))
    utterances.pass_point(chain(Speech(id="s", text="x"), estimate), words, 1, began)
    definition = Definition([*(word.end for word in words), end + 0.1], began)
    slip, at, shown = chance.choice((0.0, 0.0005, 0.1)), began, began
    for number, word in enumerate(words):
        if chance.random() < 0.1:
            continue
        at = max(at, began + pace * word.end + chance.uniform(-slip, slip))
        for _ in range(chance.choice((0, 0, 1, 2))):
            shown = chance.uniform(shown, at + lag)
            utterances.settle("s", shown)
            definition.settled.append((len(definition.heard), shown))
        assert utterances.hear("s", word.position, at, at + lag)
        definition.heard.append((number, at, at + lag))
        if (interval := utterances.interval("s")) is not None:
            experience.learn_words("s", interval.natural, at - interval.since)
            utterances.teach("s")
        shown = at + lag
        utterances.settle("s", shown)
        definition.settled.append((len(definition.heard), shown))
        assert experience.factor("s") == pytest.approx(definition.pace(len(definition.heard)), abs=1e-9)
        assert utterances.since["s"] == pytest.approx(definition.since(), abs=1e-9)
    assert pace != 1.0 or slip or experience.factor("s") == 1.0, "an exact voice has taught something"
