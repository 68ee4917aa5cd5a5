"""Motions that the body is asked for: from postures that a pair able to win leaves, and no others."""

from engage_hri.schemas.behaviors import Gaze, Pointing, Reference
from engage_hri.schemas.body import BodyPose, Estimate, JointAngle
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.references.motions import (
    AT_REST,
    CURRENT_POSE,
    Motions,
    Way,
    from_here,
    from_here_told,
    onward,
    onward_told,
)
from engage_hri.services.generation.references.pairs import POINT, Table, considered, shown
from engage_hri.services.generation.references.policy import HeadAndArms, unasked
from tests.generation.tables import apart, body, option, refer, scene

CONFIG = GenerationConfig()


def asked_for(references: list[Reference], motions: Motions, *apart_ids: str) -> list[tuple[str, str, str]]:
    """Ways that are asked for at first: a look from here, a point from here, each known."""
    here = {way: motion for way, motion in motions.known.items() if way[1] == CURRENT_POSE}
    known = Motions(here, motions.glance)
    world = apart()
    seems = shown([reference.target for reference in references], scene(world), known)
    tables = [
        Table(each, considered(each, seems[each.target], scene(world), known, CONFIG), CONFIG) for each in references
    ]
    return [(way.part, way.since, way.target) for way in unasked(tables, known, CONFIG, apart_ids)]


POINTED, LOOKED = option("this", deictic=True), option("the thing")
"""With 0.95 asked for only a point is understood; with 0.85 a look is, too."""


def test_after_a_point_that_has_to_be_the_body_is_asked_for_motions_from_it_alone() -> None:
    motions = body(apart(), ["rectangle", "trapezoid"])
    references = [refer("1", "rectangle", 0.95, POINTED), refer("2", "trapezoid", 0.95, POINTED)]

    assert asked_for(references, motions) == [("head", "rectangle", "trapezoid"), ("arm", "rectangle", "trapezoid")]


def test_after_references_without_a_gesture_the_body_is_asked_for_nothing_more() -> None:
    motions = body(apart(), ["rectangle", "trapezoid"])
    references = [refer("1", "rectangle", 0.6, LOOKED), refer("2", "trapezoid", 0.95, POINTED)]
    wordy = [refer("1", "rectangle", 0.6, option("", 0)), *references[1:]]

    assert ("head", "rectangle", "trapezoid") in asked_for(references, motions)
    assert "trapezoid" in {target for _, _, target in asked_for(wordy, motions)}
    assert asked_for(references[1:], motions) == []


def test_a_hand_that_went_home_in_between_is_asked_for_from_there() -> None:
    targets = ["rectangle", "trapezoid", "red-square"]
    motions = body(apart(), targets)
    references = [refer(id, target, 0.95, POINTED) for id, target in zip("123", targets, strict=True)]

    assert asked_for(references, motions, "3") == [
        ("head", "rectangle", "trapezoid"),
        ("arm", "rectangle", "trapezoid"),
        ("head", AT_REST, "red-square"),
        ("arm", AT_REST, "red-square"),
    ]


def test_from_there_the_body_is_asked_about_the_hand_that_will_be_named_and_for_no_phases() -> None:
    sides = {"trapezoid": "right_arm", "rectangle": "left_arm"}
    motions = body(apart(), list(sides), arm_for=sides.get)  # type: ignore[arg-type]
    ways = [Way("head", "trapezoid", "rectangle"), Way("arm", AT_REST, "rectangle"), Way("arm", "x", "trapezoid")]
    motions.known["arm", CURRENT_POSE, "x"] = motions.known["arm", CURRENT_POSE, "trapezoid"]

    asked = onward(ways, motions)

    assert [item.behavior for item in asked] == [
        Gaze(id="gaze at rectangle", target="rectangle"),
        Pointing(id="point at rectangle", target="rectangle", mode="LEFT_HAND"),
        Pointing(id="point at trapezoid", target="trapezoid", mode="RIGHT_HAND"),
    ]
    assert [{item.only for item in items} for items in (from_here(["a"]), asked)] == [{"posture"}, {"degrees"}]


def test_a_motion_starts_where_the_one_before_it_ends() -> None:
    after, end = BodyPose(joints=(JointAngle("on", 1.0),)), BodyPose(joints=(JointAngle("home", 0.0),))
    here = [
        Estimate(behavior=str(number), feasible=True, parts=("left_arm",), pose_after=after, pose_end=end)
        for number in range(4)
    ]
    motions = from_here_told(["a", "b"], here)
    ways = [Way("head", "a", "b"), Way("head", AT_REST, "b"), Way("arm", "a", "b"), Way("arm", AT_REST, "b")]

    assert [item.pose for item in onward(ways, motions)] == [after, end, after, end]
    told = onward_told(ways, motions, here)
    assert (told.known["head", "a", "b"], told.known["head", AT_REST, "b"]) == (here[0], here[1])
    assert (told.known["arm", "a", "b"], told.known["arm", AT_REST, "b"]) == (here[2], here[3])
    assert ways[0] not in motions.known


def test_the_head_is_on_who_is_glanced_at_after_a_point() -> None:
    away = Estimate(behavior="", feasible=True, head_degrees=40.0)
    motions = body(apart(), ["rectangle", "rectangle"])
    motions = Motions({**motions.known, Way("head", "ann", "rectangle"): away}, "ann")
    posture = HeadAndArms().afterwards("rectangle", "right_arm", motions)[POINT]

    assert posture.head == "ann"
    assert posture.afterwards("rectangle", "right_arm", motions)["directed_gaze"].head == "rectangle"


def test_a_glance_is_asked_about_once_and_only_for_what_comes_after_it() -> None:
    here = [Estimate(behavior=str(number), feasible=True, parts=("left_arm",)) for number in range(5)]
    first = from_here(["rectangle", "trapezoid"], glance="ann")
    motions = from_here_told(["rectangle", "trapezoid"], here, "ann")
    references = [refer("1", "rectangle", 0.95, POINTED), refer("2", "trapezoid", 0.95, POINTED)]

    targets = ["rectangle", "rectangle", "trapezoid", "trapezoid", "ann"]
    assert [item.behavior.target for item in first] == targets  # type: ignore[union-attr]
    assert ("head", "ann", "trapezoid") in asked_for(references, motions)
    assert motions.known["head", CURRENT_POSE, "ann"] is here[4]


def test_who_cannot_be_looked_at_is_not_glanced_at() -> None:
    here = [Estimate(behavior=str(number), feasible=number < 4) for number in range(5)]

    assert from_here_told(["a", "b"], here, "ann").glance == ""
