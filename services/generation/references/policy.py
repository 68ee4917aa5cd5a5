"""The reference policy: for each object reference the cheapest pair of gesture and phrase that is understood.

Thesis 3.3.2. Cost depends on where the head and the arms are, and every gesture moves them, so a sequence of
references is chosen as a whole: a dynamic program over what head and arms point at. Reliability does not depend on
posture, so pairs that are not understood are left out first, and per gesture only the best phrase can win.

Before each reference head and arms are on the target of the one before, or at rest (decision 0024). A walk over these
postures without costs says which motions the program will need: it meets every posture that the program meets, as
long as the body is asked until there is nothing left to ask (`unasked`).
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import NamedTuple

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.behaviors import Constraint, FragmentBehavior, Hand, Reference, Speech, Wait
from engage_hri.schemas.faults import Fault, RunFailed
from engage_hri.schemas.fragments import GestureChoice, PairConsidered, ReferenceChoice
from engage_hri.schemas.references import BLOCK_ITSELF, SyncRef
from engage_hri.schemas.text import word_count
from engage_hri.schemas.units import Seconds
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.references.motions import (
    AT_REST,
    CURRENT_POSE,
    Motions,
    Way,
    arm_of,
    distinct,
    hand_of,
)
from engage_hri.services.generation.references.pairs import (
    POINT,
    ROUNDING,
    Pair,
    ReferenceScene,
    Table,
    considered,
    deictic_warnings,
    refusal,
    shown,
    speaking,
)


class HeadAndArms(Struct, frozen=True):
    """Targets of the head and of each arm: that of a reference, the person glanced at, CURRENT_POSE or AT_REST."""

    head: str = CURRENT_POSE
    arms: tuple[tuple[str, str], ...] = ()
    """(arm, target) of the arms that have moved, by arm."""

    def arm(self, arm: str) -> str:
        for each, target in self.arms:
            if each == arm:
                return target
        return CURRENT_POSE

    def afterwards(self, target: str, arm: str, motions: Motions) -> Mapping[GestureChoice, "HeadAndArms"]:
        """The postures that the gestures at `target` leave: what one does not use goes home. arm: that points."""
        home = self.home_again(motions)
        looking = HeadAndArms(target, home.arms)
        moved = tuple(sorted([each for each in home.arms if each[0] != arm] + [(arm, target)]))
        pointing = HeadAndArms(motions.glance or target, moved)
        return {
            "none": home,
            "gaze": looking,
            "directed_gaze": looking,
            "directed_gaze_with_pointing": pointing,
        }

    def home_again(self, motions: Motions) -> "HeadAndArms":
        """The posture once all is over that a reference has moved. A glance lasts until the next look."""
        moved = self.head not in (CURRENT_POSE, motions.glance) and not motions.looks_last
        return HeadAndArms(AT_REST if moved else self.head, tuple([(arm, AT_REST) for arm, _ in self.arms]))


def references_apart(
    order: Sequence[FragmentBehavior], constraints: Sequence[Constraint], most_words: float
) -> frozenset[str]:
    """Ids of the references before which head and arms go home, since too much lies between (decision 0024).

    Too much are more than `most_words` words of plain speech, a `Wait`, or a clock time: how long that leaves an arm
    in the air nobody knows. order: of the fragment's behaviors.
    """
    apart = set(_by_the_clock(order, constraints))
    words, waits = 0.0, False
    for behavior in order:
        if isinstance(behavior, Reference):
            if waits or words > most_words:
                apart.add(behavior.id)
            words, waits = 0.0, False
        elif isinstance(behavior, Speech):
            words += word_count(behavior.text)
        elif isinstance(behavior, Wait):
            waits = True
    return frozenset(apart)


def _by_the_clock(order: Sequence[FragmentBehavior], constraints: Sequence[Constraint]) -> Iterator[str]:
    """Ids of the references that something ties to a clock time, or to another block."""
    references = {behavior.id for behavior in order if isinstance(behavior, Reference)}
    tied: list[Collection[str]] = [(f"{each.id}:start", timing.ref) for each in order for timing in each.timing]
    tied += [(operator.ref, *operator.syncs) for each in constraints for operator in each.operators]
    for texts in tied:
        refs = [SyncRef.parse(text) for text in texts if text]
        if any(ref.block or ref.behavior in ("", BLOCK_ITSELF) for ref in refs):
            yield from (ref.behavior for ref in refs if ref.behavior in references)


EXPECTED_DELAY: Seconds = 0.3
"""Expected delay of directed gaze, E[delay]: the mean of Table 2.1. Its cost is set by `generation.wait_weight`.
Decision B7."""
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


class Made(NamedTuple):
    """A gesture from some posture. hindrance: why the body cannot make it; empty: it can. costs: what adds up."""

    hindrance: str
    costs: tuple[Seconds, ...]

    def cost(self, words: Seconds) -> Seconds:
        """Cost with a phrase that costs `words`."""
        for each in self.costs:  # `sum` rounds in another way from Python 3.12 on
            words += each
        return words


class Movements:
    """Cost and obstacles of each gesture at a target, by posture: each is worked out once.

    arm: the one that points at it.
    """

    def __init__(self, target: str, motions: Motions, config: GenerationConfig) -> None:
        self._target = target
        self._motions = motions
        self._config = config
        self.arm = arm_of(motions.known[Way("arm", CURRENT_POSE, target)])
        self._made: dict[tuple[str, str], Mapping[GestureChoice, Made]] = {}

    def ways(self, posture: HeadAndArms) -> tuple[Way, Way]:
        return Way("head", posture.head, self._target), Way("arm", posture.arm(self.arm), self._target)

    def made(self, posture: HeadAndArms) -> Mapping[GestureChoice, Made]:
        """Each gesture from a posture."""
        start = posture.head, posture.arm(self.arm)
        if (known := self._made.get(start)) is None:
            known = self._made[start] = self._from(*start)
        return known

    def cost(self, pair: Pair, posture: HeadAndArms) -> Seconds:
        """Cost C(j, s) in seconds, from `posture`: words, head, wait for shared gaze (decision B7), arm."""
        return self.made(posture)[pair.gesture].cost(speaking(pair, self._config))

    def _from(self, head: str, arm: str) -> Mapping[GestureChoice, Made]:
        config = self._config
        gaze = self._motions.known[Way("head", head, self._target)]
        point = self._motions.known[Way("arm", arm, self._target)]
        no_gaze = refusal("look from there", gaze)
        look, wait = config.seconds_per_head_degree * gaze.head_degrees, config.wait_weight * EXPECTED_DELAY
        swing = config.seconds_per_arm_degree * point.arm_degrees
        return {
            "none": Made("", ()),
            "gaze": Made(no_gaze, (look,)),
            "directed_gaze": Made(no_gaze, (look, wait)),
            POINT: Made(no_gaze or refusal("point from there", point), (look, wait, swing)),
        }


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
            missing = [way for way in movements.ways(posture) if way not in motions.known]
            is_known[posture] = not missing
            wanted |= dict.fromkeys(missing)
        onward: dict[HeadAndArms, None] = {}
        level = 0
        while not onward and (possible := table.candidates(level)):
            level += 1
            for posture in postures:
                after = posture.afterwards(reference.target, movements.arm, motions)
                made = movements.made(posture) if is_known[posture] else None
                for gesture in possible:
                    if made is None or not made[gesture].hindrance:
                        onward[after[gesture]] = None
        postures = onward or postures
    return tuple(wanted)


def cheapest(tables: Sequence[Table], motions: Motions, config: GenerationConfig, apart: Collection[str]) -> Sequel:
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
            onward = _continued(ways, list(possible.values()), movements, table.reference.target, motions, config)
            level += 1
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
    ways: Sequence[Sequel],
    pairs: Collection[Pair],
    movements: Movements,
    target: str,
    motions: Motions,
    config: GenerationConfig,
) -> list[Sequel]:
    """The best way to each posture that one of `pairs` leads to from one of `ways`; none where the body cannot."""
    best: dict[HeadAndArms, Sequel] = {}
    offered = [(pair, pair.preference, speaking(pair, config)) for pair in pairs]
    for way in ways:
        after, all_made = way.posture.afterwards(target, movements.arm, motions), movements.made(way.posture)
        for pair, preference, words in offered:
            made = all_made[pair.gesture]
            if made.hindrance:
                continue
            seconds = way.cost + made.cost(words)
            reached, least = after[pair.gesture], round(seconds, ROUNDING)
            if (other := best.get(reached)) is not None and other.rank[0] < least:
                continue
            rank = (least, (*way.rank[1], preference))
            # No two ways have the same rank: a pair's preference names its gesture and its phrase.
            if other is None or rank < other.rank:
                best[reached] = Sequel(seconds, rank, (*way.pairs, pair), (*way.postures, reached))
    return list(best.values())


FROM_NOWHERE = "cannot be done from where the references before it leave the body"


class Choices(Struct, frozen=True):
    """The choices for a fragment's references. hands: the one that points, by reference, if the body says which."""

    choices: tuple[ReferenceChoice, ...] = ()
    warnings: tuple[str, ...] = ()
    hands: dict[str, Hand] = {}


class Unreferable(RunFailed):
    """A reference cannot be made at all. choices: the tables of all references; of this one nothing is chosen."""

    def __init__(self, fault: Fault, choices: tuple[ReferenceChoice, ...]) -> None:
        super().__init__(fault)
        self.choices = choices


def choose(
    references: Sequence[Reference],
    scene: ReferenceScene,
    motions: Motions,
    config: GenerationConfig,
    apart: Collection[str] = (),
) -> Choices:
    """Choose the pairs of least total cost for `references` in this order, each with the table it was chosen from.

    motions: all that may be needed. apart: ids of the references before which head and arms go home (see `posture`).
    A reference with no pair that reaches its minimum gets one of its most reliable, with a warning (decision B10).
    Raises Unreferable where a reference cannot be made at all.
    """
    return choice(weigh(references, scene, motions, config), scene, motions, config, apart)


def weigh(
    references: Sequence[Reference], scene: ReferenceScene, motions: Motions, config: GenerationConfig
) -> list[Table]:
    """The tables of all pairs of each reference. motions: from where the body is."""
    seems = shown(distinct([reference.target for reference in references]), scene, motions)
    return [
        Table(reference, considered(reference, seems[reference.target], scene, motions, config), config)
        for reference in references
    ]


def choice(
    tables: Sequence[Table],
    scene: ReferenceScene,
    motions: Motions,
    config: GenerationConfig,
    apart: Collection[str] = (),
) -> Choices:
    """Choose as `choose` does, with tables from `weigh`."""
    best = cheapest(tables, motions, config, apart)
    choices = tuple(
        _explain(table, pair, posture, Movements(table.reference.target, motions, config))
        for table, pair, posture in zip(tables, best.pairs, best.postures, strict=False)
    )
    warnings = deictic_warnings([table.reference for table in tables], scene)
    hands: dict[str, Hand] = {}
    for table, pair, made in zip(tables, best.pairs, choices, strict=True):
        if pair is None:
            raise Unreferable(_unreferable(table), choices)
        if pair.is_short:
            warnings.append(
                f"{table.reference.id}: nothing reaches the minimum reliability {table.minimum:g}; chose "
                f"{_pair_name(pair)} with R {pair.reliability:.4g}"
            )
        if pair.by_look:
            warnings.append(
                f"{table.reference.id}: {pair.option.text!r} may mean {len(pair.by_look) + 1} objects, and the look "
                "alone tells which (a higher certainty, or minimum reliability, asks for a point, if one is possible)"
            )
        if made.gesture == POINT and (hand := hand_of(motions.known[Way("arm", CURRENT_POSE, made.target)])):
            hands[made.reference] = hand
    return Choices(choices, tuple(warnings), hands)


def _unreferable(table: Table) -> Fault:
    reasons = dict.fromkeys(f"{_pair_name(pair)}: {pair.ruled_out or FROM_NOWHERE}" for pair in table.pairs)
    reference = table.reference
    return Fault(reason=f"no way to refer to {reference.target}: {'; '.join(reasons)}", where=reference.id)


def _explain(table: Table, chosen: Pair | None, posture: HeadAndArms, movements: Movements) -> ReferenceChoice:
    least = movements.cost(chosen, posture) if chosen else 0.0
    minimum, made = table.minimum, movements.made(posture)
    rows = []
    for pair in table.pairs:
        seconds, short = movements.cost(pair, posture), pair.is_short
        hindrance = pair.ruled_out or made[pair.gesture].hindrance
        if pair is chosen:
            reason = "most reliable: nothing reaches the minimum" if short else "least cost"
        elif hindrance:
            reason = hindrance
        elif short:
            reason = f"R {pair.reliability:.4g} below {minimum:g}"
        elif len(pair.by_look) > len(table.candidates(0)[pair.gesture].by_look):
            reason = f"the look alone rules out {len(pair.by_look)}"
        elif round(seconds - least, ROUNDING) == 0:
            reason = "same cost, less preferred"
        elif seconds > least:
            reason = f"dearer by {seconds - least:.3g} s"
        else:
            reason = "cheaper here, but dearer over the sequence"
        rows.append(
            PairConsidered(
                gesture=pair.gesture,
                phrase=pair.option.text,
                distractors=tuple(sorted(pair.distractors)),
                channel=pair.channel,
                reliability=pair.reliability,
                minimum=minimum,
                cost=seconds,
                feasible=not hindrance and not short,
                chosen=pair is chosen,
                reason=reason,
            )
        )
    return ReferenceChoice(
        reference=table.reference.id,
        target=table.reference.target,
        gesture=chosen.gesture if chosen else "none",
        phrase=chosen.option.text if chosen else "",
        reliability=chosen.reliability if chosen else 0.0,
        cost=least,
        pairs=tuple(rows),
    )


def _pair_name(pair: Pair) -> str:
    said = repr(pair.option.text) if pair.option.text else "no phrase"
    return f"{'no gesture' if pair.gesture == 'none' else pair.gesture.replace('_', ' ')} with {said}"
