"""A few faults at random in a robot that plays over three machines, and the judge of such runs."""

from pathlib import Path
from typing import Any

import pytest

from tests.lab import verdict
from tests.lab.faults import play
from tests.lab.lab import missing
from tests.lab.verdict import Injury, Span

BODY = "body"


def event(t: float, what: str, process: str = BODY, **fields: Any) -> dict[str, Any]:
    return {"t": t, "process": process, "what": what, **fields}


def word(t: float, position: int) -> dict[str, Any]:
    return event(t, "word", block="b", behavior="s", position=position, word="word", at=t)


def answer(t: float, behavior: str, status: str) -> dict[str, Any]:
    return event(t, "answer", whose=f"realizer|1|perform_behavior|b/{behavior}", status=status)


@pytest.mark.real_time
@pytest.mark.skipif(bool(missing()), reason=missing())
async def test_what_breaks_at_random_heals_and_nothing_is_hung_lost_or_said_twice(tmp_path: Path) -> None:
    assert await play(tmp_path, runs=3, seed=5, machines=3, kinds=("kill", "freeze", "router"), settle=3.0) == []


def test_a_word_that_is_said_again_is_found() -> None:
    said = [word(1.0, 4), word(2.0, 9)]

    assert verdict.spoken_twice(said, "manager") == []
    assert verdict.spoken_twice([*said, word(3.0, 4)], "manager") == ["b:s at 4"]
    assert (
        verdict.spoken_twice([*said, event(2.5, "asked", "m", service="manager", whose="x"), word(3.0, 4)], "manager")
        == []
    )


def test_a_request_with_two_outcomes_is_found_and_one_that_was_refused_by_another_life_is_none() -> None:
    told = [answer(1.0, "s", "Accepted"), answer(2.0, "s", "done"), answer(3.0, "s", "Refused")]

    assert verdict.doubled([*told, answer(4.0, "s", "done")]) == []
    assert verdict.doubled([*told, answer(4.0, "s", "failed")]) == ["realizer|1|perform_behavior|b/s: done, failed"]


def test_a_request_of_a_living_process_without_an_end_is_found() -> None:
    asked = [
        event(1.0, "asked", "a", whose="x"),
        event(1.0, "asked", "b", whose="y"),
        event(9.0, "asked", "a", whose="z"),
    ]

    assert verdict.unanswered(asked, {"a"}, 5.0) == ["x"]
    assert verdict.unanswered([*asked, event(10.0, "told", "a", whose="x")], {"a"}, 5.0) == []


def test_the_time_for_which_something_is_broken_does_not_count_as_waiting() -> None:
    assert verdict.calm_ago(100.0, [], 40.0) == 60.0
    assert verdict.calm_ago(100.0, [Span(20.0, 80.0)], 40.0) == 0.0
    assert verdict.calm_ago(100.0, [Span(5.0, 10.0), Span(20.0, 80.0)], 15.0) == 85.0
    assert verdict.calm_ago(100.0, [Span(5.0, 10.0), Span(20.0, 80.0)], 40.0) == -5.0


def test_a_behavior_that_goes_on_without_being_held_is_found() -> None:
    span = Span(2.0, 9.0)
    goes_on = [answer(1.0, "s", "Accepted"), answer(1.5, "g", "Accepted"), answer(2.2, "g", "done")]
    held = event(2.4, "held", behaviors=["b:s"])

    assert verdict.unheld([*goes_on, held], BODY, span, 0.5) == []
    assert verdict.unheld(goes_on, BODY, span, 0.5) == ["realizer|1|perform_behavior|b/s"]
    assert verdict.unheld([*goes_on, {**held, "t": 2.6}], BODY, span, 0.5) == ["realizer|1|perform_behavior|b/s"]
    assert verdict.unheld(goes_on, BODY, Span(2.0, 2.3), 0.5) == []


def test_how_the_body_took_it_is_measured_until_it_goes_on() -> None:
    held = [event(2.4, "held", behaviors=["b:s"]), event(5.0, "held", behaviors=[])]
    moves = [event(3.0, "still", since=2.9), event(5.5, "moves", since=5.4), event(6.0, "still", since=5.9)]
    live = answer(1.0, "s", "Accepted")
    took = verdict.motion(
        [live, *held[:1], word(2.7, 4), *moves[:1], held[1], word(5.2, 9), *moves[1:]], BODY, Span(2.0, 4.9)
    )

    assert took == pytest.approx((0.4, 0.7, 0.9))


def test_a_hold_while_nothing_is_broken_is_found() -> None:
    held = [
        event(2.4, "held", behaviors=["b:s"]),
        event(5.0, "held", behaviors=[]),
        event(9.0, "held", behaviors=["c:g"]),
    ]

    assert verdict.groundless(held, [(2.0, 3.0)]) == ["c:g at 9.0"]
    assert verdict.groundless(held, [(2.0, 3.0), (8.0, 9.5)]) == []


def test_who_sees_whom_and_since_when() -> None:
    seen = [event(1.0, "sees", "a", name="x"), event(2.0, "misses", "a", name="x"), event(3.0, "sees", "a", name="y")]

    assert verdict.sees(seen, "a") == {"y": 3.0}
    assert verdict.sees([*seen, event(4.0, "sees", "a", name="x")], "a") == {"y": 3.0, "x": 4.0}


def end(t: float, cause: str, blamed: str, reason: str = "it ended", status: str = "interrupted") -> dict[str, Any]:
    why = {"reason": reason, "cause": cause, "blamed": blamed, "speaker": "generation" if reason else ""}
    return event(t, "answer", service="generation", whose="x", status=status, **why)


def lost(since: float, to: float, service: str = "generation") -> list[dict[str, Any]]:
    """Reports of a service's link to the router."""
    return [event(since, "unlinked", service=service), event(to, "linked", service=service)]


@pytest.mark.parametrize(
    ("injury", "true", "untrue"),
    [
        (
            ("router", "router"),
            [("unlinked", "router"), ("gone", "human")],
            [("gone", "manager"), ("silent", "router")],
        ),
        (("kill", "control"), [("restarted", "control"), ("gone", "control")], [("gone", "realizer"), ("", "")]),
        (("freeze", "realizer"), [("frozen", "realizer"), ("unrenewed", "realizer")], [("restarted", "realizer")]),
        (("cut", "realizer"), [("gone", "realizer"), ("unlinked", "router")], [("gone", "control")]),
    ],
)
def test_a_cause_that_was_not_in_force_or_not_theirs_is_found(
    injury: tuple[str, str], true: list[tuple[str, str]], untrue: list[tuple[str, str]]
) -> None:
    kind, who = injury
    hit = frozenset((who, "human")) if kind == "router" else frozenset((who, "router") if kind == "cut" else (who,))
    injuries = [Injury(kind, hit, 10.0, 12.0)]

    for cause, blamed in true:
        assert verdict.untrue([*lost(10.5, 12.0), end(13.0, cause, blamed)], injuries, 8.0) == []
        assert len(verdict.untrue([*lost(10.5, 12.0), end(9.0, cause, blamed)], injuries, 8.0)) == 1
        assert len(verdict.untrue([*lost(10.5, 12.0), end(21.0, cause, blamed)], injuries, 8.0)) == 1
    for cause, blamed in untrue:
        assert len(verdict.untrue([*lost(10.5, 12.0), end(13.0, cause, blamed)], injuries, 8.0)) == 1


def test_a_lost_router_is_a_cause_for_whoever_had_lost_its_link_as_long_as_it_was_waited_for() -> None:
    injuries = [Injury("router", frozenset(("router",)), 10.0, 12.0)]
    asked = event(9.0, "asked", service="collaboration", whose="x")
    late, refused = end(27.0, "unlinked", "router"), end(27.0, "unlinked", "router", status="Refused")

    def flaws(*events: dict[str, Any], injuries: list[Injury] = injuries) -> int:
        return len(verdict.untrue(events, injuries, 8.0))

    assert flaws(asked, *lost(10.5, 12.0), late) == 0
    assert flaws(event(13.0, "asked", whose="x"), *lost(10.5, 12.0), late) == 1  # it waited for nothing then
    assert flaws(*lost(10.5, 12.0), refused) == 0  # for what was before, as an open turn is
    assert flaws(*lost(10.5, 12.0), {**refused, "t": 33.0}) == 1
    assert flaws(asked, late) == 1  # its link was whole
    assert flaws(asked, *lost(10.5, 12.0, "realizer"), late) == 1  # another's was not
    assert flaws(asked, *lost(15.0, 16.0), late) == 1  # nobody had taken the router away
    assert flaws(asked, *lost(10.5, 12.0), late, injuries=[]) == 1
    assert flaws(event(10.5, "unlinked", service="generation"), {**late, "t": 13.0}) == 0  # it is still away


def test_an_end_without_a_reason_is_found_and_one_that_somebody_asked_for_must_say_who() -> None:
    assert len(verdict.untrue([end(1.0, "", "", reason="")], [], 8.0)) == 1
    assert len(verdict.untrue([end(1.0, "cancelled", "")], [], 8.0)) == 1
    assert (
        verdict.untrue([end(1.0, "cancelled", "me"), end(1.0, "", ""), end(1.0, "", "", "", "done")], [], 8.0) == []
    )
