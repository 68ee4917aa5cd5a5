"""What is said of hypotheses 6, 7, 8 and 11, from records worked by hand."""

import pytest

from engage_hri.schemas.recognition import KindStatistics
from engage_hri.services.study.hypotheses import HypothesisResult, findings
from engage_hri.services.study.records import SessionRecord
from tests.study.sessions import kind, session

WORSE = "degraded-generation"


def pair(delay: float) -> KindStatistics:
    return kind("adjacency_pair", 10, delay=delay)


def study(sessions: int = 6) -> list[SessionRecord]:
    """Degraded: pairs 2 s further apart, answered 0.5 s later, sooner done by 10 s; the person looks away."""
    good = [
        session("operational", k, pair(1.0), completion=150.0 + k, pairs=7.0 + k, face=(0.3, 0.3, 0.3 + 0.01 * k))
        for k in range(sessions)
    ]
    bad = [
        session(WORSE, k, pair(1.5), completion=140.0 + k, pairs=9.0 + k, face=(0.3, 0.2, 0.1 - 0.01 * k))
        for k in range(sessions)
    ]
    return [*good, *bad]


def by_name(found: list[HypothesisResult]) -> dict[str, HypothesisResult]:
    return {finding.hypothesis: finding for finding in found}


def test_each_hypothesis_is_answered_with_its_difference():
    found = by_name(findings(study()))

    assert list(found) == ["6", "7", "8", "11a", "11b"]
    assert (found["6"].operational, found["6"].degraded, found["6"].difference) == (9.5, 11.5, 2.0)
    assert found["7"].difference == pytest.approx(0.5)
    assert found["8"].difference == -10.0
    assert (found["11a"].operational, found["11a"].degraded) == (None, pytest.approx(-0.225))
    assert found["11b"].difference == pytest.approx(-0.25)
    assert {finding.n for finding in found.values()} == {6}


def test_the_verdict_needs_direction_and_significance():
    found = by_name(findings(study(10)))

    assert found["6"].p == pytest.approx(2 / 1024)
    assert found["6"].p_corrected == pytest.approx(5 * 2 / 1024)  # five questions
    assert {name: finding.verdict for name, finding in found.items()} == {
        "6": "supported", "7": "supported", "8": "opposite", "11a": "supported", "11b": "supported",
    }  # fmt: skip


def test_six_sessions_are_not_enough_for_five_questions():
    found = by_name(findings(study(6)))

    assert found["6"].p == 2 / 64
    assert found["6"].verdict == "not shown"


def test_few_sessions_are_too_few():
    assert {finding.verdict for finding in findings(study(3))} == {"too few sessions"}


def test_sessions_are_paired_by_number_whatever_their_order():
    assert findings(study()[::-1]) == findings(study())


def test_only_pairs_with_both_sessions_and_both_values_count():
    records = study()
    records[0] = session("operational", 0, pair(1.0), completion=150.0, pairs=None, face=(0.3, 0.3, 0.3))
    records[-1] = session(WORSE, 5, pair(1.5), completion=1.0, pairs=1.0, reason="died")

    found = by_name(findings(records))

    assert (found["6"].n, found["8"].n, found["11a"].n) == (4, 5, 5)


def test_without_the_operational_condition_only_what_needs_no_comparison_is_answered():
    found = findings([record for record in study() if record.condition == WORSE])

    assert [finding.hypothesis for finding in found] == ["11a"]


def test_one_condition_alone_raises_no_question():
    assert findings([record for record in study() if record.condition == "operational"]) == []
    assert findings([session("human-human", 0, face=(0.1, 0.1, 0.1))]) == []
    assert findings([]) == []


def test_sessions_without_any_event_are_nothing_to_compare():
    found = findings([session(name, k) for name in ("operational", WORSE) for k in range(8)])

    assert {(finding.n, finding.p, finding.verdict) for finding in found} == {(0, None, "nothing to compare")}


def test_conditions_that_do_the_same_show_nothing():
    same = [
        session(name, k, pair(1.0), completion=150.0, pairs=7.0) for name in ("operational", WORSE) for k in range(8)
    ]

    found = by_name(findings(same))

    for name in ("6", "7", "8"):
        assert (found[name].difference, found[name].p, found[name].effect) == (0.0, 1.0, None)
        assert found[name].verdict == "not shown"
