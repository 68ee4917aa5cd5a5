"""Looks by pictures, through LiteRT and recognition, of one person of whom nothing was learned (`benchmarks/looks.py`
has five); and the judge of them, by heads that are known."""

import math
from itertools import pairwise

import pytest

from engage_hri.schemas.perception import HeadPose
from engage_hri.schemas.units import Stamp
from tests.perception.eyes.fetched import needs_eyes

needs_eyes()

from benchmarks.looks import measured  # noqa: E402
from engage_hri.services.perception.eyes.camera import StatedCamera  # noqa: E402
from tests.perception.eyes.film_of_looks import EYES, RATE, SURE, filmed, landmarks  # noqa: E402
from tests.perception.eyes.judged_looks import WHO, judged, told_looks  # noqa: E402


def exact(number: int, looks: int) -> list[HeadPose]:
    """Heads of a film as they are, and as sure."""
    person, camera, told = filmed(number, looks), StatedCamera(EYES.field_of_view, EYES.place, 0, 0), []
    for look in person.looks:
        for k in range(math.ceil(look.since * RATE), math.ceil(look.until * RATE)):
            direction = camera.direction(look.pose.ahead)
            told.append(
                HeadPose(
                    actor=WHO, position=person.eyes, direction=direction, at=Stamp("loop", k / RATE),
                    yaw_spread=0.02, pitch_spread=0.02,
                )
            )  # fmt: skip
    return told


def test_a_film_has_looks_at_all_kinds_that_follow_one_another() -> None:
    looks = filmed(0, 60).looks

    assert len(looks) == 60 + SURE
    assert {each.target for each in looks} > {"robot", "table", "neighbor", "", "rectangle"}
    assert all(0.2 < after.since - before.until < 0.3 for before, after in pairwise(looks))


def test_of_heads_that_are_known_looks_are_told_right_once_six_were_sure() -> None:
    person = filmed(1, 40)
    known = judged(told_looks(exact(1, 40), person.looks, learns=True), person.looks)
    plain = judged(told_looks(exact(1, 40), person.looks, learns=False), person.looks)

    assert known.kinds > 0.95 * known.times
    assert known.kinds > plain.kinds
    assert known.among > 0.9 * known.pieces
    assert known.sure_right > 0.9 * known.sure > 0


@pytest.mark.real_time
def test_looks_of_somebody_in_a_film_are_told_right() -> None:
    person = filmed(1, 12)
    _, known = measured(person, [*landmarks(person)])

    assert known.kinds > 0.85 * known.times
    assert known.onsets >= known.all_looks - 2
    assert known.among >= known.pieces - 1
