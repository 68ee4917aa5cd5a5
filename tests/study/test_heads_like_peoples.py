"""The robot's head in whole sessions, by arrivals and departures alone, against people's figures."""

from tests.study.head_sessions import session, sum_of
from tests.study.robot_head import HeadFindings, findings


def people_do(seen: HeadFindings) -> None:
    """Figures of people, with their sources in docs/generation.md."""
    assert seen.on_face >= 0.85
    assert seen.brief_share <= 0.05
    assert 4.0 <= seen.aways_a_minute <= 11.0
    assert seen.broken_by_hands == 0


def test_the_head_of_a_robot_that_gives_instructions_is_like_peoples() -> None:
    people_do(sum_of([findings(session(seed)) for seed in (701, 702)]))


def test_the_head_of_a_robot_among_people_is_like_peoples() -> None:
    seen = sum_of([findings(session(seed, people)) for seed, people in ((701, 3), (702, 3), (703, 4))])

    people_do(seen)
    assert seen.on_speaker >= 0.7
