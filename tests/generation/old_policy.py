"""The reference policy as it was before it asked only for what it needs: a slow oracle.

It has one rule more than then: that of decision 0109. It needs every motion from every pose that an earlier reference
may leave, each fully estimated (`all_motions`).
"""

from collections.abc import Collection, Mapping, Sequence
from typing import get_args

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.behaviors import Hand, Reference, SpeechOption
from engage_hri.schemas.body import Estimate
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.fragments import GestureChoice, PairConsidered, ReferenceChoice
from engage_hri.schemas.units import Probability, Seconds
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.references.motions import AT_REST, CURRENT_POSE, Motions, arm_of, hand_of
from engage_hri.services.generation.references.pairs import ReferenceScene, channel_reliability, in_zone, reliability
from engage_hri.services.generation.references.policy import EXPECTED_DELAY, Choices, Unreferable
from tests.generation.tables import in_gaze_cone, in_pointing_cylinder

GESTURES: tuple[GestureChoice, ...] = get_args(GestureChoice)
"""All gestures, the set J of the thesis, from fewer movements to more."""
ROUNDING = 9
"""Decimals of costs and reliabilities that count: sums of the same numbers in another order are equal."""
FROM_NOWHERE = "cannot be done from where the references before it leave the body"


class Pair(Struct, frozen=True, kw_only=True):
    """A gesture with a phrase, as far as posture does not matter.

    order: the place of the phrase among the reference's options. ruled_out: why it cannot be performed, or empty.
    """

    gesture: GestureChoice
    order: int
    option: SpeechOption
    distractors: frozenset[str]
    channel: Probability
    reliability: Probability
    ruled_out: str = ""
    by_look: int = 0

    @property
    def preference(self) -> tuple[bool, float, int, int]:
        """Sort key among pairs of equal cost: the least wins (decision B13)."""
        points = self.gesture == "directed_gaze_with_pointing"
        return (
            not (points and self.option.deictic), -round(self.reliability, ROUNDING),
            GESTURES.index(self.gesture), self.order,
        )  # fmt: skip


class HeadAndArms(Struct, frozen=True):
    """Targets of the head and of each arm."""

    head: str = CURRENT_POSE
    arms: tuple[tuple[str, str], ...] = ()

    def arm(self, arm: str) -> str:
        return dict(self.arms).get(arm, CURRENT_POSE)

    def after(self, gesture: GestureChoice, target: str, motions: Motions) -> "HeadAndArms":
        """The posture that a gesture at `target` leaves: what it does not use goes home."""
        if gesture == "none":
            return self.home_again(motions)
        arms = dict(self.home_again(motions).arms)
        if gesture != "directed_gaze_with_pointing":
            return HeadAndArms(target, tuple(arms.items()))
        arms[arm_of(motions.known["arm", CURRENT_POSE, target])] = target
        return HeadAndArms(motions.glance or target, tuple(sorted(arms.items())))

    def home_again(self, motions: Motions) -> "HeadAndArms":
        """The posture once all is over that a reference has moved."""
        moved = self.head not in (CURRENT_POSE, motions.glance) and not motions.looks_last
        return HeadAndArms(AT_REST if moved else self.head, tuple((arm, AT_REST) for arm, _ in self.arms))


class _Way(Struct, frozen=True):
    """The best sequence of pairs that leads to a posture.

    rank: sort key, the rounded cost and then the preferences. pairs: None for a reference that cannot be made.
    postures: before each pair, and after the last.
    """

    cost: Seconds
    rank: tuple[float, tuple[tuple[bool, float, int, int], ...]]
    pairs: tuple[Pair | None, ...]
    postures: tuple[HeadAndArms, ...]

    @property
    def posture(self) -> HeadAndArms:
        return self.postures[-1]


def choose(
    references: Sequence[Reference],
    scene: ReferenceScene,
    motions: Motions,
    config: GenerationConfig,
    apart: Collection[str] = (),
) -> Choices:
    """Choose the pairs of least total cost for `references` in this order, each with the table it was chosen from.

    apart: ids of the references before which head and arms go home (see `posture`).
    A reference with no pair that reaches its minimum gets one of its most reliable, with a warning (decision B10).
    Raises Unreferable where a reference cannot be made at all.
    """
    warnings: list[str] = []
    for reference in references:
        warnings += _deictic_warnings(reference, scene)
    tables = [considered(reference, scene, motions, config) for reference in references]
    best = _cheapest_way(references, tables, motions, config, apart)
    choices = tuple(
        _explain(reference, table, pair, posture, motions, config)
        for reference, table, pair, posture in zip(references, tables, best.pairs, best.postures, strict=False)
    )
    hands: dict[str, Hand] = {}
    for reference, table, pair, choice in zip(references, tables, best.pairs, choices, strict=True):
        if pair is None:
            raise Unreferable(_unreferable(reference, table), choices)
        minimum = _minimum(reference, config)
        if _below(pair.reliability, minimum):
            warnings.append(
                f"{reference.id}: nothing reaches the minimum reliability {minimum:g}; chose "
                f"{_pair_name(pair.gesture, pair.option.text)} with R {pair.reliability:.4g}"
            )
        if pair.by_look:
            warnings.append(
                f"{reference.id}: {pair.option.text!r} may mean {pair.by_look + 1} objects, and the look alone tells "
                "which (a higher certainty, or minimum reliability, asks for a point, if one is possible)"
            )
        if choice.gesture == "directed_gaze_with_pointing" and (
            hand := hand_of(motions.known["arm", CURRENT_POSE, choice.target])
        ):
            hands[choice.reference] = hand
    return Choices(choices, tuple(warnings), hands)


def _unreferable(reference: Reference, table: Sequence[Pair]) -> Fault:
    reasons = dict.fromkeys(
        f"{_pair_name(pair.gesture, pair.option.text)}: {pair.ruled_out or FROM_NOWHERE}" for pair in table
    )
    return Fault(reason=f"no way to refer to {reference.target}: {'; '.join(reasons)}", where=reference.id)


def considered(
    reference: Reference, scene: ReferenceScene, motions: Motions, config: GenerationConfig
) -> tuple[Pair, ...]:
    """The table of a reference: every pair of gesture and phrase (J x S) with its distractors and reliability."""
    target = reference.target
    universe = scene.universe - {target}
    gaze, point = motions.known["head", CURRENT_POSE, target], motions.known["arm", CURRENT_POSE, target]
    gazed, pointed = universe, universe
    if gaze.ray is not None:
        gazed = in_gaze_cone(gaze.ray, scene.half_angle, scene.layout) - {target}
    if point.ray is not None:
        pointed = in_pointing_cylinder(point.ray, scene.pointing_radius, scene.layout) - {target}
    no_gaze, no_point = _obstacles(target, scene, motions)
    pairs = []
    for gesture in GESTURES:
        points = gesture == "directed_gaze_with_pointing"
        obstacle = "" if gesture == "none" else no_gaze or (no_point if points else "")
        shown = universe if gesture == "none" else gazed & pointed if points else gazed
        for order, option in enumerate(reference.options or ()):
            said = frozenset(option.distractors) & universe if option.text and not option.deictic else universe
            channel = channel_reliability(gesture, option.text, config)
            distractors = shown & said
            ruled_out = obstacle
            if option.deictic and not points:
                ruled_out = "a deictic phrase needs a point"
            elif channel == 0:
                ruled_out = "neither gesture nor phrase"
            pairs.append(
                Pair(
                    gesture=gesture,
                    order=order,
                    option=option,
                    distractors=distractors,
                    channel=channel,
                    reliability=reliability(len(distractors), channel),
                    ruled_out=ruled_out,
                    by_look=len(said - gazed) if option.text and not points and gesture != "none" else 0,
                )
            )
    return tuple(pairs)


def cost(pair: Pair, target: str, posture: HeadAndArms, motions: Motions, config: GenerationConfig) -> Seconds:
    """Cost C(j, s) in seconds, from `posture`: head, wait for shared gaze (decision B7), arm, words."""
    seconds = _speaking(pair, config)
    if pair.gesture != "none":
        seconds += config.seconds_per_head_degree * motions.known["head", posture.head, target].head_degrees
    if pair.gesture in ("directed_gaze", "directed_gaze_with_pointing"):
        seconds += config.wait_weight * EXPECTED_DELAY
    if pair.gesture == "directed_gaze_with_pointing":
        arm = arm_of(motions.known["arm", CURRENT_POSE, target])
        seconds += config.seconds_per_arm_degree * motions.known["arm", posture.arm(arm), target].arm_degrees
    return seconds


def _speaking(pair: Pair, config: GenerationConfig) -> Seconds:
    return config.seconds_per_word * pair.option.cost if pair.option.text else 0.0


def _obstacles(target: str, scene: ReferenceScene, motions: Motions) -> tuple[str, str]:
    """Reasons why the robot cannot look, and cannot point, at `target`; each empty if it can (decision B9)."""
    gaze, point = motions.known["head", CURRENT_POSE, target], motions.known["arm", CURRENT_POSE, target]
    no_gaze = scene.no_gaze or _refusal("look", gaze)
    no_point = scene.no_point or _refusal("point", point)
    entity = scene.world.entity(target)
    if not no_point and entity is not None and in_zone(entity.position, scene.zones):
        no_point = "cannot point: in a no-point zone"
    return no_gaze, no_point


def _hindrance(gesture: GestureChoice, target: str, posture: HeadAndArms, motions: Motions) -> str:
    """Reason why the body cannot make `gesture` from `posture`; empty if it can."""
    if gesture == "none":
        return ""
    no_gaze = _refusal("look from there", motions.known["head", posture.head, target])
    if no_gaze or gesture != "directed_gaze_with_pointing":
        return no_gaze
    arm = arm_of(motions.known["arm", CURRENT_POSE, target])
    return _refusal("point from there", motions.known["arm", posture.arm(arm), target])


def _refusal(verb: str, motion: Estimate) -> str:
    if motion.feasible:
        return ""
    return f"cannot {verb}: {motion.fault.reason if motion.fault else 'the body refuses'}"


def _candidates(
    possible: Sequence[Pair], minimum: Probability, config: GenerationConfig
) -> Mapping[GestureChoice, Pair]:
    """The pair of each gesture that may win, whatever the posture: the one with the best phrase.

    Only pairs that reach `minimum` count or, if there are none, the most reliable ones (decision B10).
    """
    good = [pair for pair in possible if not _below(pair.reliability, minimum)]
    if not good:
        most = max(round(pair.reliability, ROUNDING) for pair in possible)
        good = [pair for pair in possible if round(pair.reliability, ROUNDING) == most]
    best: dict[GestureChoice, Pair] = {}
    for pair in sorted(
        good, key=lambda pair: (pair.by_look, round(_speaking(pair, config), ROUNDING), pair.preference)
    ):
        best.setdefault(pair.gesture, pair)
    return best


def _cheapest_way(
    references: Sequence[Reference],
    tables: Sequence[tuple[Pair, ...]],
    motions: Motions,
    config: GenerationConfig,
    apart: Collection[str],
) -> _Way:
    """The sequence of pairs with the least total cost, each from the posture before it (decision B11).

    A reference that cannot be made gets no pair.
    """
    ways = [_Way(0.0, (0.0, ()), (), (HeadAndArms(),))]
    for reference, table in zip(references, tables, strict=True):
        if reference.id in apart:
            ways = _gone_home(ways, motions)
        possible = [pair for pair in table if not pair.ruled_out]
        onward: list[_Way] = []
        while possible and not onward:
            candidates = _candidates(possible, _minimum(reference, config), config)
            onward = _continued(ways, candidates.values(), reference.target, motions, config)
            possible = [pair for pair in possible if pair.gesture not in candidates]
        ways = onward or [
            replace(way, pairs=(*way.pairs, None), postures=(*way.postures, way.posture)) for way in ways
        ]
    return min(ways, key=lambda way: way.rank)


def _gone_home(ways: Sequence[_Way], motions: Motions) -> list[_Way]:
    """The ways with head and arms at rest in the end; of those that thereby become one posture, the best."""
    best: dict[HeadAndArms, _Way] = {}
    for way in ways:
        posture = way.posture.home_again(motions)
        if posture not in best or way.rank < best[posture].rank:
            best[posture] = replace(way, postures=(*way.postures[:-1], posture))
    return list(best.values())


def _continued(
    ways: Sequence[_Way], pairs: Collection[Pair], target: str, motions: Motions, config: GenerationConfig
) -> list[_Way]:
    """The best way to each posture that one of `pairs` leads to from one of `ways`; none where the body cannot."""
    best: dict[HeadAndArms, _Way] = {}
    preferences = [(pair, pair.preference) for pair in pairs]
    for way in ways:
        for pair, preference in preferences:
            if _hindrance(pair.gesture, target, way.posture, motions):
                continue
            seconds = way.cost + cost(pair, target, way.posture, motions, config)
            rank = (round(seconds, ROUNDING), (*way.rank[1], preference))
            reached = way.posture.after(pair.gesture, target, motions)
            # No two ways have the same rank: a pair's preference names its gesture and its phrase.
            if reached not in best or rank < best[reached].rank:
                best[reached] = _Way(seconds, rank, (*way.pairs, pair), (*way.postures, reached))
    return list(best.values())


def _explain(
    reference: Reference,
    table: tuple[Pair, ...],
    chosen: Pair | None,
    posture: HeadAndArms,
    motions: Motions,
    config: GenerationConfig,
) -> ReferenceChoice:
    least = cost(chosen, reference.target, posture, motions, config) if chosen else 0.0
    minimum = _minimum(reference, config)
    fallback = chosen is not None and _below(chosen.reliability, minimum)
    rows = []
    for pair in table:
        seconds = cost(pair, reference.target, posture, motions, config)
        short = _below(pair.reliability, minimum)
        hindrance = pair.ruled_out or _hindrance(pair.gesture, reference.target, posture, motions)
        if pair is chosen:
            reason = "most reliable: nothing reaches the minimum" if fallback else "least cost"
        elif hindrance:
            reason = hindrance
        elif short:
            reason = f"R {pair.reliability:.4g} below {minimum:g}"
        elif any(
            other.gesture == pair.gesture and other.by_look < pair.by_look
            for other in table
            if not other.ruled_out and not _below(other.reliability, minimum)
        ):
            reason = f"the look alone rules out {pair.by_look}"
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
        reference=reference.id,
        target=reference.target,
        gesture=chosen.gesture if chosen else "none",
        phrase=chosen.option.text if chosen else "",
        reliability=chosen.reliability if chosen else 0.0,
        cost=least,
        pairs=tuple(rows),
    )


def _deictic_warnings(reference: Reference, scene: ReferenceScene) -> list[str]:
    """Warnings of deictic phrases with a list of distractors that are not all other objects (decision B8)."""
    universe = scene.universe - {reference.target}
    return [
        f"{reference.id}: the distractors of the deictic {option.text!r} are everything else, not those listed"
        for option in reference.options or ()
        if option.deictic and option.distractors and set(option.distractors) - {reference.target} != universe
    ]


def _minimum(reference: Reference, config: GenerationConfig) -> Probability:
    given = reference.minimum_reliability
    return config.minimum_reliability if given is None else given


def _below(value: Probability, minimum: Probability) -> bool:
    return round(value - minimum, ROUNDING) < 0


def _pair_name(gesture: GestureChoice, phrase: str) -> str:
    said = repr(phrase) if phrase else "no phrase"
    return f"{'no gesture' if gesture == 'none' else gesture.replace('_', ' ')} with {said}"
