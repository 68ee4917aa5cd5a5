"""A story and what was seen of it, side by side, as the laws ask for it."""

import math
from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property

from msgspec import Struct

from engage_hri.schemas.world import Entity
from tests.judge.reading import Asked, Place, Reading, read_all
from tests.judge.record import Record
from tests.judge.story import WORLD, Story


class Finding(Struct, frozen=True):
    """Something that is not as it must be. law: a name of `laws.LAWS`. behavior: if it is about one."""

    law: str
    block: str
    text: str
    behavior: str = ""

    def __str__(self) -> str:
        return f"{self.law}: {self.block}: {self.text}"


class Done(Struct, frozen=True):
    """A behavior of which at least one point was told. times: on the bus clock, by point."""

    block: str
    asked: Asked
    times: Mapping[str, float]

    @property
    def name(self) -> str:
        return f"{self.asked.id} ({self.asked.type})"

    def time(self, *syncs: str) -> float | None:
        """When the first of these that it has was reached; None if it was not."""
        known = next((sync for sync in syncs if sync in self.asked.points), "")
        return self.times.get(known)


PART_OF = {
    "speech": "voice", "gesture": "arm", "pointing": "arm", "head": "nodding", "gaze": "eyes", "gazeShift": "eyes",
    "headDirectionShift": "eyes", "face": "face", "faceLexeme": "face", "faceFacs": "face", "faceShift": "face",
    "posture": "torso", "postureShift": "torso",
}  # fmt: skip
"""For types of behaviors, the part that they may use; of others, as many as there are types."""


class Case:
    """What a story asked for (`blocks`), and what came of it (`record`)."""

    def __init__(self, story: Story, record: Record) -> None:
        self.story = story
        self.record = record
        self.blocks: Mapping[str, Reading] = read_all(deed.xml for deed in story.blocks)

    @cached_property
    def times(self) -> dict[Place, float]:
        """When each point was reached, as told, on the bus clock. The first time, should it be told twice."""
        found: dict[Place, float] = {}
        for block in self.blocks:
            for each in self.record.points(block):
                found.setdefault(Place(block, each.behavior, each.sync), each.at.seconds)
            if (began := self.record.began(block)) is not None:
                found[Place(block, "", "start")] = began
            if ends := self.record.progress(block, "end"):
                found[Place(block, "", "end")] = ends[0].at.seconds
        repeated = [each for each in self.record.reported if each.sync.startswith("stroke:")]
        for report in repeated:
            number = int(report.sync.partition(":")[2])
            found.setdefault(Place(report.block, report.behavior, "stroke", number), report.at.seconds)
        return found

    @cached_property
    def lost(self) -> set[tuple[str, str]]:
        """Behaviors that were dropped or interrupted, by their blocks' outcomes."""
        found = set()
        for block in self.blocks:
            if (outcome := self.record.outcome(block)) is not None:
                found |= {(block, id) for id in (*outcome.dropped, *outcome.interrupted)}
        return found

    @cached_property
    def done(self) -> tuple[Done, ...]:
        """All behaviors of which something was told."""
        return tuple(self._done())

    def _done(self) -> Iterator[Done]:
        for id, block in self.blocks.items():
            for asked in block.behaviors.values():
                times = {
                    sync: self.times[place]
                    for sync in asked.points
                    if (place := Place(id, asked.id, sync)) in self.times
                }
                if times:
                    yield Done(id, asked, times)

    def holds(self, block: str, behavior: str | None = None) -> list[tuple[float, float]]:
        """Times, apart from each other, in which the behavior is held; None: anything of the block."""
        found: list[tuple[float, float]] = []
        for number, hold in enumerate(self.record.steered):
            concerned = hold.block in ("", block) and (behavior is None or hold.behavior in ("", behavior))
            if hold.is_held and concerned:
                later = (each.at for each in self.record.steered[number:] if not each.is_held and each.covers(hold))
                found.append((hold.at, next(later, math.inf)))
        return merged(found)

    def concerned(self, blocks: Iterable[str]) -> set[str]:
        """These blocks, and those with which they share parts or points: they may have to wait for each other."""
        found = set(blocks)
        while True:
            before = len(found)
            shared = {each for block in found for each in self._uses(block)}
            found |= {block for block in self.blocks if not shared.isdisjoint(self._uses(block))}
            if len(found) == before:
                return found

    def _uses(self, block: str) -> set[str]:
        """Parts that a block may use, and the blocks that it names, itself included."""
        read = self.blocks[block]
        parts = {PART_OF.get(asked.type, asked.type) for asked in read.behaviors.values() if asked.type != "wait"}
        arms = {"arm"} if "torso" in parts else set[str]()  # Poses may be of the arms.
        return {block, *parts, *arms, *(term.place.block for relation in read.relations for term in relation.terms)}

    @property
    def is_exact(self) -> bool:
        """True if the body does what it has estimated."""
        return not self.story.faults and not self.story.lies

    @property
    def is_told_true(self) -> bool:
        """True if what is told of the body is what it did, all of it, and at the right time."""
        return not self.story.faults.get("lost") and not self.story.lies

    def entity(self, id: str) -> Entity | None:
        return WORLD.entity(id)


def merged(times: Iterable[tuple[float, float]]) -> list[tuple[float, float]]:
    """The same times, with no two that touch."""
    found: list[tuple[float, float]] = []
    for since, until in sorted(times):
        if found and since <= found[-1][1]:
            found[-1] = (found[-1][0], max(found[-1][1], until))
        else:
            found.append((since, until))
    return found


def within(times: Iterable[tuple[float, float]], since: float, until: float) -> float:
    """Seconds of these times between two instants."""
    return sum(max(0.0, min(until, last) - max(since, first)) for first, last in times)
