"""What the body has to say before references can be chosen: which motions to ask about, and its answers by pose."""

from collections.abc import Iterator, Sequence

from msgspec import Struct

from schemas.behaviors import Gaze, Hand, Pointing
from schemas.body import Estimate, EstimateItem

HERE = ""
"""Where the body is now, as the place a motion starts from."""


class Motions(Struct, frozen=True):
    """Estimates by (since, target): a head or an arm that is on `since`, or HERE, goes to `target`."""

    gazes: dict[tuple[str, str], Estimate]
    points: dict[tuple[str, str], Estimate]

    def gaze(self, since: str, target: str) -> Estimate:
        return self.gazes[since, target]

    def point(self, since: str, target: str) -> Estimate:
        return self.points[since, target]


def arm_of(point: Estimate) -> str:
    """Which arm the body would point with."""
    return "+".join(sorted(point.parts))


def hand_of(point: Estimate) -> Hand | None:
    """The hand to name in the block, so that the body points with the arm it estimated."""
    arms: dict[str, Hand] = {"left_arm": "LEFT_HAND", "right_arm": "RIGHT_HAND"}
    hands = [hand for part, hand in arms.items() if part in point.parts]
    return hands[0] if len(hands) == 1 else None


def from_here(targets: Sequence[str], hand: Hand | None = None) -> tuple[EstimateItem, ...]:
    """First question: a gaze and a point at each of the distinct `targets`, from where the body is."""
    items = []
    for target in targets:
        items.append(EstimateItem(behavior=Gaze(id=f"gaze at {target}", target=target)))
        items.append(EstimateItem(behavior=Pointing(id=f"point at {target}", target=target, mode=hand)))
    return tuple(items)


def from_each_other(
    sequence: Sequence[str], answers: Sequence[Estimate], hand: Hand | None = None
) -> tuple[EstimateItem, ...]:
    """Second question: the same from the pose that an earlier reference of the `sequence` of targets leaves.

    answers: to `from_here` of `distinct(sequence)`.
    """
    first = collect(sequence, answers, ())
    items = []
    for since, target in _steps(sequence):
        head, arm = first.gaze(HERE, since).pose_after, first.point(HERE, since).pose_after
        # The block will name this hand: no other may be asked about, whichever is nearer from there.
        named = hand_of(first.point(HERE, target)) or hand
        items.append(EstimateItem(behavior=Gaze(id=f"gaze at {target}", target=target), pose=head))
        items.append(EstimateItem(behavior=Pointing(id=f"point at {target}", target=target, mode=named), pose=arm))
    return tuple(items)


def collect(sequence: Sequence[str], here: Sequence[Estimate], onward: Sequence[Estimate]) -> Motions:
    """The answers to both questions, by where the motion starts and what it goes to."""
    gazes: dict[tuple[str, str], Estimate] = {}
    points: dict[tuple[str, str], Estimate] = {}
    for target, gaze, point in zip(distinct(sequence), here[::2], here[1::2], strict=True):
        gazes[HERE, target], points[HERE, target] = gaze, point
    for step, gaze, point in zip(_steps(sequence), onward[::2], onward[1::2], strict=False):
        gazes[step], points[step] = gaze, point
    return Motions(gazes, points)


def distinct(sequence: Sequence[str]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(sequence))


def _steps(sequence: Sequence[str]) -> Iterator[tuple[str, str]]:
    seen: set[tuple[str, str]] = set()
    for index, target in enumerate(sequence):
        for since in sequence[:index]:
            if (since, target) not in seen:
                seen.add((since, target))
                yield since, target
