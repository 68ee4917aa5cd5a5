"""Motions that references may need: the questions to the body, and its estimates by pose.

First it is asked for a gaze and a point at each target from where it is: that says what can be meant, and which
pairs of gesture and phrase may win. Then only for motions from postures that these leave, and how far they turn. All
that is asked is what a motion comes to, never its phases.
"""

from collections.abc import Iterable, Sequence
from typing import Literal, NamedTuple, get_args

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.behaviors import BlockBehavior, Gaze, Hand, Pointing
from engage_hri.schemas.body import BodyPose, Estimate, EstimateItem

CURRENT_POSE = ""
"""Start of a motion: where the body is now."""
AT_REST = ":rest"
"""Start of a motion: where head or arm go when they have nothing to do. No entity has such an id."""

Part = Literal["head", "arm"]
PARTS: tuple[Part, ...] = get_args(Part)


class Way(NamedTuple):
    """A motion of the head or an arm that is on `since`, to `target`."""

    part: Part
    since: str
    target: str


class Motions(Struct, frozen=True):
    """Estimates of the body by way. A way begins at the target of another one, CURRENT_POSE or AT_REST.

    glance: the person looked at after each point, before the next reference is made; "": nobody, the head stays.
    looks_last: a look lasts until the next one, whatever comes between, as in profile `figure-3.3`.
    """

    known: dict[Way, Estimate]
    glance: str = ""
    looks_last: bool = False


def arm_of(point: Estimate) -> str:
    """Name of the arm (or arms) that the body would point with."""
    return point.parts[0] if len(point.parts) == 1 else "+".join(sorted(point.parts))


def hand_of(point: Estimate) -> Hand | None:
    """The hand to name in the block, so that the body points with the arm it estimated; None: both, or neither."""
    arms: dict[str, Hand] = {"left_arm": "LEFT_HAND", "right_arm": "RIGHT_HAND"}
    hands = [hand for part, hand in arms.items() if part in point.parts]
    return hands[0] if len(hands) == 1 else None


class ExpectedPose(Struct, frozen=True):
    """Poses of head and arms once the behaviors that move them now are on target; None: the present pose."""

    head: BodyPose | None = None
    arms: BodyPose | None = None


HERE_AND_NOW = ExpectedPose()


def last_motions(moving: Sequence[BlockBehavior]) -> tuple[EstimateItem, ...]:
    """Questions for the last gaze and the last point of `moving`: they decide where head and arms will be."""
    points = [behavior for behavior in moving if isinstance(behavior, Pointing)]
    gazes = [behavior for behavior in moving if not isinstance(behavior, Pointing)]
    return tuple([_question(behavior, None) for behavior in (*gazes[-1:], *points[-1:])])


def pose_after(items: Sequence[EstimateItem], answers: Sequence[Estimate]) -> ExpectedPose:
    """The pose once these motions are on target. items, answers: of `last_motions`."""
    pose = ExpectedPose()
    for item, answer in zip(items, answers, strict=True):
        if isinstance(item.behavior, Pointing):
            pose = ExpectedPose(pose.head, answer.pose_after)
        else:
            pose = ExpectedPose(answer.pose_after, pose.arms)
    return pose


def from_here(
    targets: Iterable[str], hand: Hand | None = None, pose: ExpectedPose = HERE_AND_NOW, glance: str = ""
) -> tuple[EstimateItem, ...]:
    """First question: a gaze and a point at each of the distinct `targets`, from where the body is or will be.

    glance: see `Motions`. With only one target there is none.
    """
    items = []
    for target in targets:
        items.append(_question(_gaze(target), pose.head))
        items.append(_question(_point(target, hand), pose.arms))
    if glance:
        items.append(_question(_gaze(glance), pose.head))
    return tuple(items)


def from_here_told(targets: Sequence[str], answers: Sequence[Estimate], glance: str = "") -> Motions:
    """Motions from where the body is. targets, answers, glance: of `from_here`."""
    ways = [Way(part, CURRENT_POSE, target) for target in targets for part in PARTS]
    if glance:
        ways.append(Way("head", CURRENT_POSE, glance))
    known = dict(zip(ways, answers, strict=True))
    return Motions(known, glance if glance and answers[-1].feasible else "")


def onward(ways: Sequence[Way], motions: Motions, hand: Hand | None = None) -> tuple[EstimateItem, ...]:
    """Second question: motions from where earlier references leave head and arms. hand: the only one allowed.

    The block will name the hand that points at a target from here: no other may be asked about, whichever is nearer
    from there.
    """
    items = []
    for way in ways:
        if way.part == "head":
            items.append(_question(_gaze(way.target), _left(way, motions), "degrees"))
        else:
            named = hand_of(motions.known[way._replace(since=CURRENT_POSE)]) or hand
            items.append(_question(_point(way.target, named), _left(way, motions), "degrees"))
    return tuple(items)


def onward_told(ways: Sequence[Way], motions: Motions, answers: Sequence[Estimate]) -> Motions:
    """Add the motions of a second question. ways, answers: of `onward`."""
    return replace(motions, known=motions.known | dict(zip(ways, answers, strict=True)))


def distinct(sequence: Iterable[str]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(sequence))


def _left(way: Way, motions: Motions) -> BodyPose | None:
    """The pose in which a way starts."""
    if way.since == AT_REST:
        return motions.known[way._replace(since=CURRENT_POSE)].pose_end
    return motions.known[Way(way.part, CURRENT_POSE, way.since)].pose_after


def _gaze(target: str) -> Gaze:
    return Gaze(id=f"gaze at {target}", target=target)


def _point(target: str, hand: Hand | None) -> Pointing:
    return Pointing(id=f"point at {target}", target=target, mode=hand)


def _question(
    behavior: BlockBehavior, pose: BodyPose | None, only: Literal["posture", "degrees"] = "posture"
) -> EstimateItem:
    return EstimateItem(behavior=behavior, pose=pose, only=only)
