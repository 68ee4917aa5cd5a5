"""The repertoire as data: what comes with the body, files of a user, and what is wrong with bad ones."""

import asyncio
import re
from pathlib import Path

import pytest

from engage_hri.schemas.behaviors import (
    BlockBehavior,
    Expression,
    Face,
    FaceFacs,
    FaceLexeme,
    FaceShift,
    Gesture,
    Head,
    PartPose,
    Pointing,
    Pose,
    Posture,
    PostureShift,
)
from engage_hri.schemas.faults import InputRefused
from engage_hri.services.control.config import ControlConfig
from engage_hri.services.control.figure import kinematics
from engage_hri.services.control.figure.repertoire import BUILT_IN, TABLES, Absent, GesturePath, HeadPath, Repertoire
from engage_hri.services.control.testing import WORLD, Stage, performed, times
from engage_hri.services.control.testing.motions import recorded, violations
from engage_hri.services.control.torso.body import SimulatedBody
from tests.control.watching import stops

PAGE = Path(__file__).parents[2] / "docs" / "control.md"
LEXEMES: list[BlockBehavior] = [
    *(Gesture(id=f"gesture {lexeme}", lexeme=lexeme) for lexeme in BUILT_IN.lexemes("gesture")),
    *(Head(id=f"head {lexeme}", lexeme=lexeme, amount=1.0) for lexeme in BUILT_IN.lexemes("head")),
    *(FaceLexeme(id=f"face {lexeme}", lexeme=lexeme, amount=1.0) for lexeme in BUILT_IN.lexemes("face")),
    *(FaceFacs(id=f"AU{unit}", au=int(unit), amount=1.0) for unit in BUILT_IN.lexemes("facs")),
    *(Posture(id=f"pose {lexeme}", lexeme=lexeme) for lexeme in BUILT_IN.lexemes("pose")),
    *(Posture(id=f"stance {lexeme}", stance=lexeme) for lexeme in BUILT_IN.lexemes("stance")),
]
STILL = {"head FRONT", "face NEUTRAL", "face EYEBROWS_FLAT", "face MOUTH_FLAT", "pose UPRIGHT", "pose ARMS_NEUTRAL",
         "stance STANDING", "stance STAND"}  # fmt: skip
"""Lexemes of how it is anyway."""


def body_with(repertoire: Repertoire = BUILT_IN) -> SimulatedBody:
    body = SimulatedBody(repertoire=repertoire)
    body.see(WORLD)
    return body


def pose(body: SimulatedBody) -> dict[str, float]:
    return {angle.joint: angle.angle for angle in body.state().pose.joints}


@pytest.mark.parametrize("behavior", LEXEMES, ids=lambda each: each.id)
async def test_each_lexeme_is_one_fluid_motion_within_the_limits_and_as_estimated(behavior: BlockBehavior) -> None:
    body = body_with()
    home = pose(body)
    estimate = body.estimate(behavior, None, WORLD)
    async with recorded(body) as recording:
        at = times(await performed(body, behavior))

    assert estimate.degraded == ""
    elapsed = dict(zip([phase.to for phase in estimate.phases], estimate.phases, strict=True))
    assert [at[to] - at[phase.since] for to, phase in elapsed.items()] == pytest.approx(
        [phase.natural for phase in elapsed.values()], abs=1e-6
    )
    assert pose(body) == pytest.approx(home, abs=1e-6)
    assert (at["end"] == at["start"]) is (behavior.id in STILL)
    if behavior.id not in STILL:
        assert violations(recording, body.capabilities.joints) == []
        assert stops(recording, at["start"], at["end"]) == 0
        assert abs(recording.angles - recording.angles[0]).max() > 0.05


async def test_a_direction_of_the_head_is_held_there_and_a_tilt_leaves_the_gaze_where_it_is() -> None:
    body = body_with()
    before = body.state().gaze.axis
    up = Stage(body, Head(id="up", lexeme="up-left"), "stroke")
    await asyncio.sleep(2.0)
    held = pose(body)
    up.authority.revoke()
    await up.over()
    await body.home()
    tilt = Stage(body, Head(id="tilt", lexeme="TILT_RIGHT"), "stroke")
    await asyncio.sleep(2.0)

    assert held["neck_pitch"] > 0.1
    assert held["neck_yaw"] > 0.1
    assert pose(body)["neck_roll"] < -0.1
    assert body.state().gaze.axis == pytest.approx(before, abs=0.02)
    tilt.authority.revoke()
    await tilt.over()


async def test_several_poses_and_a_stance_are_one_posture() -> None:
    body = body_with()
    poses = (PartPose(part="LEFT_ARM", lexeme="ARMS_OPEN"), PartPose(lexeme="LEAN_FORWARD"))
    estimate = body.estimate(Posture(id="p", stance="STANDING", poses=poses), None, WORLD)
    home = pose(body)
    await performed(body, PostureShift(id="p", stance="STANDING", poses=poses))
    there = pose(body)

    assert set(estimate.parts) == {"torso", "left_arm"}
    assert there["torso_lean"] == pytest.approx(0.209, abs=0.001)
    assert there["left_shoulder_yaw"] > 0.5
    assert there["right_shoulder_yaw"] == home["right_shoulder_yaw"]


async def test_what_a_shift_of_face_or_posture_has_changed_is_gone_back_to():
    body = body_with()
    await performed(body, FaceShift(id="face", lexeme="SMILE"))
    await performed(body, PostureShift(id="torso", lexeme="LEAN_FORWARD"))
    await performed(body, PostureShift(id="arms", lexeme="ARMS_OPEN"))
    shifted = pose(body)
    estimate = body.estimate(Gesture(id="beat", lexeme="BEAT"), None, WORLD)
    for behavior in (
        FaceLexeme(id="f", lexeme="ANGER"),
        Posture(id="o", lexeme="TURN_LEFT"),
        Gesture(id="g", lexeme="BEAT", mode="BOTH_HANDS"),
    ):
        at = times(await performed(body, behavior))

    assert pose(body) == pytest.approx(shifted, abs=1e-6)
    assert at["end"] - at["start"] == pytest.approx(sum(phase.natural for phase in estimate.phases), abs=1e-6)
    stage = Stage(body, FaceShift(id="gone", lexeme="FROWN"))
    await asyncio.sleep(0.05)
    stage.authority.revoke()
    await stage.over()
    await body.home()
    assert pose(body) == pytest.approx(pose(body_with()), abs=1e-6)


async def test_several_expressions_are_one_face_each_with_its_side_and_amount() -> None:
    body = body_with()
    face = Face(id="f", amount=0.5, expressions=(
        Expression(lexeme="SMILE"), Expression(au=43, side="LEFT", amount=1.0)))  # fmt: skip
    stage = Stage(body, face, "stroke")
    await asyncio.sleep(2.0)
    there = pose(body)

    assert there["left_mouth_corner"] == pytest.approx(0.95 * 0.5, abs=0.03)
    assert there["left_lid"] == pytest.approx(0.95)
    assert there["right_lid"] == 0.0
    stage.authority.revoke()
    await stage.over()


@pytest.mark.parametrize(
    ("behavior", "names"),
    [
        (Gesture(id="b", lexeme="Generic"), ("'Generic'", "'BEAT'")),
        (FaceFacs(id="b", au=9), ("'9'", "'10'")),
        (Posture(id="b", stance="SITTING"), ("'SITTING'", "'STANDING'")),
        (
            Posture(id="b", poses=(PartPose(lexeme="LEGS_OPEN"), PartPose(lexeme="ARMS_OPEN"))),
            ("'LEGS_OPEN'", "rest"),
        ),
        (Pose(id="b", part="HEAD", lexeme="LEAN_FORWARD"), ("'HEAD'", "'TORSO'")),
        (Pointing(id="b", target="far-left", mode="BOTH_HANDS"), ("'BOTH_HANDS'", "'LEFT_HAND'")),
        (Face(id="b", overshoot=0.2, expressions=(Expression(lexeme="SMILE"),)), ("overshoot 0.2", "amount")),
    ],
)
async def test_what_is_near_is_performed_and_the_estimate_names_both(
    behavior: BlockBehavior, names: tuple[str, str]
) -> None:
    body = body_with()
    estimate = body.estimate(behavior, None, WORLD)

    assert estimate.feasible
    assert all(name in estimate.degraded for name in names)
    assert "end" in times(await performed(body, behavior))


def test_a_file_adds_and_overrides_and_the_page_shows_how() -> None:
    page = PAGE.read_text(encoding="utf-8").partition("### Repertoire")[2]
    (shown,) = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
    mine = BUILT_IN.extended(shown, "mine.toml")

    assert mine.find("gesture", "conduit").path == BUILT_IN.find("gesture", "BEAT").path
    assert mine.find("gesture", "CONDUIT").note == ""
    salute = mine.find("gesture", "SALUTE").path
    assert isinstance(salute, GesturePath)
    assert salute.stroke.elbow == 140
    assert "'SALUTE'" in mine.find("gesture", "GENERIC").note
    assert mine.find("head", "yes").name == "NOD"
    assert mine.face(mine.find("face", "GRIN").path) == {"left_mouth_corner": 1, "right_mouth_corner": 1, "lips": 0.5}
    assert set(mine.find("pose", "LISTENING").path.joints()) == {"torso", "left_arm"}
    assert "SALUTE" not in BUILT_IN.lexemes("gesture")


def test_a_later_file_is_stronger_and_may_override_what_others_lead_to() -> None:
    one = BUILT_IN.extended('[head]\nYES = "NOD"', "one.toml")
    two = one.extended("[head.NOD]\nto = { up = -0.5 }", "two.toml")

    assert two.find("head", "YES").path.to.up == -0.5
    assert one.find("head", "YES").path.to.up == -1


def test_a_lexeme_of_each_table_can_be_found_in_any_spelling() -> None:
    for table in TABLES:
        for lexeme in BUILT_IN.lexemes(table):
            assert BUILT_IN.find(table, lexeme.lower().replace("_", "-")) == BUILT_IN.find(table, lexeme)


def test_directions_of_the_head_add_up_and_nods_do_not() -> None:
    path = BUILT_IN.find("head", "TILT_LEFT+DOWN").path

    assert isinstance(path, HeadPath)
    assert (path.to.tilt, path.to.up, path.to.left, path.hold) == (1, -1, 0, True)
    for lexeme in ("NOD_UP", "UP_NOD", "UP_", "UP_SIDEWAYS"):
        if lexeme != "UP_":
            with pytest.raises(Absent):
                BUILT_IN.find("head", lexeme)


@pytest.mark.parametrize(
    ("table", "lexeme", "told"),
    [
        ("gesture", "WAVES", "do you mean WAVE"),
        ("gesture", "MOONWALK", "there are BEAT, WAVE"),
        ("stance", "LYING", "BML defines it, but this body has nothing near it"),
        ("facs", "28", "BML defines it"),
    ],
)
def test_what_is_absent_is_told_with_what_there_is(table: str, lexeme: str, told: str) -> None:
    with pytest.raises(Absent, match=re.escape(told)):
        BUILT_IN.find(table, lexeme)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("x", "mine.toml: not TOML"),
        ("[gestures]\nA = 'B'", "unknown table [gestures] (known are gesture, head"),
        ("gesture = 3", "a table is expected, not 3, in `gesture`"),
        ("[gesture]\nA = 'B'", "there is no gesture 'B', in `gesture.A` (there are BEAT"),
        ("[gesture]\nA = 'BEET'", "in `gesture.A` (do you mean 'BEAT'?)"),
        ("[gesture]\nA = { ready = { inward = 1 } }", "missing required field `forward`, in `gesture.A.ready`"),
        ("[gesture]\nBEAT = { strike = 1 }", "unknown field `strike`, in `gesture.BEAT`"),
        ("[head]\nA = 'B'\nB = 'A'", "it leads back to itself: A = B = A, in `head.A`"),
        ("[head]\nTILT_LEFT = 'TILT'", "it leads back to itself: TILT_LEFT = TILT = TILT_LEFT"),
        ("[head]\nA = { to = { up = 2 } }", "<= 1.0, in `head.A.to.up`"),
        ("[head]\nA = { to = { up = 1 }, degrees = [4, 40] }", "neck_pitch would go 40 degrees, in `head.A`"),
        ("[head]\nA = { to = { up = 1 }, degrees = [4, nan] }", "would go nan degrees, in `head.A`"),
        ("[face]\nA = { nose = 1 }", "a face has no 'nose', in `face.A` (there are brows"),
        ("[face]\nA = { AU99 = 1 }", "there is no action unit 99, in `face.A`"),
        ("[face]\nA = { jaw = -1 }", "jaw would be at -1, in `face.A` (its range is 0 to 1)"),
        ("[facs]\n12 = { AU12 = 1 }", "a face has no 'AU12', in `facs.12`"),
        (
            "[pose]\nA = { arms = { inward = 500, forward = 0, elbow = 20 } }",
            "left_shoulder_yaw would be at -500 degrees, in `pose.A` (its range is -80 degrees to 45 degrees)",
        ),
        ("[nearest.gesture]\nA = 3", "the name of a lexeme is expected, not 3, in `nearest.gesture.A`"),
        ("[nearest.gesture]\nA = 'B'", "there is no gesture 'B', in `nearest.gesture.A`"),
        ("[nearest.nearest]\nA = 'B'", "unknown table [nearest.nearest]"),
    ],
)
def test_a_bad_file_is_refused_with_the_key_and_what_is_allowed(text: str, told: str) -> None:
    with pytest.raises(InputRefused) as refused:
        BUILT_IN.extended(text, "mine.toml")

    assert str(refused.value).startswith("mine.toml: ")
    assert told in str(refused.value)


def test_the_configuration_names_one_file_or_several() -> None:
    assert ControlConfig().repertoire_files == ()
    assert ControlConfig(repertoire="a.toml").repertoire_files == ("a.toml",)
    assert ControlConfig(repertoire=("a.toml", "b.toml")).repertoire_files == ("a.toml", "b.toml")


def test_each_joint_of_the_face_is_moved_by_something() -> None:
    moved = {
        joint
        for table in ("face", "facs")
        for lexeme in BUILT_IN.lexemes(table)  # type: ignore[arg-type]
        for joint in BUILT_IN.face(BUILT_IN.find(table, lexeme).path)  # type: ignore[arg-type]
    }

    assert moved == set(kinematics.joints_of("face"))
