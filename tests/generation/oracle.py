"""The optimum of a sequence of references by brute force, in whole numbers: what the reference policy must find.

Written from the formulas alone, and shares nothing with the policy: distances on a flat table instead of rays,
fractions instead of floats, every sequence instead of a dynamic program.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from fractions import Fraction
from functools import cache
from itertools import product
from math import dist
from typing import NamedTuple

from engage_hri.schemas.behaviors import Reference
from engage_hri.services.generation.config import Channel
from engage_hri.services.generation.references.motions import AT_REST, CURRENT_POSE, Motions
from engage_hri.services.generation.references.pairs import ReferenceScene
from tests.generation.tables import body, flat_world, scene

HEAD, ARM, WORD, WAIT = 6, 10, 210, 180
"""Cost of a degree of the head, a degree of an arm, a word, and the wait for shared gaze: in 1/600 s."""
R_GESTURE = (Fraction(0), Fraction(10, 100), Fraction(20, 100), Fraction(28, 100))
R_PHRASE = Fraction(70, 100)
LOOKS, WAITS, POINTS = (1, 2, 3), (2, 3), (3,)
"""Gestures by their number."""


class Problem(NamedTuple):
    """head, arm: degrees by (since, target). unable: what no arm can point at. refused: (since, target) of one.

    apart: ids of the references before which head and arms go home.
    """

    places: dict[str, tuple[float, float]]
    references: list[Reference]
    head: dict[tuple[str, str], int]
    arm: dict[tuple[str, str], int]
    arm_for: Callable[[str], str]
    unable: frozenset[str] = frozenset()
    refused: frozenset[tuple[str, str]] = frozenset()
    no_gaze: str = ""
    no_point: str = ""
    channel: Channel = "sum"
    apart: frozenset[str] = frozenset()

    def scene(self) -> ReferenceScene:
        return scene(flat_world(self.places), no_gaze=self.no_gaze, no_point=self.no_point)

    def motions(self) -> Motions:
        return body(
            flat_world(self.places),
            [reference.target for reference in self.references],
            head=lambda since, target: self.head[since, target],
            arm=lambda since, target: self.arm[since, target],
            arm_for=self.arm_for,
            out_of_reach=tuple(self.unable),
            refused=tuple(self.refused),
        )


class Choice(NamedTuple):
    """A pair: the numbers of gesture and option, R, and what it costs whatever the posture. rank: decision B13.

    by_look: number of the objects that its words may mean, and that only the look rules out (decision 0109).
    """

    gesture: int
    option: int
    reliability: Fraction
    fixed: int
    by_look: int
    rank: tuple[bool, Fraction, int, int]


def allowed(problem: Problem, reference: Reference) -> list[Choice]:
    """The pairs that may be chosen: those that reach the minimum, or else the most reliable.

    Of those with one gesture, only the ones that leave the fewest objects to the look alone.
    """
    target, places = reference.target, problem.places
    others = set(places) - {target}
    gazed = {id for id in others if dist(places[id], places[target]) < 0.2}
    pointed = {id for id in others if dist(places[id], places[target]) < 0.1}
    can_point = target not in problem.unable and not problem.no_point
    pairs = []
    for gesture, (number, option) in product(range(4), enumerate(reference.options)):
        if (gesture in LOOKS and problem.no_gaze) or (gesture in POINTS and not can_point):
            continue
        if option.deictic and gesture not in POINTS:
            continue
        r_phrase = R_PHRASE if option.text else Fraction(0)
        r_gesture = R_GESTURE[gesture]
        r = r_gesture + r_phrase if problem.channel == "sum" else 1 - (1 - r_gesture) * (1 - r_phrase)
        if r == 0:
            continue
        left = set(others)
        if gesture in LOOKS:
            left &= gazed
        if gesture in POINTS:
            left &= pointed
        if option.text and not option.deictic:
            left &= set(option.distractors)
        by_look = len(others.intersection(option.distractors) - gazed) if option.text and gesture in (1, 2) else 0
        reliability = 1 / (len(left) + 1 / r)
        fixed = (WORD * int(option.cost) if option.text else 0) + (WAIT if gesture in WAITS else 0)
        rank = (not (option.deictic and gesture in POINTS), -reliability, gesture, number)
        pairs.append(Choice(gesture, number, reliability, fixed, by_look, rank))
    good = [pair for pair in pairs if pair.reliability >= Fraction(str(reference.minimum_reliability))]
    most = max((pair.reliability for pair in pairs), default=0)
    good = good or [pair for pair in pairs if pair.reliability == most]
    return [
        pair
        for pair in good
        if not any(other.gesture == pair.gesture and other.by_look < pair.by_look for other in good)
    ]


Best = tuple[int, tuple[tuple[bool, Fraction, int, int], ...], tuple[tuple[int, int], ...]]
"""Cost in 1/600 s, ranks, and (gesture, option) of each reference."""


def optimum(problem: Problem) -> Best | None:
    """Over every sequence of pairs there is. None if the body can make none of them."""
    return _least(problem, product(*(allowed(problem, reference) for reference in problem.references)))


def optimum_by_gestures(problem: Problem) -> Best | None:
    """Over every sequence of gestures, each with its best phrases.

    Once the gestures are given so is every posture, hence every motion: phrases add only costs of their own, and
    each can be the best by itself. That leaves 4 instead of 4 x 5 possibilities a reference.
    """
    tables = []
    for reference in problem.references:
        best: dict[int, Choice] = {}
        for pair in sorted(allowed(problem, reference), key=lambda pair: (pair.fixed, pair.rank)):
            best.setdefault(pair.gesture, pair)
        tables.append(list(best.values()))
    return _least(problem, product(*tables))


def _least(problem: Problem, sequences: Iterable[Sequence[Choice]]) -> Best | None:
    targets = [reference.target for reference in problem.references]
    alone = [reference.id in problem.apart for reference in problem.references]
    arms = [problem.arm_for(target) for target in targets]

    @cache
    def motion(gestures: tuple[int, ...]) -> int | None:
        """In 1/600 s; None where the arm cannot."""
        total = 0
        for number, (gesture, target, arm) in enumerate(zip(gestures, targets, arms, strict=True)):
            if gesture in LOOKS:
                looked = [each in LOOKS for each in gestures[:number]]
                total += HEAD * problem.head[start(looked, number), target]
            if gesture in POINTS:
                pointed = [
                    each in POINTS and other == arm for each, other in zip(gestures[:number], arms, strict=False)
                ]
                since = start(pointed, number)
                if (since, target) in problem.refused:
                    return None
                total += ARM * problem.arm[since, target]
        return total

    def start(moved: Sequence[bool], number: int) -> str:
        """Where a part is before a reference. moved: for each earlier one, whether it moved that part."""
        if not any(moved):
            return CURRENT_POSE
        return targets[number - 1] if moved[-1] and not alone[number] else AT_REST

    def complete() -> Iterator[Best]:
        least: int | None = None
        for sequence in sequences:
            moved = motion(tuple(pair.gesture for pair in sequence))
            if moved is None:
                continue
            cost = moved + sum(pair.fixed for pair in sequence)
            if least is None or cost <= least:
                least = cost
                yield cost, tuple(pair.rank for pair in sequence), tuple(pair[:2] for pair in sequence)

    return min(complete(), default=None)
