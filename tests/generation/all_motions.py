"""The questions to the body as they were before only what can be reached was asked: a slow oracle, kept as it stood.

Every motion, from where the body is and from every pose that an earlier reference may leave, in full.
"""

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise

from engage_hri.schemas.behaviors import Gaze, Hand, Pointing
from engage_hri.schemas.body import Estimate, EstimateItem
from engage_hri.services.generation.references.motions import (
    AT_REST,
    CURRENT_POSE,
    HERE_AND_NOW,
    ExpectedPose,
    Motions,
    Way,
    arm_of,
    hand_of,
)


def all_motions(
    sequence: Sequence[str],
    ask: Callable[[Sequence[EstimateItem]], Sequence[Estimate]],
    hand: Hand | None = None,
    pose: ExpectedPose = HERE_AND_NOW,
    glance: str = "",
) -> Motions:
    """Everything that may be needed. ask: the body, in full."""
    here = ask(from_here(distinct(sequence), hand, pose, glance))
    return collect(sequence, here, ask(from_each_other(sequence, here, hand, glance)), glance)


def from_here(
    targets: Sequence[str], hand: Hand | None = None, pose: ExpectedPose = HERE_AND_NOW, glance: str = ""
) -> tuple[EstimateItem, ...]:
    """First question: a gaze and a point at each of the distinct `targets`, from where the body is or will be.

    glance: see `Motions`. With only one target there is none.
    """
    items = []
    for target in targets:
        point = Pointing(id=f"point at {target}", target=target, mode=hand)
        items.append(EstimateItem(behavior=_gaze(target), pose=pose.head))
        items.append(EstimateItem(behavior=point, pose=pose.arms))
    if glance:
        items.append(EstimateItem(behavior=_gaze(glance), pose=pose.head))
    return tuple(items)


def from_each_other(
    sequence: Sequence[str], answers: Sequence[Estimate], hand: Hand | None = None, glance: str = ""
) -> tuple[EstimateItem, ...]:
    """Second question: the same from the poses that an earlier reference of the `sequence` of targets may leave.

    Those are: on its target, at rest again, and for the head on who was glanced at. A point starts on a target only
    where one arm makes both, one right after the other. answers: to `from_here` of `distinct(sequence)`.
    """
    first = _from_here(sequence, answers, glance)
    items = []
    for since, target, one_arm in _steps(sequence, first):
        pose = first.known["head", CURRENT_POSE, since].pose_after
        items.append(EstimateItem(behavior=_gaze(target), pose=pose))
        if one_arm:
            # The block will name this hand: no other may be asked about, whichever is nearer from there.
            named = hand_of(first.known["arm", CURRENT_POSE, target]) or hand
            pointing = Pointing(id=f"point at {target}", target=target, mode=named)
            items.append(EstimateItem(behavior=pointing, pose=first.known["arm", CURRENT_POSE, since].pose_after))
    for target in distinct(sequence[1:]):
        gaze, point = first.known["head", CURRENT_POSE, target], first.known["arm", CURRENT_POSE, target]
        items.append(EstimateItem(behavior=_gaze(target), pose=gaze.pose_end))
        if point.feasible:
            pointing = Pointing(id=f"point at {target}", target=target, mode=hand_of(point) or hand)
            items.append(EstimateItem(behavior=pointing, pose=point.pose_end))
    for target in _after_glances(sequence, first):
        items.append(EstimateItem(behavior=_gaze(target), pose=first.known["head", CURRENT_POSE, glance].pose_after))
    return tuple(items)


def collect(
    sequence: Sequence[str], here: Sequence[Estimate], onward: Sequence[Estimate], glance: str = ""
) -> Motions:
    """The answers to both questions, by where the motion starts and what it goes to."""
    motions = _from_here(sequence, here, glance)
    answers = iter(onward)
    for since, target, one_arm in _steps(sequence, motions):
        motions.known[Way("head", since, target)] = next(answers)
        if one_arm:
            motions.known[Way("arm", since, target)] = next(answers)
    for target in distinct(sequence[1:]):
        motions.known[Way("head", AT_REST, target)] = next(answers)
        here_too = motions.known["arm", CURRENT_POSE, target]
        motions.known[Way("arm", AT_REST, target)] = next(answers) if here_too.feasible else here_too
    for target in _after_glances(sequence, motions):
        motions.known[Way("head", glance, target)] = next(answers)
    return motions


def distinct(sequence: Sequence[str]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(sequence))


def _gaze(target: str) -> Gaze:
    return Gaze(id=f"gaze at {target}", target=target)


def _after_glances(sequence: Sequence[str], motions: Motions) -> tuple[str, ...]:
    """Targets that may be looked at after a glance."""
    return distinct(sequence[1:]) if motions.glance else ()


def _from_here(sequence: Sequence[str], answers: Sequence[Estimate], glance: str = "") -> Motions:
    known: dict[Way, Estimate] = {}
    each = answers[:-1] if glance else answers
    for target, gaze, point in zip(distinct(sequence), each[::2], each[1::2], strict=True):
        known[Way("head", CURRENT_POSE, target)], known[Way("arm", CURRENT_POSE, target)] = gaze, point
    if glance and answers[-1].feasible:
        known[Way("head", CURRENT_POSE, glance)] = answers[-1]
        return Motions(known, glance)
    return Motions(known)


def _steps(sequence: Sequence[str], motions: Motions) -> Iterator[tuple[str, str, bool]]:
    """Pairs of a target and a later one, each once, and whether one arm points at both, one after the other.

    A look lasts over references without one only in profile `figure-3.3`, where nobody is glanced at.
    """
    next_to_each_other = set(pairwise(sequence))
    seen: set[tuple[str, str]] = set()
    for index, target in enumerate(sequence):
        there = motions.known["arm", CURRENT_POSE, target]
        for since in sequence[index - 1 : index] if motions.glance and index else sequence[:index]:
            if (since, target) not in seen:
                seen.add((since, target))
                before = motions.known["arm", CURRENT_POSE, since]
                one_arm = before.feasible and there.feasible and arm_of(before) == arm_of(there)
                yield since, target, one_arm and (since, target) in next_to_each_other
