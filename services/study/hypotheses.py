"""Conditions of the study, and the hypotheses of the thesis that statistics can speak to (5.2.2: 6, 7, 8 and 11).

The policies know nothing of a study: a condition is a configuration that any robot could be given. Thesis, chapter 5.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Literal, get_args

from msgspec import Struct

from engage_hri.schemas.units import Probability
from engage_hri.services.study.permutation import LEVEL, Paired, holm, paired, separate
from engage_hri.services.study.records import SessionRecord

Condition = Literal["operational", "degraded-generation", "degraded-recognition"]
CONDITIONS: tuple[Condition, ...] = get_args(Condition)
BASELINE: Condition = "operational"
DEGRADED = tuple(condition for condition in CONDITIONS if condition != BASELINE)
"""Conditions that are compared with the baseline."""

DEGRADATIONS: Mapping[str, tuple[str, ...]] = {
    "operational": (),
    "degraded-generation": (),
    "degraded-recognition": (
        "simulation.faults.missed_look=0.5",
        "simulation.faults.wrong_look=0.3",
        "simulation.faults.dropped_speech=0.5",
    ),
}
"""Settings that make a condition worse, besides `generation.condition`; weaker than the user's own settings.

Degraded recognition is only named in the thesis. Here it is poor perception: half of the person's looks are not
noticed, three in ten of the others are taken for a look at something near, and half of the person's utterances are
not heard. The robot's own behavior is complete, but rests on this perception.
"""


Measure = Callable[[SessionRecord], float | None]

CAVEAT = (
    "The person is a model. The sessions show what the robot's behavior does to an interaction with somebody who "
    "reacts in just this way, not how people would react. That a look that is not returned makes the next one rarer "
    "is built into the stochastic person (`simulation.reciprocity`): 11 shows how strong the effect of "
    "that would be, not that there is one. All is counted through the perception of the condition: in degraded "
    "recognition a part of 6 and 7, and most of 11, is what is not seen. With enough sessions any difference, "
    "however small, gets a small p: read the difference and its interval first."
)


PEOPLE_CAVEAT = (
    "The hypotheses are those of the thesis, for a robot whose policies were degraded; whether they are yours, this "
    "command cannot know. It does not know either who was given which condition and why, what differed besides the "
    "condition, or what became of those who are not among these files. Order and practice are left out of account. "
    "All is counted by recognition, through the perception of each session: where perception differed, part of a "
    "difference is what was not seen. Read the difference and its interval first: with few people no test shows much."
)
"""What the numbers of recorded people cannot say."""


class Hypothesis(Struct, frozen=True, kw_only=True):
    """name: its number in the thesis. sign: of the difference expected, degraded - operational; or of the value
    itself, if there is no `baseline` to compare with.
    """

    name: str
    claim: str
    measure: str
    unit: str
    value: Measure
    sign: int
    baseline: bool = True


def _change(record: SessionRecord) -> float | None:
    return record.eye_contact.change if record.eye_contact else None


HYPOTHESES = (
    Hypothesis(
        name="6", claim="the mean time between adjacency pairs is less in operational", sign=1, unit="s",
        measure="mean time between starts of adjacency pairs", value=lambda record: record.adjacency_pairs_every,
    ),
    Hypothesis(
        name="7", claim="the mean adjacency pair delay is less in operational", sign=1, unit="s",
        measure="mean delay of the adjacency pairs that were answered",
        value=lambda record: record.of("adjacency_pair").delay_mean,
    ),
    Hypothesis(
        name="8", claim="the puzzle is completed sooner in operational", sign=1, unit="s",
        measure="completion time", value=lambda record: record.completion_time,
    ),
    Hypothesis(
        name="11a", claim="people make progressively less eye contact when degraded", sign=-1, unit="of the time",
        measure="look at the robot's face, as seen, last third - first third", value=_change, baseline=False,
    ),
    Hypothesis(
        name="11b", claim="and their eye contact falls more than in operational", sign=-1, unit="of the time",
        measure="the same, difference from operational", value=_change,
    ),
)  # fmt: skip


class HypothesisResult(Struct, frozen=True, kw_only=True):
    """A hypothesis in one degraded condition: a row of hypotheses.csv.

    operational, degraded: means over the n sessions compared (operational: None if it is not compared with).
    difference: their mean difference, with the interval low..high that the test does not reject.
    effect, p: see `permutation.Paired`. p_corrected: for the number of questions asked (Holm).
    """

    hypothesis: str
    claim: str
    measure: str
    unit: str
    condition: str
    n: int
    operational: float | None
    degraded: float | None
    difference: float | None
    low: float | None
    high: float | None
    effect: float | None
    p: Probability | None
    p_corrected: Probability | None
    verdict: str


def findings(
    records: Sequence[SessionRecord],
    *,
    baseline: str = BASELINE,
    others: Sequence[str] = DEGRADED,
    is_paired: bool = True,
) -> list[HypothesisResult]:
    """Test every hypothesis in every other condition, with the finished sessions.

    is_paired: sessions of one number belong together; else all are of different people.
    """
    values = {(record.condition, record.session): record for record in records if record.finished}
    conditions = {record.condition for record in records}
    operational = baseline in conditions
    asked = [
        (hypothesis, condition, *_samples(hypothesis, condition, values, baseline, is_paired=is_paired))
        for condition in others
        if condition in conditions
        for hypothesis in HYPOTHESES
        if operational or not hypothesis.baseline
    ]
    tests = [
        paired([worse - base for base, worse in zip(bases, degraded, strict=True)])
        if is_paired or not hypothesis.baseline
        else separate(bases, degraded)
        for hypothesis, _, bases, degraded in asked
    ]
    corrected = holm([test.p for test in tests])
    return [
        HypothesisResult(
            hypothesis=hypothesis.name, claim=hypothesis.claim, measure=hypothesis.measure, unit=hypothesis.unit,
            condition=condition, n=test.n, operational=_mean(bases) if hypothesis.baseline else None,
            degraded=_mean(degraded), difference=test.mean, low=test.low, high=test.high, effect=test.effect,
            p=test.p, p_corrected=p, verdict=_verdict(hypothesis, test, p),
        )
        for (hypothesis, condition, bases, degraded), test, p in zip(asked, tests, corrected, strict=True)
    ]  # fmt: skip


def _samples(
    hypothesis: Hypothesis,
    condition: str,
    records: dict[tuple[str, int], SessionRecord],
    baseline: str,
    *,
    is_paired: bool,
) -> tuple[list[float], list[float]]:
    """Measurements of sessions in both conditions: of pairs, without those that lack one; or of all."""
    if not is_paired and hypothesis.baseline:
        measured = {name: [hypothesis.value(one) for (of, _), one in sorted(records.items()) if of == name]
                    for name in (baseline, condition)}  # fmt: skip
        known = {name: [value for value in values if value is not None] for name, values in measured.items()}
        return known[baseline], known[condition]
    bases, degraded = [], []
    for (name, session), record in sorted(records.items()):
        if name != condition:
            continue
        twin = records.get((baseline, session))
        base = (hypothesis.value(twin) if twin else None) if hypothesis.baseline else 0.0
        value = hypothesis.value(record)
        if base is not None and value is not None:
            bases.append(base)
            degraded.append(value)
    return bases, degraded


def _mean(values: Sequence[float]) -> float | None:
    return sum(values) / len(values) if values else None


def _verdict(hypothesis: Hypothesis, test: Paired, p: Probability | None) -> str:
    if test.mean is None or p is None:
        return "nothing to compare"
    if test.low is None:
        return "too few sessions"
    if p >= LEVEL:
        return "not shown"
    return "supported" if test.mean * hypothesis.sign > 0 else "opposite"
