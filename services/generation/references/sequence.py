"""The cheapest sequence of pairs for some references: a dynamic program over what head and arms are on. Pure.

The same walk over the postures, without costs, says which motions the program will need: it meets every posture that
the program meets, as long as the body is asked until there is nothing left to ask.
"""

from collections.abc import Collection, Sequence

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.fragments import GestureChoice
from engage_hri.schemas.units import Seconds
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.references.motions import CURRENT_POSE, Motions, Way, arm_of
from engage_hri.services.generation.references.pairs import DIRECTED, POINT, ROUNDING, Pair, Table, refusal, speaking
from engage_hri.services.generation.references.posture import HeadAndArms
from engage_hri.services.runtime.steps import Steps

Rank = tuple[float, tuple[tuple[bool, float, int, int], ...]]
"""Sort key of a sequence: the rounded cost and then the preferences."""


class Sequel(Struct, frozen=True):
    """The best sequence of pairs that leads to a posture.

    pairs: None for a reference that cannot be made. postures: before each pair, and after the last.
    """

    cost: Seconds
    rank: Rank
    pairs: tuple[Pair | None, ...]
    postures: tuple[HeadAndArms, ...]

    @property
    def posture(self) -> HeadAndArms:
        return self.postures[-1]


class Movements:
    """Cost and obstacles of each gesture at a target, by posture: each way of head and arm is looked up once.

    arm: the one that points at it.
    """

    def __init__(self, target: str, motions: Motions, config: GenerationConfig) -> None:
        self._target = target
        self._motions = motions
        self._config = config
        self.arm = arm_of(motions.point(CURRENT_POSE, target))
        self._waiting = config.wait_weight * config.expected_delay
        self._heads: dict[str, tuple[str, Seconds]] = {}
        self._arms: dict[str, tuple[str, Seconds]] = {}

    def ways(self, posture: HeadAndArms) -> tuple[Way, Way]:
        return Way("head", posture.head, self._target), Way("arm", posture.arm(self.arm), self._target)

    def hindrance(self, gesture: GestureChoice, posture: HeadAndArms) -> str:
        """Reason why the body cannot make `gesture` from `posture`; empty if it can."""
        if gesture == "none":
            return ""
        no_gaze, _ = self._head(posture)
        return no_gaze or (self._point(posture)[0] if gesture == POINT else "")

    def cost(self, pair: Pair, posture: HeadAndArms) -> Seconds:
        """Cost C(j, s) in seconds, from `posture`: head, wait for shared gaze (decision B7), arm, words."""
        seconds = speaking(pair, self._config)
        if pair.gesture != "none":
            seconds += self._head(posture)[1]
        if pair.gesture in DIRECTED:
            seconds += self._waiting
        if pair.gesture == POINT:
            seconds += self._point(posture)[1]
        return seconds

    def _head(self, posture: HeadAndArms) -> tuple[str, Seconds]:
        """Reason why the body cannot look from there, and what the look costs."""
        if (known := self._heads.get(posture.head)) is None:
            gaze = self._motions.gaze(posture.head, self._target)
            known = refusal("look from there", gaze), self._config.head_cost(gaze.head_degrees)
            self._heads[posture.head] = known
        return known

    def _point(self, posture: HeadAndArms) -> tuple[str, Seconds]:
        since = posture.arm(self.arm)
        if (known := self._arms.get(since)) is None:
            point = self._motions.point(since, self._target)
            known = refusal("point from there", point), self._config.arm_cost(point.arm_degrees)
            self._arms[since] = known
        return known


def unasked(
    tables: Sequence[Table], motions: Motions, config: GenerationConfig, apart: Collection[str]
) -> tuple[Way, ...]:
    """Ways that `cheapest` may need, and of which the body has not been asked. A way not known counts as possible."""
    wanted: dict[Way, None] = {}
    postures = {HeadAndArms(): None}
    for table in tables:
        reference = table.reference
        if reference.id in apart:
            postures = {posture.home_again(motions): None for posture in postures}
        movements = Movements(reference.target, motions, config)
        is_known = {}
        for posture in postures:
            missing = [way for way in movements.ways(posture) if not motions.has(way)]
            is_known[posture] = not missing
            wanted |= dict.fromkeys(missing)
        onward: dict[HeadAndArms, None] = {}
        level = 0
        while not onward and (possible := table.candidates(level)):
            level += 1
            for posture in postures:
                after = posture.afterwards(reference.target, movements.arm, motions)
                for gesture in possible:
                    if not (is_known[posture] and movements.hindrance(gesture, posture)):
                        onward[after[gesture]] = None
        postures = onward or postures
    return tuple(wanted)


def cheapest(
    tables: Sequence[Table], motions: Motions, config: GenerationConfig, apart: Collection[str]
) -> Steps[Sequel]:
    """The sequence of pairs with the least total cost, each from the posture before it (decision B11).

    A reference that cannot be made gets no pair.
    """
    ways = [Sequel(0.0, (0.0, ()), (), (HeadAndArms(),))]
    for table in tables:
        if table.reference.id in apart:
            ways = _gone_home(ways, motions)
        movements = Movements(table.reference.target, motions, config)
        onward: list[Sequel] = []
        level = 0
        while not onward and (possible := table.candidates(level)):
            onward = _continued(ways, list(possible.values()), movements, table.reference.target, motions)
            level += 1
        yield 4 * len(ways) * max(1, level)
        ways = onward or [
            replace(way, pairs=(*way.pairs, None), postures=(*way.postures, way.posture)) for way in ways
        ]
    return min(ways, key=lambda way: way.rank)


def _gone_home(ways: Sequence[Sequel], motions: Motions) -> list[Sequel]:
    """The ways with head and arms at rest in the end; of those that thereby become one posture, the best."""
    best: dict[HeadAndArms, Sequel] = {}
    for way in ways:
        posture = way.posture.home_again(motions)
        if posture not in best or way.rank < best[posture].rank:
            best[posture] = replace(way, postures=(*way.postures[:-1], posture))
    return list(best.values())


def _continued(
    ways: Sequence[Sequel], pairs: Collection[Pair], movements: Movements, target: str, motions: Motions
) -> list[Sequel]:
    """The best way to each posture that one of `pairs` leads to from one of `ways`; none where the body cannot."""
    best: dict[HeadAndArms, Sequel] = {}
    preferences = [(pair, pair.preference) for pair in pairs]
    for way in ways:
        posture = way.posture
        after = posture.afterwards(target, movements.arm, motions)
        for pair, preference in preferences:
            if movements.hindrance(pair.gesture, posture):
                continue
            seconds = way.cost + movements.cost(pair, posture)
            reached, least = after[pair.gesture], round(seconds, ROUNDING)
            if (other := best.get(reached)) is not None and other.rank[0] < least:
                continue
            rank = (least, (*way.rank[1], preference))
            # No two ways have the same rank: a pair's preference names its gesture and its phrase.
            if other is None or rank < other.rank:
                best[reached] = Sequel(seconds, rank, (*way.pairs, pair), (*way.postures, reached))
    return list(best.values())
