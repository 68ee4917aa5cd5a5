"""Whose face is whose: gaps, crossings, stalls."""

from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np

from engage_hri.services.perception.eyes.head_pose import AHEAD, MeasuredHead
from engage_hri.services.perception.eyes.tracking import FaceTracker
from engage_hri.services.reports.action_reports import FACE_GRACE

Places = Callable[[float], Iterable[tuple[float, float, float]]]
RATE = 15


class Followed(NamedTuple):
    """Who was seen where, by time, and who has gone when."""

    here: dict[float, dict[str, float]]
    gone: list[tuple[str, float]]


def followed(places: Places, times: Iterable[float]) -> Followed:
    tracker, here, gone = FaceTracker(), {}, []
    for at in times:
        heads = [MeasuredHead(np.array(place), AHEAD, 0.0, 0.1, 0.1) for place in places(at)]
        seen, lost = tracker.feed(heads, at)
        here[at] = {face.id: float(face.head.place[0]) for face in seen}
        gone += [(face.id, at) for face in lost]
    return Followed(here, gone)


def times(until: float, since: float = 0.0) -> list[float]:
    return [since + k / RATE for k in range(round((until - since) * RATE))]


def test_somebody_is_told_after_a_quarter_of_a_second_and_what_was_there_for_a_moment_never():
    both = followed(lambda at: [(0, 0, 1)] + [(0.8, 0, 1)] * (1 < at < 1.1), times(3))

    assert min(at for at, seen in both.here.items() if seen) == 4 / RATE
    assert {name for seen in both.here.values() for name in seen} == {"face_1"}


def test_who_is_hidden_for_less_than_two_seconds_is_the_same_and_nobody_has_gone():
    seen = followed(lambda at: [] if 1 < at < 2.9 else [(0.1 * at, 0, 1)], times(4))

    assert seen.gone == []
    assert {*seen.here[times(4)[-1]]} == {"face_1"}


def test_who_is_not_seen_for_two_seconds_has_gone_and_comes_as_another():
    seen = followed(lambda at: [] if 1 < at < 3.5 else [(0, 0, 1)], times(5))

    [(name, at)] = seen.gone
    assert name == "face_1"
    assert 1 + FACE_GRACE < at < 1 + FACE_GRACE + 0.2
    assert {*seen.here[times(5)[-1]]} == {"face_2"}


def test_a_camera_that_stalls_takes_nobody_away():
    seen = followed(lambda at: [(0, 0, 1)] if at < 1 or at > 9 else [], [*times(1), 4.0, 7.0, *times(10, since=9.1)])

    assert seen.gone == []
    assert {*seen.here[times(10, since=9.1)[-1]]} == {"face_1"}


def test_two_who_cross_stay_who_they_are():
    def crossing(at: float) -> list[tuple[float, float, float]]:
        places = [(-0.6 + 0.5 * at, 0, 0.9), (0.6 - 0.5 * at, 0, 1.3)]
        return places[:1] if 1.1 < at < 1.3 else places[::-1] if round(at * RATE) % 2 else places

    seen = followed(crossing, times(2.4))

    first = {at: names["face_1"] for at, names in seen.here.items() if "face_1" in names}
    second = {at: names["face_2"] for at, names in seen.here.items() if "face_2" in names}
    assert {name for names in seen.here.values() for name in names} == {"face_1", "face_2"}
    ways = (np.sign(first[2.0] - first[1 / 3]), np.sign(second[2.0] - second[1 / 3]))
    assert sorted(ways) == [-1, 1]
    assert all(abs(abs(first[at]) - abs(-0.6 + 0.5 * at)) < 1e-9 for at in first)


def test_two_beside_one_another_are_never_mixed_up():
    chance = np.random.default_rng(2)

    def sitting(_: float) -> list[tuple[float, float, float]]:
        places = [(side + chance.normal(0, 0.01), 0, 1 + chance.normal(0, 0.03)) for side in (-0.25, 0.25)]
        return places if chance.uniform() < 0.5 else places[::-1]

    seen = followed(sitting, times(20))

    sides = {
        name: {np.sign(names[name]) for names in seen.here.values() if name in names} for name in ("face_1", "face_2")
    }
    assert sorted(map(sorted, sides.values())) == [[-1], [1]]
