"""The annotator of heads (`robot_head.py`) on what is known by hand."""

import pytest

from engage_hri.schemas.behaviors import Speech
from engage_hri.schemas.fragments import FragmentOutcome, PerformFragment, TurnFragment
from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import ActionBegan, ActionEnded
from engage_hri.schemas.units import Stamp
from engage_hri.schemas.world import Entity, World
from tests.study.robot_head import HeadFindings, findings

ANN, BEN = (Entity(id=id, kind="person", position=(1.2, y, 1.2)) for id, y in (("ann", 0.0), ("ben", 0.6)))
HAND = Entity(id="ann-hand", kind="hand", owner="ann", position=(0.8, 0.0, 0.7))


def told(actor: str, action: str, target: str, *changes: float, behavior: str = "") -> list[tuple[float, Message]]:
    """The beginning and the end of one action after the other, at these times."""
    targets = (target,) if target else ()
    return [
        (at, (ActionEnded if number % 2 else ActionBegan)(
            actor=actor, action=action, targets=targets, at=Stamp("c", at), behavior=behavior,  # type: ignore[arg-type]
        ))
        for number, at in enumerate(changes)
    ]  # fmt: skip


def found(*actions: list[tuple[float, Message]], people: tuple[Entity, ...] = (ANN,)) -> HeadFindings:
    timed = sorted((each for action in actions for each in action), key=lambda each: each[0])
    fragment = TurnFragment(id="f", behaviors=(Speech(id="s", text="so"),), addressee="ann")
    done = FragmentOutcome(id="r", requester="m", fragment="f", status="done")
    first = (World(entities=(*people, HAND)), PerformFragment(id="r", fragment=fragment))
    return findings([*first, *(message for _, message in timed), done])


def test_brief_looks_are_counted_by_what_they_were_at() -> None:
    seen = found(told("robot", "look", "ann", 0, 5, 6, 6.2), told("robot", "look", "ann-hand", 5.5, 5.5, 7, 7.3))

    assert (seen.looks, dict(seen.brief), seen.at_once) == (4, {"person": 1, "hand": 1}, 1)


@pytest.mark.parametrize(("arrives", "on", "soon"), [(4.5, 1, 1), (5.0, 1, 1), (5.4, 0, 1), (5.6, 0, 0)])
def test_the_eyes_are_on_the_face_when_the_last_word_ends_or_they_come_later(
    arrives: float, on: int, soon: int
) -> None:
    said = told("robot", "speak", "", 1, 2, 3, 5, behavior="f:s")
    seen = found(said, told("robot", "look", "ann", 0, 2, arrives, 9))

    assert (seen.turns, seen.turns_on_face, seen.turns_soon) == (1, on, soon)


def test_the_time_on_who_speaks_is_that_within_the_speech() -> None:
    seen = found(told("ann", "speak", "", 2, 6), told("robot", "look", "ann", 0, 3, 5, 9))

    assert (seen.heard, seen.heard_on_face) == (4.0, 2.0)


def test_looks_away_are_from_a_face_until_a_face_and_not_the_way_to_another_one() -> None:
    seen = found(
        told("robot", "look", "ann", 0, 10, 10.8, 20, 40, 45),
        told("robot", "look", "ben", 20.6, 30, 34, 38, 48, 60),
        told("robot", "look", "table", 38.5, 39.5),
        people=(ANN, BEN),
    )

    assert [round(each, 3) for each in seen.aways] == [0.8, 4.0, 2.0]
    assert seen.aways_a_minute == 2.0


@pytest.mark.parametrize(("hers", "then", "broken"), [(1.5, "ann-hand", 1), (1.5, "table", 0), (1.0, "ann-hand", 0)])
def test_eyes_that_met_are_left_for_a_hand_too_soon(hers: float, then: str, broken: int) -> None:
    seen = found(
        told("ann", "look", "robot", hers, 9), told("robot", "look", "ann", 0, 2), told("robot", "look", then, 2.3, 9)
    )

    assert (seen.mutual, seen.broken_by_hands) == (1, broken)
