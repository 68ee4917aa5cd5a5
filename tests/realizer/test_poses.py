"""Questions to the body about a plan: from where each behavior starts, and when it begins, waits and hurries."""

from itertools import pairwise
from math import inf

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from engage_hri.schemas.behaviors import BlockBehavior, Gaze, GazeShift, Pointing, Posture, Speech, Wait
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.body import BodyPose, Estimate, JointAngle, Phase
from engage_hri.services.realizer.plan.agreement import between, difference
from engage_hri.services.realizer.plan.known import Holder, Known, qualified
from engage_hri.services.realizer.plan.phases import chain
from engage_hri.services.realizer.plan.planner import Plan, plan_block
from engage_hri.services.realizer.plan.poses import planned_times, poses_before
from engage_hri.services.realizer.points import Point
from tests.random_cases import share_of
from tests.realizer.fake_body import FakeBody
from tests.realizer.planning import timed
from tests.realizer.stage import after, block, together

BODY = FakeBody()


def pose(angle: float) -> BodyPose:
    return BodyPose(joints=(JointAngle("pan", angle),))


def estimated(behavior: BlockBehavior, angle: float | None = None) -> Estimate:
    return replace(BODY.estimate(behavior), pose_after=None if angle is None else pose(angle))


def planned(example: Block, known: Known | None = None) -> Plan:
    """Each behavior ends in a pose of its own: the first in pose 1."""
    found = [
        estimated(each, number) for number, each in enumerate(example.behaviors, 1) if not isinstance(each, Wait)
    ]
    return plan_block(example, found, known=known or Known())


def told(plan: Plan) -> dict[str, dict[str, float]]:
    return {id: {each.sync: round(each.at, 4) for each in times} for id, times in planned_times(plan).items()}


def angles(plan: Plan, known: Known | None = None) -> dict[str, float]:
    return {id: each.joints[0].angle for id, each in poses_before(plan, known or Known()).items()}


# -- estimates that differ ---------------------------------------------------------------------------------------

NATURAL = st.sampled_from((0.0, 0.5, 0.75, 1.0))


@st.composite
def estimates(draw: st.DrawFn) -> list[Estimate]:
    """Of some of three behaviors: mostly alike, with phases that may be hurried, held, and slower."""
    found = []
    for id in sorted(draw(st.sets(st.sampled_from("xyz")))):
        names = ["start", "a", draw(st.sampled_from(("b", "b", "c"))), "end"][: draw(st.sampled_from((2, 3, 4, 4)))]
        phases = []
        for since, to in pairwise(names):
            natural, longest = draw(NATURAL), draw(st.sampled_from((None, 1.25, 2.0)))
            shortest = natural * draw(st.sampled_from((0.5, 0.75, 1.0)))
            phases.append(
                Phase(
                    since=since, to=to, shortest=shortest, natural=natural, longest=longest, hold=draw(st.booleans())
                )
            )
        part = draw(st.sampled_from(("arm", "arm", "arm", "head")))
        is_feasible = draw(st.sampled_from((True, True, True, False)))
        found.append(Estimate(behavior=id, feasible=is_feasible, parts=(part,), phases=tuple(phases)))
    return found


def shape(one: Estimate) -> list[str]:
    return [each.to for each in one.phases]


@settings(max_examples=share_of(150), deadline=None)
@given(estimates(), estimates())
def test_estimates_differ_by_their_most_different_phase_or_in_kind(
    before: list[Estimate], later: list[Estimate]
) -> None:
    natural, short = [], []
    for one in before:
        for other in later:
            if one.behavior == other.behavior and one.feasible:
                is_alike = (one.feasible, one.parts, shape(one)) == (other.feasible, other.parts, shape(other))
                pairs = list(zip(one.phases, other.phases, strict=False)) if is_alike else []
                natural.append(max(abs(a.natural - b.natural) for a, b in pairs) if is_alike else inf)
                short.append(max(b.shortest - a.shortest for a, b in pairs) if is_alike else 0.0)
    assert difference(before, later) == (max(natural, default=0.0), max(short, default=0.0))


@settings(max_examples=share_of(150), deadline=None)
@given(estimates(), estimates(), st.sampled_from((0.0, 0.5, 1.0)))
def test_between_two_answers_phases_are_means_with_the_limits_of_who_can_hurry_or_dawdle_less(
    before: list[Estimate], later: list[Estimate], weight: float
) -> None:
    found = between(before, later, weight)
    assert [each.behavior for each in found] == [each.behavior for each in later]
    assert between(before, later) == between(before, later, 0.5)
    for mean, other in zip(found, later, strict=True):
        one = next((each for each in before if each.behavior == mean.behavior), other)
        if not one.feasible or shape(one) != shape(other):
            assert mean == (other if one.feasible else one)
            continue
        assert replace(mean, phases=other.phases) == other
        for a, b, it in zip(one.phases, other.phases, mean.phases, strict=True):
            assert (it.since, it.to, it.hold) == (b.since, b.to, b.hold)
            assert it.natural == pytest.approx(a.natural + weight * (b.natural - a.natural))
            shares = [each.shortest / each.natural for each in (a, b) if each.natural]
            assert it.shortest == pytest.approx(max(shares, default=0.0) * it.natural)
            limit = a.longest if b.longest is None else b.longest
            assert it.longest == (None if limit is None else max(limit, it.natural))


# -- from where --------------------------------------------------------------------------------------------------


def test_who_comes_after_a_look_that_went_home_starts_from_home_as_the_last_shift_left_it() -> None:
    """The first look is over at 3.5 s; who comes before that starts on its target."""
    first = timed(Gaze(id="first", target="a"), start="0", relax="3")
    shift = timed(GazeShift(id="shift", target="c"), start="0.5", end="1.5")
    for start, expected in (("3", 1.0), ("3.5", None), ("9", None)):
        later = timed(Gaze(id="later", target="b"), start=start)
        assert angles(planned(block((first, later)))).get("later") == expected
    moved = block((timed(GazeShift(id="shift", target="c"), start="0", end="1"),
                   timed(Gaze(id="look", target="a"), start="2", relax="4"),
                   timed(Gaze(id="later", target="b"), start="9")))  # fmt: skip
    assert angles(planned(moved)) == {"look": 1.0, "later": 1.0}
    assert angles(planned(block((first, shift)))) == {"shift": 1.0}
    for start, expected in (
        ("3", 1.0),
        ("9", 2.0),
    ):  # beneath a look a shift moves nothing, but the look goes home there
        later = timed(Gaze(id="later", target="b"), start=start)
        made = planned(block((first, replace(shift, timing=shift.timing[:1]), later)))
        assert angles(made) == {"shift": 1.0, "later": expected}


def test_who_comes_after_a_posture_that_went_home_starts_from_where_the_body_is() -> None:
    """Only looks go home to what a shift has turned to."""
    shift = timed(GazeShift(id="shift", target="c"), start="0", end="1")
    postures = [timed(Posture(id=f"p{n}", lexeme="LEAN"), start=f"{5 * n}", end=f"{5 * n + 3}") for n in (0, 1)]

    assert "p1" not in angles(planned(block((shift, *postures))))


def test_who_follows_a_behavior_of_another_block_starts_from_its_pose() -> None:
    theirs = Gaze(id="x", target="a")
    parts = chain(theirs, estimated(theirs))
    renamed = replace(parts, points=tuple(qualified("other", point) for point in parts.points))
    times = {qualified("other", point): at for point, at in zip(parts.points, (-2.0,) * 5 + (9.0, 9.5), strict=True)}
    holder = Holder(renamed, is_natural=True, kept=frozenset(), estimate=estimated(theirs, 7.0), reached=5)
    known = Known(blocks={"other": None}, points=times, holders={"other:x": holder})

    assert angles(planned(block((Gaze(id="g", target="b"),)), known), known) == {"g": 7.0}
    blind = replace(known, holders={"other:x": replace(holder, estimate=None)})
    assert angles(planned(block((Gaze(id="g", target="b"),)), blind), blind) == {}


def test_who_comes_after_a_behavior_of_another_block_that_went_home_starts_from_there() -> None:
    """Now that one may still be elsewhere, and the body does not know that it goes home by then."""
    theirs = Gaze(id="g", target="a")  # ids count in one block only
    parts = chain(theirs, estimated(theirs))
    renamed = replace(parts, points=tuple(qualified("other", point) for point in parts.points))
    times = {qualified("other", point): at for point, at in zip(parts.points, (-2.0,) * 5 + (0.5, 1.0), strict=True)}
    home = replace(estimated(theirs, 7.0), pose_end=pose(5.0))
    holder = Holder(renamed, is_natural=False, kept=frozenset(), estimate=home, reached=5)
    known = Known(blocks={"other": None}, points=times, holders={"other:g": holder})

    for start, begins in (("2", 5.0), ("0.75", 7.0)):
        assert angles(planned(block((timed(Gaze(id="g", target="b"), start=start),)), known), known) == {"g": begins}


def test_only_who_shares_a_part_with_the_one_before_starts_from_there() -> None:
    left = timed(Pointing(id="left", target="a", mode="LEFT_HAND"), start="0")
    right = timed(Pointing(id="right", target="a", mode="RIGHT_HAND"), start="1")
    again = timed(Pointing(id="again", target="b", mode="LEFT_HAND"), start="1.75")

    assert angles(planned(block((left, right, again)))) == {"again": 1.0}


# -- when --------------------------------------------------------------------------------------------------------

GAZE = Gaze(id="g", target="a")
LEFT = Pointing(id="p", target="a", mode="LEFT_HAND")


def test_what_makes_no_difference_to_anything_is_not_asked_about() -> None:
    assert planned_times(planned(block((LEFT, Speech(id="s", text="so"))))) == {}
    assert planned_times(planned(block((Wait(id="w", duration=1.0), LEFT)))) == {}


def test_who_waits_is_told_where_and_how_long() -> None:
    made = planned(block((timed(LEFT, start="1", stroke="5"),)))
    assert told(made) == {"p": {"start": 1.0, "stroke_start": 4.5}}
    held = planned(block((timed(LEFT, start="1", end="10"),)))
    assert told(held) == {"p": {"start": 1.0, "stroke_end": 9.25}}


def test_two_on_one_arm_are_told_in_the_order_in_which_they_begin() -> None:
    """The later takes the arm at 2 s: by then the earlier has passed its stroke end, and goes home from there."""
    second = replace(LEFT, id="q")
    made = planned(block((timed(second, start="2"), timed(LEFT, start="0"))))

    assert list(planned_times(made)) == ["p", "q"]
    assert told(made)["q"] == {"start": 2.0}
    assert told(made)["p"]["start"] == 0.0


def test_if_one_waits_all_are_told_that_move_and_speak_with_more_than_the_voice() -> None:
    right = timed(Pointing(id="r", target="a", mode="RIGHT_HAND"), start="0")
    made = planned(block((timed(LEFT, start="1", stroke="5"), right, Speech(id="s", text="so"))))

    assert told(made) == {"r": {"start": 0.0}, "p": {"start": 1.0, "stroke_start": 4.5}}


def test_a_torso_is_always_told_and_first_of_those_that_begin_with_it() -> None:
    for start, order in (("0", ["d", "p"]), ("2", ["p", "d"])):
        made = planned(block((timed(LEFT, start="0"), timed(Posture(id="d", lexeme="LEAN"), start=start))))
        assert list(planned_times(made)) == order


def test_two_who_can_both_wait_for_each_other_are_told_no_time() -> None:
    right = timed(Pointing(id="r", target="a", mode="RIGHT_HAND"), start="0")
    made = planned(block((LEFT, right, replace(LEFT, id="q")), together("p:stroke_start", "r:stroke_start")))

    assert told(made)["p"] == {"start": 0.0}


def test_a_shift_is_told_its_end_only_if_a_look_begins_then() -> None:
    shift = timed(GazeShift(id="shift", target="c"), start="0")
    for start, syncs in (("5", {"start"}), ("shift:end", {"start", "end"})):
        made = planned(block((shift, timed(GAZE, start=start))))
        assert set(told(made)["shift"]) == syncs


def test_who_is_cut_at_a_hold_point_is_never_let_go_there() -> None:
    """A look that lasts until the next comes holds until then, and a second more."""
    others = [timed(Gaze(id=id, target="b"), start=start) for id, start in (("h", "4"), ("k", "8"))]
    made = planned(block((timed(GAZE, start="0"), *others)))

    assert told(made)["g"] == {"start": 0.0, "stroke_end": 4.0, "relax": 5.0}
    assert told(made)["h"] == {"start": 4.0, "stroke_end": 8.0, "relax": 9.0}


def test_who_is_cut_at_a_hold_point_by_another_block_is_not_let_go_there_either() -> None:
    """Another look is on the head from 4 s on."""
    start = Point("other:x", "start")
    content = {"other": Block(id="other", behaviors=(Gaze(id="x", target="b"),))}
    known = Known(blocks=content, points={start: 4.0}, given={"g": start})
    made = planned(block((timed(GAZE, start="0"), timed(LEFT, start="0", end="6"))), known)

    assert told(made)["g"] == {"start": 0.0, "stroke_end": 4.0, "relax": 5.0}


def test_a_look_that_lasts_leaves_a_moment_after_all_else_has_ended() -> None:
    made = planned(block((GAZE, LEFT, replace(LEFT, id="q"))))
    ends = made.predicted(made.chains["q"].points[-1])

    start, leaves = planned_times(made)["g"]
    assert (start.sync, start.at, leaves.sync) == ("start", 0.0, "stroke_end")
    assert leaves.at == pytest.approx(ends + 2e-6, abs=1e-9)


def test_who_holds_until_one_comes_who_cannot_wait_is_told_when_that_is() -> None:
    """The arm is at its stroke start when the words begin, by chance at once: it waits until that is measured."""
    words = Speech(id="s", text="one")
    alone = planned(block((timed(LEFT, start="0"), replace(LEFT, id="q"))))
    met = planned(block((timed(LEFT, start="0"), replace(LEFT, id="q"), words), together("p:stroke_start", "s:end")))

    assert "stroke_start" not in told(alone)["p"]
    assert told(met)["p"]["stroke_start"] == met.predicted(Point("s", "end"))


@pytest.mark.parametrize(
    ("stroke", "syncs"),
    [("1.25", ()), ("1.2503", ()), ("1.251", ("stroke_start",)), ("1.249", ()), ("1.248", ("ready", "stroke"))],
)
def test_who_is_hurried_or_waits_by_more_than_half_a_millisecond_is_told(stroke: str, syncs: tuple[str, ...]) -> None:
    """Three phases to the stroke give way by shares of 2 : 1 : 2; who is to be later waits at the stroke start."""
    body, other = FakeBody(elastic=(0.5, 3.0)), replace(LEFT, id="q")
    behavior = timed(LEFT, start="0", stroke=stroke)
    estimates = [body.estimate(behavior), body.estimate(other)]
    made = plan_block(block((behavior, other), after("p:end", "q:start")), estimates)

    assert tuple(each.sync for each in planned_times(made)["p"]) == ("start", *syncs)
