"""Gaze, face and posture wait on target: they come just in time, and if that was too early they stand there."""

import pytest

from engage_hri.schemas.behaviors import BlockBehavior, FaceLexeme, Gaze, Mark, Pointing, Posture, Speech, Wait
from engage_hri.schemas.body import PerformBehavior
from engage_hri.services.control.config import Displaced, Slow, Stall, Variability
from tests.realizer.fake_body import FakeBody, Script
from tests.realizer.planning import at, plan, timed
from tests.realizer.puppet import BML_1_0, bml
from tests.realizer.stage import after, before, block, stage, together
from tests.realizer.test_simulated_body import Robot, robot

GAZE = Gaze(id="g", target="a")
ON_TARGET = (GAZE, FaceLexeme(id="f", lexeme="SMILE"), Posture(id="o", lexeme="LEAN_FORWARD"))
ALL_OF_THEM = tuple(f"{looks.id}:stroke" for looks in ON_TARGET)
ARM = Pointing(id="p", target="a", mode="RIGHT_HAND")
"""Its phases take 0.5, 0.25, 0.5, 0.25, 0.25, 0.5 s: the stroke is at 1.25 s."""
STORY = Speech(id="s", text="one two", marks=(Mark("m", 3),))
"""Its mark is a second after its start."""

each_of_them = pytest.mark.parametrize("looks", ON_TARGET, ids=lambda looks: looks.id)


@each_of_them
@pytest.mark.parametrize("slow", [1.0, 1.5, 2.0, 4.0])
async def test_who_is_on_target_waits_for_a_slow_arm(looks: BlockBehavior, slow: float) -> None:
    async with stage(FakeBody({"p": Script(slow=slow)})) as seen:
        await seen.perform(block((looks, ARM), together(f"{looks.id}:stroke", "p:stroke")))

    assert seen.times()[f"{looks.id}:stroke"] == seen.times()["p:stroke"]
    assert {each.kind for each in seen.warnings()} <= {"LATE"}
    assert all(each.skew == 0.0 for each in seen.progress())


@each_of_them
@pytest.mark.parametrize("point", ["p:stroke", "s:start", "s:m"])
async def test_who_comes_just_in_time_sets_out_no_earlier_than_that(looks: BlockBehavior, point: str) -> None:
    async with stage() as seen:
        others = (after("p:stroke", "s:start"),)
        await seen.perform(block((looks, ARM, STORY), *others, together(f"{looks.id}:stroke", point)))

    times = seen.times()
    turning = 0.25 if looks.id == "f" else 0.5
    assert times[f"{looks.id}:start"] == times[point] - turning
    assert times[f"{looks.id}:stroke"] == times[point]


@each_of_them
async def test_an_arm_that_stalls_in_its_stroke_is_waited_for_on_target(looks: BlockBehavior) -> None:
    stalled = FakeBody({"p": Script(durations=(0.5, 0.25, 2.5, 0.25, 0.25, 0.5))})
    async with stage(stalled) as seen:
        await seen.perform(block((looks, ARM), together(f"{looks.id}:stroke", "p:stroke")))

    stroke = next(each for each in seen.progress() if (each.behavior, each.sync) == (looks.id, "stroke"))
    assert (stroke.arrived, stroke.time) == (1.25, 3.25)
    assert seen.times()["p:stroke"] == 3.25


@each_of_them
async def test_who_is_quicker_than_expected_waits_on_target(looks: BlockBehavior) -> None:
    async with stage(FakeBody({looks.id: Script(slow=0.5)})) as seen:
        await seen.perform(block((looks, ARM), together(f"{looks.id}:stroke", "p:stroke")))

    assert seen.times()[f"{looks.id}:stroke"] == seen.times()["p:stroke"] == 1.25
    assert f"{looks.id}:stroke" in seen.body.stops


@each_of_them
async def test_with_a_fixed_start_it_waits_on_target_and_nobody_is_slower_for_it(looks: BlockBehavior) -> None:
    body = FakeBody(elastic=(0.5, 4.0))
    async with stage(body) as seen:
        asked: list[PerformBehavior] = []
        perform = body._perform
        body._perform = lambda request: (asked.append(request), perform(request))  # type: ignore[method-assign, assign, func-returns-value]
        await seen.perform(block((timed(looks, start="0"), ARM), together(f"{looks.id}:stroke", "p:stroke")))

    stroke = next(each for each in seen.progress() if (each.behavior, each.sync) == (looks.id, "stroke"))
    assert (stroke.arrived, stroke.time) == (0.25 if looks.id == "f" else 0.5, 1.25)
    assert seen.warnings() == []
    assert not any(request.pace for request in asked)


async def test_the_peak_of_a_face_is_when_it_is_on_target() -> None:
    """BML 1.0 names no stroke of a face."""
    tied = """<faceLexeme id="f" lexeme="SMILE" attackPeak="p:stroke"/>
              <pointing id="p" target="a" mode="RIGHT_HAND"/>"""
    async with stage(FakeBody({"p": Script(slow=2.0)})) as seen:
        await seen.perform(bml(tied, dialect=BML_1_0))

    assert seen.times()["f:attackPeak"] == seen.times()["p:stroke"] == 2.5
    assert "f:stroke" in seen.body.stops


def test_a_fixed_start_and_a_later_stroke_cost_nobody_his_place() -> None:
    """Even of a body that can be no slower."""
    made = plan(block((timed(GAZE, start="0", stroke="1.2", end="5"), STORY), together("s:start", "g:stroke")))

    assert made.problems == ()
    assert (at(made, "g:start"), at(made, "g:stroke"), at(made, "s:start")) == (0.0, 1.2, 1.2)


def test_a_stroke_that_must_not_be_before_a_word_needs_no_start_after_it() -> None:
    """It can wait on target; a point that cannot wait anywhere would have to be waited for at the start."""
    made = plan(block((GAZE, STORY), after("s:m", "g:stroke")))

    assert (at(made, "g:start"), at(made, "g:stroke")) == (0.5, 1.0)


async def test_a_word_that_is_late_is_waited_for_on_target() -> None:
    late = FakeBody({"s": Script(slow=2.0)})
    async with stage(late) as seen:
        await seen.perform(block((GAZE, STORY), after("s:m", "g:stroke")))

    assert seen.times()["g:stroke"] == seen.times()["s:m"] == 2.0


async def test_the_last_to_come_never_stops() -> None:
    slow = FakeBody({"g": Script(slow=2.0)})
    async with stage(slow) as seen:
        await seen.perform(block((GAZE, STORY), together("g:stroke", "s:start")))

    assert seen.times()["g:stroke"] == seen.times()["s:start"] == 1.0
    assert "g:stroke" not in slow.stops


@pytest.mark.parametrize("script", [Script(refuse=True), Script(fail="stroke"), Script(stall="stroke")])
async def test_on_target_nobody_waits_for_who_is_lost(script: Script) -> None:
    async with stage(FakeBody({"p": script})) as seen:
        outcome = await seen.perform(
            block((*ON_TARGET, ARM), together("g:stroke", "f:stroke", "o:stroke", "p:stroke"))
        )

    assert (outcome.status, outcome.dropped) == ("done", ("p",))
    assert seen.times()["g:stroke"] == seen.times()["f:stroke"] == seen.times()["o:stroke"]


async def test_a_bound_from_above_lets_it_leave_its_target_late_rather_than_wrong() -> None:
    async with stage(FakeBody({"p": Script(slow=2.0)})) as seen:
        pair = (together("g:stroke", "p:stroke"), before("p:stroke+1", "g:relax"))
        await seen.perform(block((GAZE, ARM, Wait(id="w", duration=6.0)), *pair))

    assert seen.times()["g:stroke"] == seen.times()["p:stroke"] == 2.5
    assert seen.times()["g:relax"] == 2.5


BODIES = {
    **{f"{factor}x": Variability(slow=tuple(Slow(part=it, factor=factor) for it in ("head", "left_arm", "right_arm")))
       for factor in (0.7, 1.0, 1.5, 2.0, 3.0, 4.0)},
    "stall": Variability(stall=(Stall(part="right_arm", before="stroke_start", seconds=1.0),)),
    "stall in the stroke": Variability(stall=(Stall(part="right_arm", before="stroke", seconds=1.0),)),
    "near already": Variability(displaced=(Displaced(joint="right_shoulder_pitch", angle=15.0),)),
}  # fmt: skip
LOOKS = Gaze(id="g", target="b")
ARMS = Pointing(id="p", target="b", mode="RIGHT_HAND")
SAYS = Speech(id="s", text="Now take this one and turn it", marks=(Mark("this", 9), Mark("turn", 21)))


def apart(seen: Robot, *points: str) -> float:
    times = [seen.times()[point].time for point in points]
    return max(times) - min(times)


@pytest.mark.parametrize("kind", BODIES)
async def test_gaze_face_and_posture_meet_the_stroke_of_any_arm(kind: str) -> None:
    async with robot(BODIES[kind], watched=True) as seen:
        others = (LOOKS, *ON_TARGET[1:])
        await seen.perform(block((*others, ARMS), together(*ALL_OF_THEM, "p:stroke")))

        assert apart(seen, *ALL_OF_THEM, "p:stroke") < 0.001
        assert [stop for stop in seen.unnecessary_stops() if "stall" not in kind] == []


@pytest.mark.parametrize("kind", [kind for kind in BODIES if kind != "stall in the stroke"])
async def test_a_gaze_meets_the_word_and_the_stroke_together(kind: str) -> None:
    async with robot(BODIES[kind], watched=True) as seen:
        await seen.perform(block((LOOKS, ARMS, SAYS), together("g:stroke", "p:stroke", "s:this")))

        assert apart(seen, "g:stroke", "p:stroke", "s:this") < 0.001
        assert [stop for stop in seen.unnecessary_stops() if "stall" not in kind] == []


@pytest.mark.parametrize("kind", BODIES)
async def test_speech_begins_as_all_are_on_target_and_not_before(kind: str) -> None:
    async with robot(BODIES[kind], watched=True) as seen:
        await seen.perform(block((LOOKS, *ON_TARGET[1:], SAYS), together(*ALL_OF_THEM, "s:start")))

        assert apart(seen, *ALL_OF_THEM, "s:start") < 0.001
        assert seen.unnecessary_stops() == []
