"""The reference policy: for each object reference the cheapest pair of gesture and phrase that is understood.

Thesis 3.3.2. Cost depends on where the head and the arms are, and every gesture moves them, so a sequence of
references is chosen as a whole: a dynamic program over what head and arms point at. Reliability does not depend on
posture, so pairs that are not understood are left out first, and per gesture only the best phrase can win.
"""

from collections.abc import Collection, Sequence

from msgspec import Struct

from engage_hri.schemas.behaviors import Hand, Reference
from engage_hri.schemas.faults import Fault, RunFailed
from engage_hri.schemas.fragments import PairConsidered, ReferenceChoice
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.references.motions import CURRENT_POSE, Motions, Way, distinct, hand_of
from engage_hri.services.generation.references.pairs import (
    POINT,
    ROUNDING,
    Pair,
    ReferenceScene,
    Table,
    considered,
    deictic_warnings,
    shown,
)
from engage_hri.services.generation.references.sequence import HeadAndArms, Movements, cheapest
from engage_hri.services.runtime.steps import Steps, finished

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
    weighed = finished(weigh(references, scene, motions, config))
    return finished(choice(weighed, scene, motions, config, apart))


def weigh(
    references: Sequence[Reference], scene: ReferenceScene, motions: Motions, config: GenerationConfig
) -> Steps[list[Table]]:
    """The tables of all pairs of each reference. motions: from where the body is."""
    tables = []
    seems = shown(distinct([reference.target for reference in references]), scene, motions)
    yield (len(scene.layout.owner) + 64) * len(seems) // 16
    for reference in references:
        pairs = considered(reference, seems[reference.target], scene, motions, config)
        tables.append(Table(reference, pairs, config))
        yield 6 * len(pairs) + len(scene.universe) // 2
    return tables


def choice(
    tables: Sequence[Table],
    scene: ReferenceScene,
    motions: Motions,
    config: GenerationConfig,
    apart: Collection[str] = (),
) -> Steps[Choices]:
    """Choose as `choose` does, with tables from `weigh`."""
    best = yield from cheapest(tables, motions, config, apart)
    explained: list[ReferenceChoice] = []
    for table, pair, posture in zip(tables, best.pairs, best.postures, strict=False):
        explained.append(_explain(table, pair, posture, Movements(table.reference.target, motions, config)))
        yield 8 * len(table.pairs)
    choices = tuple(explained)
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
