"""Blocks in XML on a simulated body, in virtual time: is each constraint kept, or was it told at planning that it is not?

    python -m tests.realizer.kept_or_told [--pairs] [--offsets 20] [--blocks 2000] [--seed 0] [--part 0/2]

The oracle reads the document by the rules of docs/bml.md (`tests/judge/reading.py`) and the feedback. It knows no
body and no plan.
"""

import argparse
import asyncio
import re
import sys
from collections.abc import Iterator
from functools import partial
from itertools import combinations
from random import Random
from typing import NamedTuple

from engage_hri.schemas import keys
from engage_hri.schemas.blocks import Block, BlockOutcome, PerformBlock
from engage_hri.schemas.documents.xml_decode import decode_xml
from engage_hri.schemas.feedback import SyncPointProgress, WarningFeedback
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.control.body import Body
from engage_hri.services.control.config import ControlConfig
from engage_hri.services.control.service import embody
from engage_hri.services.control.torso.body import SimulatedBody
from engage_hri.services.realizer.config import RealizerConfig
from engage_hri.services.realizer.service import realize
from engage_hri.services.requests.ends import Requester, RequestRefused
from engage_hri.services.runtime.service import running
from engage_hri.services.runtime.virtual_time import run_virtual
from tests.judge.reading import Reading, Relation, Term, read
from tests.realizer.exact_blocks import WORLD

KEPT = 0.012
"""Seconds by which a constraint may be missed untold, or by another amount than told."""
BML = "http://www.bml-initiative.org/bml/bml-1.0"


class Told(NamedTuple):
    """What came of a block. times: of each point, from the block's start. planned, later: warnings, by when they came.

    outcome: None if the block was refused.
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
    told: list[object] = []
    async with MemoryHub() as hub:
        eyes, bus = hub.join("simulation"), hub.join("test")
        eyes.publish(keys.WORLD, WORLD)
        services = {
            "control": partial(embody, config=ControlConfig(), body=body()),
            "realizer": partial(realize, config=RealizerConfig()),
        }
        async with running(hub, services), Requester(bus) as requests:
            with bus.subscribe(keys.FEEDBACK) as inbox:
                request = PerformBlock(id="r", requester="test", block=block)
                try:
                    outcome = await asyncio.wait_for(requests.send(keys.BLOCK, request).outcome, 300.0)
                except RequestRefused:
                    outcome = None
                await asyncio.sleep(0.0)
                while len(inbox):
                    received = await inbox.next()
                    assert received is not None
                    told.append(received.message)
        await bus.leave()
        await eyes.leave()
    assert outcome is None or isinstance(outcome, BlockOutcome)
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
                yield Missed(relation.text, gap, _warned(one, other, gap, relation, told))


def _time(term: Term, told: Told) -> float | None:
    place = term.place
    if not place.behavior:
        return term.offset if place.sync == "start" else None
    at = told.times.get(f"{place.behavior}:{place.sync}")
    return None if at is None else at + term.offset


def _warned(one: Term, other: Term, gap: float, relation: Relation, told: Told) -> float | None:
    """Seconds by which a warning at planning says that one of the two is not on time: those nearest to the truth."""
    ids = {one.place.behavior, other.place.behavior}
    said = [
        float(match[1])
        for each in told.planned
        if each.kind == "LATE" and each.behavior in ids
        for match in [re.search(r"planned ([0-9.]+) s (?:later|earlier) than it should be", each.message)]
        if match
    ]
    return min(said, key=lambda seconds: abs(seconds - gap), default=None)


# -- pairs of one type ------------------------------------------------------------------------------------------------

SEVEN = ("start", "ready", "strokeStart", "stroke", "strokeEnd", "relax", "end")
FOUR = ("start", "ready", "relax", "end")
PAIRS = {
    "head": (SEVEN, 'head id="{id}" lexeme="NOD"', 'head id="{id}" lexeme="NOD"'),
    "gesture": (SEVEN, *['gesture id="{id}" lexeme="BEAT" mode="LEFT_HAND"'] * 2),
    "gaze": (FOUR, 'gaze id="{id}" target="box"', 'gaze id="{id}" target="ball"'),
}
"""Points of each type, and two behaviors of it."""
OWN = {"start", "strokeStart", "stroke", "strokeEnd", "ready", "relax", "end"}


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


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--step", type=float, default=0.05)
    arguments.add_argument("--part", default="0/1")
    arguments.add_argument("--only", default="")
    given = arguments.parse_args()
    part, parts = map(int, given.part.split("/"))
    offsets = [round(given.step * n, 3) for n in range(1, round(1 / given.step) + 1)]
    chance = Random(1)
    offsets += [round(chance.uniform(0.05, 1.0), 3) for _ in range(3)]
    count = kept = told = dropped = refused = silent = 0
    for number, (name, xml) in enumerate(pairs(offsets)):
        if number % parts != part or given.only not in name:
            continue
        count += 1
        each = perform(xml)
        found = list(missed(each))
        bad = [it for it in found if it.is_silent]
        silent += bool(bad)
        told += bool(found) and not bad
        refused += each.outcome is None
        dropped += each.outcome is not None and bool(each.outcome.dropped)
        if bad:
            print(name, f"off {bad[0].seconds:.3f} told {bad[0].told} end {each.end:.3f}", flush=True)
        elif found:
            print(name, f"TOLD {found[0].seconds:.3f} {found[0].told}", flush=True)
        elif each.outcome is None or each.outcome.dropped:
            why = [it.message for it in (*each.planned, *each.later)]
            print(name, "DROPPED", why, flush=True)
        kept += not found and each.outcome is not None and not each.outcome.dropped
    print(f"{count} pairs: {kept} kept, {told} told late, {dropped} dropped, {refused} refused, {silent} in silence")


if __name__ == "__main__":
    main()
    sys.exit()
