"""A story and what was seen of it, side by side, as the laws ask for it."""

from collections.abc import Iterator, Mapping
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
