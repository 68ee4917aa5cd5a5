"""Motion in closed form: exact crossing times, and invariants under any authority."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engage_hri.services.control.figure import tracks
from engage_hri.services.control.motion.motion import Motion
from engage_hri.services.control.motion.path import JointMotion, Leg, Path, resting
from tests.random_cases import share_of

LIMITS = tracks.LIMITS["right_arm"]
HOME = tracks.HOME["right_arm"]
MARKS = ("ready", "stroke", "end")


def path(*goals: tuple[float, float, float], seconds: float = 0.6, moving: bool = True) -> Path:
    """From home through the goals and back; each goal is marked and passed in motion."""
    velocity = (0.0, 0.3, -0.2) if moving else ()
    legs = [
        Leg(goal=goal, velocity=velocity, seconds=seconds, marks=((name, 1.0),))
        for goal, name in zip(goals, MARKS, strict=False)
    ]
    return Path(resting(HOME), [*legs, Leg(goal=HOME, seconds=1.0, marks=(("end", 1.0),))], LIMITS)


TWO = path((0.2, 0.3, 1.2), (0.4, 0.5, 0.9))


def test_a_motion_that_nothing_stops_runs_at_its_natural_times():
    motion = Motion(TWO, 10.0)

    assert motion.crossing(TWO.marks["ready"]) == 10.0 + TWO.marks["ready"]
    assert motion.crossing(TWO.marks["stroke"]) == 10.0 + TWO.marks["stroke"]
    assert motion.end == pytest.approx(10.0 + TWO.length)


def test_it_brakes_to_a_stop_exactly_at_its_limit():
    limit = TWO.marks["stroke"]
    motion = Motion(TWO, 0.0, limit=limit)

    assert motion.s(motion.end) == limit
    assert motion.at(motion.end + 1.0).at_rest
    assert motion.crossing(limit) == motion.end
    assert motion.crossing(limit + 0.01) is None
    assert motion.end > limit  # braking takes time


def test_a_limit_moved_in_time_costs_nothing():
    motion = Motion(TWO, 0.0, limit=TWO.marks["stroke"])
    motion.extend(math.inf, 0.3)

    assert motion.end == pytest.approx(TWO.length)


def test_a_limit_moved_while_it_brakes_is_passed_without_a_stop():
    limit = TWO.marks["stroke"]
    motion = Motion(TWO, 0.0, limit=limit)
    late = motion.end - 0.01
    slow = motion.rate(late)
    motion.extend(math.inf, late)

    assert 0.0 < slow < 1.0
    assert all(motion.rate(late + step * 0.001) >= slow for step in range(100))
    crossing = motion.crossing(limit)
    assert crossing is not None
    assert motion.rate(crossing) > 0.0


def test_it_goes_on_from_a_standstill():
    motion = Motion(TWO, 0.0, limit=TWO.marks["ready"])
    motion.extend(math.inf, 5.0)

    assert motion.s(5.0) == TWO.marks["ready"]
    assert motion.end > 5.0 + TWO.length - TWO.marks["ready"]
    assert motion.at(motion.end).q == pytest.approx(HOME)


def test_it_can_stop_where_its_brakes_bring_it_to_rest_and_nowhere_before():
    motion, now = Motion(TWO, 0.0), 0.3
    here = motion.s(now)
    nearest = here + motion.rate(now) ** 2 / (2 * TWO.steepest_brake(here, motion.rate(now)))

    assert here + 0.01 < nearest < TWO.length
    assert motion.can_stop_at(nearest + 0.01, now)
    assert not motion.can_stop_at(here + 0.1 * (nearest - here), now)
    assert not motion.can_stop_at(here - 0.01, now)


def test_a_slow_motion_takes_its_factor_longer():
    motion = Motion(TWO, 2.0, cruise=0.25)

    assert motion.crossing(TWO.marks["ready"]) == pytest.approx(2.0 + 4 * TWO.marks["ready"])


def test_nothing_moves_faster_than_its_path_permits():
    motion = Motion(TWO, 0.0, cruise=100.0)

    assert motion.cruise == TWO.fastest
    assert exceeds(motion, 0.0) == []


def test_what_is_left_of_a_path_keeps_its_sync_points_and_its_time():
    s = TWO.marks["ready"] + 0.1
    left = TWO.after(s)

    assert [sync for leg in left for sync, _ in leg.marks] == ["stroke", "end"]
    assert sum(leg.seconds for leg in left) == pytest.approx(TWO.length - s)


def exceeds(motion: Motion, since: float) -> list[str]:
    """Limits that the closed form breaks, finely sampled."""
    found = []
    speed = np.array([limit.speed for limit in LIMITS])
    acceleration = np.array([limit.acceleration for limit in LIMITS])
    for t in np.linspace(since, motion.end + 0.01, 400):
        state = motion.at(float(t))
        if np.any(np.abs(state.v) > speed * 1.001):
            found.append(f"speed at {t:.3f}")
        if np.any(np.abs(state.a) > acceleration * 1.001):
            found.append(f"acceleration at {t:.3f}")
    return found


@st.composite
def poses(draw: st.DrawFn) -> tuple[float, float, float]:
    limits = [(limit.low + 0.15, limit.high - 0.15) for limit in LIMITS]
    return tuple(draw(st.floats(low, high)) for low, high in limits)  # type: ignore[return-value]


EXTENSIONS = st.lists(st.tuples(st.floats(0.0, 0.7), st.floats(0.0, 1.3)), max_size=4)


@settings(max_examples=share_of(60), deadline=None)
@given(one=poses(), other=poses(), first=st.floats(0.01, 1.0), extensions=EXTENSIONS, cruise=st.floats(0.2, 1.0))
def test_no_authority_makes_it_pass_its_limit_turn_back_or_break_a_joints_limits(
    one: tuple[float, float, float],
    other: tuple[float, float, float],
    first: float,
    extensions: list[tuple[float, float]],
    cruise: float,
):
    way = path(one, other)
    motion = Motion(way, 0.0, cruise=cruise, limit=first * way.length)
    now, passed = 0.0, 0.0
    for wait, share in [*extensions, (0.3, 2.0)]:
        for _ in range(40):
            now += wait / 40
            s = motion.s(now)
            assert passed - 1e-12 <= s <= motion.limit + 1e-12
            passed = s
        before = motion.at(now)
        motion.extend(share * way.length, now)
        after = motion.at(now)
        assert after.q == pytest.approx(before.q, abs=1e-9)
        # From a rest that the path itself has, it may set off at once.
        assert after.v == pytest.approx(before.v, abs=1e-6)
        assert exceeds(motion, now) == []

    assert motion.s(motion.end) == way.length


@settings(max_examples=60, deadline=None)
@given(one=poses(), other=poses(), at=st.floats(0.0, 1.0))
def test_a_crossing_is_where_the_motion_is_at_that_time(
    one: tuple[float, float, float], other: tuple[float, float, float], at: float
):
    way = path(one, other)
    motion = Motion(way, 0.0, limit=0.8 * way.length)
    s = at * 0.8 * way.length
    crossing = motion.crossing(s)

    assert crossing is not None
    assert motion.s(crossing) == pytest.approx(s, abs=1e-9)


@settings(max_examples=share_of(60), deadline=None)
@given(one=poses(), other=poses(), at=st.floats(0.0, 1.0))
def test_a_new_path_takes_over_without_a_jump(
    one: tuple[float, float, float], other: tuple[float, float, float], at: float
):
    old = Motion(path(one), 0.0)
    now = at * old.end
    here = old.at(now)
    new = Motion(Path(here, [Leg(goal=other, seconds=0.7)], LIMITS), now)
    there = new.at(now)

    assert there.q == pytest.approx(here.q, abs=1e-9)
    assert there.v == pytest.approx(here.v, abs=1e-9)
    assert exceeds(new, now) == []


def test_a_state_knows_whether_it_rests():
    assert resting(HOME).at_rest
    assert not JointMotion(np.zeros(3), np.array([0.0, 0.1, 0.0]), np.zeros(3)).at_rest


@pytest.mark.parametrize("at", [0.0, 0.4, 1.0])
def test_what_is_left_has_every_sync_point_that_was_not_told_yet(at: float):
    """Also one at the very place where it stands, as the end of a way home that is no way at all."""
    here = path((0.2, 0.3, 1.2))
    still = Path(here.at(here.length), [Leg(goal=HOME, seconds=0.0, marks=(("relax", 1.0), ("end", 1.0)))], LIMITS)

    for whole, untold in ((here, ("ready", "end")), (still, ("end",))):
        left = Path(whole.at(at * whole.length), whole.after(at * whole.length, untold), LIMITS)
        assert set(untold) <= left.marks.keys()
        assert all(0.0 <= left.marks[sync] <= left.length for sync in untold)
