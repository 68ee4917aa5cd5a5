"""Mutations of a body: for each law of the contract a body that breaks it, and is caught. An honest one is not."""

import subprocess
import sys
from collections.abc import Callable, Mapping
from inspect import signature
from itertools import product
from pathlib import Path

import pytest
from msgspec.structs import replace

from engage_hri.schemas.behaviors import BlockBehavior
from engage_hri.schemas.body import BodyPose, Estimate
from engage_hri.schemas.world import World
from engage_hri.services.control.bases.one_part_motion import OrdinaryBody
from engage_hri.services.control.contract.body import Body, MovementAuthority
from engage_hri.services.control.testing import BodyContract
from engage_hri.services.control.testing.findings import Finding, LawBroken
from engage_hri.services.control.testing.motions import unused
from engage_hri.services.control.testing.truth import CROWDS
from engage_hri.services.control.torso.body import SimulatedBody
from tests.control import liars, liars_by_claim, liars_by_deed

LAWS = sorted(name.removeprefix("test_") for name in dir(BodyContract) if name.startswith("test_"))
LIARS: tuple[tuple[type[SimulatedBody], str, str], ...] = (
    (liars.Omitting, "reports_every_sync_point_once_and_in_order", "gaze at near-right"),
    (liars.Repeating, "reports_every_sync_point_once_and_in_order", "pointing at far-left"),
    (liars.Backdating, "reports_a_point_as_it_is_passed", "200 ms after its `at`"),
    (liars.Hesitating, "never_stops_where_it_may_pass", "head NOD, stroke_start"),
    (liars.Splitting, "points_that_are_one_instant_are_reported_as_one", "they are 10 ms apart"),
    (liars_by_deed.Posing, "can_do_something_of_each_type_that_it_has", "no poses"),
    (liars_by_deed.Obliging, "refuses_what_it_cannot_do_before_anything_moves", "gaze at nothing"),
    (liars.Counting, "a_speech_tells_its_words_in_order", "the word 'This'"),
    (liars.Prompter, "an_aborted_speech_stops_at_a_word", "one two three four five six seven"),
    (liars.Stammering, "a_held_voice_is_silent_from_the_next_gap_on", "is is"),
    (liars.Hasty, "waits_at_each_hold_point_until_it_may_pass", "gaze at near-right, stroke"),
    (liars_by_deed.Trembling, "stands_still_while_it_waits", "meanwhile"),
    (
        liars.Restless,
        "a_held_behavior_waits_at_the_next_hold_point_though_it_might_pass",
        "that it waits there for authority",
    ),
    (liars.Released, "an_authority_that_comes_while_it_is_held_counts_once_it_goes_on", "gaze at near-right, stroke"),
    (liars.Presuming, "going_on_does_not_give_authority", "gesture BEAT, stroke_start"),
    (liars.Pacing, "a_pace_takes_nothing_from_a_hold", "that it waits there"),
    (liars.Inattentive, "whenever_it_is_held_it_waits_or_ends_by_itself", "after it was held"),
    (liars.Possessed, "a_held_behavior_can_be_aborted_and_taken_over", "it goes on"),
    (liars.Deaf, "an_aborted_behavior_ends_at_once_and_safe", "end"),
    (liars.Stubborn, "an_aborted_hold_ends_at_once_and_safe", "it goes on"),
    (liars_by_deed.Clinging, "a_dropped_stream_ends_safe", "after its task was cancelled"),
    (liars_by_deed.Homeless, "home_is_reached_from_anything", "the safe pose as `home` returns"),
    (liars_by_deed.Wandering, "home_is_reached_from_anything", "the safe pose some time later"),
    (liars_by_deed.Homeless, "leaves_no_task_once_it_is_disconnected", "these go on: way home"),
    (liars_by_deed.Ticking, "leaves_no_task_once_it_is_disconnected", "this is set anew: Ticking.tick"),
    (liars_by_deed.Blocking, "keeps_the_loop_free", "it waits: by `await asyncio.to_thread"),
    (liars_by_deed.Pondering, "keeps_the_loop_free", "it computes: in a process of its own"),
    (liars_by_deed.Abrupt, "brakes_within_the_limits_of_its_joints", "degrees/s^2"),
    (liars_by_deed.Understating, "keeps_its_limits_whatever_comes", "speed of torso_turn"),
    (liars.Boaster, "a_later_behavior_takes_over_the_part", "taken_over"),
    (liars_by_deed.Greedy, "a_shift_takes_nothing_from_a_look_that_lies_over_it", "it has ended as taken_over"),
    (liars.Forgetful, "a_look_that_comes_over_a_shift_on_its_way_goes_home_to_where_that_leads", "start"),
    (liars.Boaster, "a_shift_on_its_way_is_taken_over_by_another", "gazeShift"),
    (liars_by_deed.Optimistic, "takes_the_time_that_it_predicted", "gaze at near-right, stroke"),
    (liars_by_deed.Eager, "predicts_without_moving", "where it was before it was asked"),
    (liars_by_deed.Staying, "is_on_target_where_it_said", "neck_"),
    (liars_by_deed.Remaining, "ends_where_it_said", "neck_"),
    (liars_by_deed.Present, "predicts_from_where_another_look_leaves_it", "after gaze at near-right"),
    (
        liars_by_claim.Backward,
        "is_along_the_ray_that_it_said",
        "gaze at near-right, stroke: expected what the estimate",
    ),
    (liars_by_claim.Backward, "is_along_the_ray_that_it_said", "pointing at far-left, stroke"),
    (liars_by_claim.Rayless, "is_along_the_ray_that_it_said", "None"),
    (liars_by_claim.Wide, "states_what_people_can_tell_apart", "900 cm"),
    (liars_by_claim.Squinting, "states_what_people_can_tell_apart", "172 degrees"),
    (liars_by_claim.Centimetres, "points_as_far_as_its_reach_and_no_farther", "farther than 1.5 m"),
    (liars_by_claim.Modest, "points_as_far_as_its_reach_and_no_farther", "since its `reach` is 0.90 m"),
    (liars_by_claim.Effortless, "counts_the_degrees_that_its_joints_turn", "gaze at near-right, stroke"),
    (liars_by_claim.Effortless, "counts_the_degrees_that_its_joints_turn", "pointing at far-left, stroke"),
    (liars_by_claim.Laborious, "counts_the_degrees_that_its_joints_turn", "gazeShift to far-left, end"),
    (
        liars_by_deed.Present,
        "counts_the_degrees_that_its_joints_turn",
        "0 degrees of its joints from where gaze leaves it",
    ),
    (liars_by_claim.Rehearsing, "rehearses_what_it_estimates", "in the rehearsal"),
    (liars_by_claim.Boasting, "is_as_fast_and_as_slow_as_it_said", "since `shortest` 11 ms allows it"),
    (liars_by_claim.Endless, "is_as_fast_and_as_slow_as_it_said", "since `longest` None allows it"),
    (
        liars_by_claim.Whole,
        "home_takes_the_parts_that_it_is_asked_for_and_no_others",
        "that it goes on while head goes home",
    ),
    (liars_by_claim.Rooted, "home_takes_the_parts_that_it_is_asked_for_and_no_others", "the safe pose of head"),
    (liars_by_claim.Gaping, "closes_its_mouth_with_the_voice", "a mouth that is closed by the end"),
    (liars_by_claim.Oblivious, "looks_at_where_its_target_is_now", "where its target is now"),
    (liars_by_claim.Halfway, "looks_at_where_its_target_is_now", "eyes on where its target is now"),
    (liars_by_claim.Hasty, "says_what_it_looks_at", "beside it"),
    (liars_by_claim.Absent, "says_what_it_looks_at", "`looking_at` 'near-right'; measured ''"),
    (liars_by_claim.Aside, "each_point_is_where_the_joints_are", "a forearm that points at far-left, within 10.0 cm"),
    (liars_by_deed.Noisy, "measures_all_its_joints_within_their_noise", "noise = math.radians(0.3"),
    (liars_by_deed.Jointless, "measures_all_its_joints_within_their_noise", "none of neck_yaw"),
    (liars_by_deed.Unmoved, "says_that_it_moves_as_long_as_it_moves", "meanwhile"),
    (liars.Early, "each_point_is_where_the_joints_are", "eyes on near-right, within 1.0 degrees"),
    (liars_by_deed.Expressionless, "each_point_is_where_the_joints_are", "faceLexeme SMILE, stroke"),
    (liars_by_deed.Stiff, "each_point_is_where_the_joints_are", "a head that has moved"),
    (liars.Boaster, "no_sync_point_that_the_joints_do_not_bear_out", ""),
    (liars.Early, "no_sync_point_that_the_joints_do_not_bear_out", "eyes on"),
    (liars_by_deed.Stiff, "no_sync_point_that_the_joints_do_not_bear_out", "0.00 degrees"),
)
"""Who breaks which law, and words of what is found."""
WITH_FAULTS: tuple[tuple[type[SimulatedBody], str], ...] = (
    (liars_by_deed.Stalled, "beside it"),
    (liars_by_deed.Unnamed, "a fault with a reason"),
    (liars_by_deed.Raw, "ConnectionResetError: peer is gone at liars_by_deed.py, line"),
    (liars_by_deed.Unending, "gaze at near-right with a fault, ready: expected an end within 30.0 s of its abort"),
)
FAULTS = "with_a_fault_it_passes_or_names_the_fault"


class Judge(BodyContract):
    """A suite that is asked one law at a time."""

    def __init__(self, make: Callable[[], Body], faults: Mapping[str, Callable[[], Body]] | None = None) -> None:
        self._make = make
        self._faults = faults or {}

    def make(self) -> Body:
        return self._make()

    def faults(self) -> Mapping[str, Callable[[], Body]]:
        return self._faults

    async def findings(self, law: str) -> list[Finding]:
        """What it finds in all trials of one law."""
        judge, found = getattr(self, f"test_{law}"), []
        given = {"seed": range(getattr(judge, "trials", 1)), "crowd": CROWDS, "fault": self._faults}
        asked = {name: values for name, values in given.items() if name in signature(judge).parameters}
        for values in product(*asked.values()):
            trial = dict(zip(asked, values, strict=True))
            try:
                if "body" in signature(judge).parameters:
                    async with self.connected(self.make) as body:
                        await judge(body, **trial)
                else:
                    await judge(**trial)
            except LawBroken as broken:
                found += broken.findings
        return found


@pytest.mark.parametrize(("liar", "law", "words"), LIARS, ids=lambda each: getattr(each, "__name__", None))
async def test_who_breaks_a_law_is_caught_by_it(liar: type[SimulatedBody], law: str, words: str) -> None:
    found = await Judge(liar).findings(law)

    assert any(words in str(finding) for finding in found), "\n".join(map(str, found)) or "nothing is found"


@pytest.mark.parametrize(("liar", "words"), WITH_FAULTS, ids=lambda each: getattr(each, "__name__", None))
async def test_who_hides_a_fault_is_caught(liar: type[SimulatedBody], words: str) -> None:
    found = await Judge(SimulatedBody, {"a fault": liar}).findings(FAULTS)

    assert any(words in str(finding) for finding in found), "\n".join(map(str, found)) or "nothing is found"


def test_each_law_has_a_body_that_breaks_it() -> None:
    assert sorted({law for _, law, _ in LIARS} | {FAULTS}) == LAWS


@pytest.mark.parametrize("law", LAWS)
def test_each_law_says_what_it_is_and_what_it_usually_is_if_it_is_broken(law: str) -> None:
    words, _, usual = (getattr(BodyContract, f"test_{law}").__doc__ or "").partition("\n\n")

    assert words.strip().endswith(".")
    assert usual.strip().startswith("Usually ")


@pytest.mark.parametrize(
    ("factor", "words"), [(2.0, "earlier than it says: the estimate is too long"), (0.5, "later than it says")]
)
async def test_a_wrong_time_is_told_in_its_direction(factor: float, words: str) -> None:
    class Wrong(SimulatedBody):
        def estimate(self, behavior: BlockBehavior, pose: BodyPose | None, world: World) -> Estimate:
            told = super().estimate(behavior, pose, world)
            return replace(told, phases=tuple(replace(each, natural=factor * each.natural) for each in told.phases))

    found = await Judge(Wrong).findings("takes_the_time_that_it_predicted")

    assert {words in finding.advice for finding in found if finding.advice} == {True}


async def test_what_is_wrong_from_home_is_no_finding_of_the_law_of_other_looks() -> None:
    class Slow(SimulatedBody):
        def estimate(self, behavior: BlockBehavior, pose: BodyPose | None, world: World) -> Estimate:
            told = super().estimate(behavior, pose, world)
            return replace(told, phases=tuple(replace(each, natural=settled(each.natural)) for each in told.phases))

    def settled(seconds: float) -> float:
        return seconds + 0.2 if seconds else 0.0

    assert await Judge(Slow).findings("takes_the_time_that_it_predicted")
    assert not await Judge(Slow).findings("predicts_from_where_another_look_leaves_it")


async def test_a_behavior_that_never_waits_is_told_in_the_words_of_the_law() -> None:
    class Alone(liars.Teller):
        def heard(self, behavior: BlockBehavior, authority: MovementAuthority) -> MovementAuthority:
            return MovementAuthority(behavior, "end")

    found = await Judge(Alone).findings("a_later_behavior_takes_over_the_part")

    assert [finding.expected for finding in found] == ["that it is under way until it is taken over"]


async def test_of_a_face_of_lamps_nothing_can_be_aborted() -> None:
    class Lamps(OrdinaryBody):
        name, part, types, joints = "lamps", "face", ("face", "faceLexeme"), ()

        def aim(self, behavior: BlockBehavior, world: World) -> Mapping[str, float]:
            return {}

        def angles(self) -> Mapping[str, float]:
            return {}

        def go(self, goal: Mapping[str, float], seconds: float) -> None:
            pass

    with pytest.raises(pytest.skip.Exception, match="nothing that takes time"):
        await Judge(Lamps).findings("an_aborted_behavior_ends_at_once_and_safe")


async def test_who_states_far_more_speed_than_it_ever_has_is_told_so() -> None:
    judges = {each: Judge(each) for each in (SimulatedBody, liars_by_claim.Sprinting)}
    told = {}
    for liar, judge in judges.items():
        judge.fastest = {}
        await judge.findings("keeps_its_limits_whatever_comes")
        async with judge.connected(liar) as body:
            told[liar] = unused(body.capabilities.joints, judge.fastest)

    assert not told[SimulatedBody]
    assert "no joint was ever near the speed that it states" in told[liars_by_claim.Sprinting][0]


def test_where_the_plugin_of_the_suite_is_not_loaded_it_fails_with_the_line_that_loads_it(tmp_path: Path) -> None:
    (tmp_path / "test_body.py").write_text(
        "from engage_hri.services.control.testing import BodyContract\n"
        "from engage_hri.services.control.torso.body import SimulatedBody\n"
        "class TestIt(BodyContract):\n"
        "    make = SimulatedBody\n"
    )
    command = (
        sys.executable,
        "-m",
        "pytest",
        "-p",
        "no:cacheprovider",
        "--asyncio-mode=auto",
        "-k",
        "home_is_reached",
    )
    ended = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)

    assert ended.returncode == 1
    assert 'pytest_plugins = ["engage_hri.services.control.testing.plugin"]' in ended.stdout
    assert "conftest.py" in ended.stdout
