"""Blocks in XML on a simulated body, in virtual time: is each constraint kept, or told not to be at planning?

    python -m tests.realizer.kept_or_told [--step 0.05] [--only head] [--part 0/2]    every pair of one type
    python -m tests.realizer.kept_or_told --blocks 2000 [--seed 0] [--part 0/2]       random blocks

The oracle reads the document by the rules of docs/bml.md (`tests/judge/reading.py`) and the feedback. It knows no
body and no plan.
"""

import argparse
import re
from collections import Counter
from collections.abc import Iterator
from functools import partial
from itertools import combinations
from random import Random
from typing import NamedTuple

from engage_hri.schemas.blocks import Block, BlockOutcome, SyncPointProgress, WarningFeedback
from engage_hri.schemas.documents.xml_decode import decode_xml
from engage_hri.services.control.contract.body import Body
from engage_hri.services.control.torso.body import SimulatedBody
from engage_hri.services.runtime.virtual_time import run_virtual
from tests.judge.generate import story
from tests.judge.reading import Reading, Term, read
from tests.judge.story import WORLD
from tests.realizer.exact_blocks import fed_back

KEPT = 0.012
"""Seconds by which a constraint may be missed untold, or by another amount than told."""
BML = "http://www.bml-initiative.org/bml/bml-1.0"


class Told(NamedTuple):
    """What came of a block. times: of each point, from the block's start.

    planned, later: warnings that came before its first point, and after. outcome: None if the block was refused.
    """

    block: Reading
    outcome: BlockOutcome | None
    times: dict[str, float]
    planned: list[WarningFeedback]
    later: list[WarningFeedback]

    @property
    def end(self) -> float:
        return max(self.times.values(), default=0.0)


class Missed(NamedTuple):
    """A constraint that was not kept. seconds: by which. told: what was told at planning of it; None: nothing."""

    text: str
    seconds: float
    told: float | None

    @property
    def is_silent(self) -> bool:
        return self.told is None or abs(self.told - self.seconds) > KEPT


def perform(xml: str, body: type[Body] | partial[Body] = SimulatedBody) -> Told:
    """Perform one block."""
    return run_virtual(_perform(xml, body))


async def _perform(xml: str, body: type[Body] | partial[Body]) -> Told:
    block = decode_xml(xml)
    assert isinstance(block, Block)
    outcome, told = await fed_back(block, WORLD, body())
    times: dict[str, float] = {}
    warned: tuple[list[WarningFeedback], list[WarningFeedback]] = ([], [])
    for each in told:
        if isinstance(each, SyncPointProgress):
            times[f"{each.behavior}:{each.sync}"] = each.time
        elif isinstance(each, WarningFeedback):
            warned[bool(times)].append(each)
    return Told(read(xml), outcome, times, *warned)


def missed(told: Told) -> Iterator[Missed]:
    """Constraints between points that were reached that were not kept, each with what was told of it at planning."""
    for relation in told.block.relations:
        for one, other in combinations(relation.terms, 2):
            if relation.kind != "same" and one is not relation.terms[0]:
                continue
            if (at := _time(one, told)) is None or (then := _time(other, told)) is None:
                continue
            gap = abs(at - then) if relation.kind == "same" else at - then if relation.kind == "after" else then - at
            if gap > KEPT:
                yield Missed(relation.text, gap, _warned(one, other, gap, told))


def _time(term: Term, told: Told) -> float | None:
    place = term.place
    if not place.behavior:
        return term.offset if place.sync == "start" else None
    if place.number > 1:
        return None  # Feedback tells of the first of repeated strokes only.
    at = told.times.get(f"{place.behavior}:{place.sync}")
    return None if at is None else at + term.offset


def _warned(one: Term, other: Term, gap: float, told: Told) -> float | None:
    """Seconds by which a warning at planning says that one of the two is not on time: those nearest to the truth.

    A speech that gives a time up for its words says which, and not by how much.
    """
    ids = {one.place.behavior, other.place.behavior}
    if any(each.kind == "IMPOSSIBLE_TO_SCHEDULE" and each.behavior in ids for each in told.planned):
        return gap
    said = [
        float(match[1])
        for each in told.planned
        if each.kind == "LATE" and each.behavior in ids
        for match in [re.search(r"planned ([0-9.]+) s (?:later|earlier) than it should be", each.message)]
        if match
    ]
    return min(said, key=lambda seconds: abs(seconds - gap), default=None)


# -- pairs of one type -----------------------------------------------------------------------------------------------

BEAT = 'gesture id="{id}" lexeme="BEAT" mode="LEFT_HAND"'
SEVEN = ("start", "ready", "strokeStart", "stroke", "strokeEnd", "relax", "end")
FOUR = ("start", "ready", "relax", "end")
PAIRS: dict[str, tuple[tuple[str, ...], str, str]] = {
    "head": (SEVEN, 'head id="{id}" lexeme="NOD"', 'head id="{id}" lexeme="NOD"'),
    "gesture": (SEVEN, BEAT, BEAT),
    "gaze": (FOUR, 'gaze id="{id}" target="box"', 'gaze id="{id}" target="cup"'),
}
"""Points of each type, and two behaviors of it."""


def pairs(offsets: list[float]) -> Iterator[tuple[str, str]]:
    """Every point of one of two of a type at each point of the other, and so many seconds: a name and the block."""
    for type, (points, one, other) in PAIRS.items():
        for own in points:
            for to in points:
                for offset in offsets:
                    first = one.format(id="a")
                    second = other.format(id="b")
                    name = f"{type} {own}=a:{to}+{offset:g}"
                    yield name, f'<bml xmlns="{BML}" id="k"><{first}/><{second} {own}="a:{to}+{offset:g}"/></bml>'


def random_blocks(seed: int, blocks: int) -> Iterator[tuple[str, str]]:
    """So many random blocks: a name and the block."""
    for number in range(blocks):
        yield f"block {number}", story(seed, number, "alone").blocks[0].xml


def offsets(step: float) -> list[float]:
    """Offsets from 0.05 to 1 s, and three at random."""
    chance = Random(1)
    return [
        *(round(step * n, 3) for n in range(1, round(1 / step) + 1)),
        *(round(chance.uniform(0.05, 1.0), 3) for _ in range(3)),
    ]


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--step", type=float, default=0.05)
    arguments.add_argument("--part", default="0/1")
    arguments.add_argument("--only", default="")
    arguments.add_argument("--blocks", type=int, default=0)
    arguments.add_argument("--seed", type=int, default=0)
    given = arguments.parse_args()
    part, parts = map(int, given.part.split("/"))
    cases = random_blocks(given.seed, given.blocks) if given.blocks else pairs(offsets(given.step))
    count: Counter[str] = Counter()
    for number, (name, xml) in enumerate(cases):
        if number % parts != part or given.only not in name:
            continue
        each = perform(xml)
        found = list(missed(each))
        if silent := [it for it in found if it.is_silent]:
            count["in silence"] += 1
            later = [it.message for it in each.later if it.kind == "LATE"]
            print(name, *(f"{it.text} off {it.seconds:.3f} told {it.told}" for it in silent), later, flush=True)
        elif each.outcome is None:
            count["refused"] += 1
        elif found:
            count["told at planning"] += 1
        else:
            count["with a behavior dropped" if each.outcome.dropped else "kept"] += 1
    print(sum(count.values()), dict(count))


if __name__ == "__main__":
    main()
