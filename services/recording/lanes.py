"""Annotations in tiers in which nothing overlaps, as annotation tools want it. Pure."""

from collections.abc import Iterable, Iterator, Sequence

from msgspec import Struct

from engage_hri.schemas.units import Seconds

SHORTEST: Seconds = 0.001
"""Shortest annotation: annotation tools count milliseconds."""


class Annotation(Struct, frozen=True):
    """A stretch of time with what is said of it."""

    begin: Seconds
    end: Seconds
    value: str

    @property
    def milliseconds(self) -> tuple[int, int]:
        """Beginning and end in whole milliseconds, as ELAN counts; the end is after the beginning."""
        begin = round(self.begin * 1000)
        return begin, max(round(self.end * 1000), begin + 1)


class Tier(Struct, frozen=True):
    """Annotations in the order of their beginnings. actor: whose; `connection events` for both sides."""

    name: str
    actor: str
    annotations: tuple[Annotation, ...]


def apart(actor: str, name: str, annotations: Iterable[Annotation]) -> Iterator[Tier]:
    """Make tiers in which nothing overlaps.

    An instant, such as a dash between two words, is given the shortest length. That is no overlap: what follows it
    begins so much later.
    """
    lanes: list[list[Annotation]] = []
    ends: list[Seconds] = []
    """Of each lane the end of its last annotation as it really was."""
    for one in sorted(annotations, key=lambda one: (one.begin, one.end)):
        at = round(one.begin * 1000)
        number = next((number for number, end in enumerate(ends) if round(end * 1000) <= at), len(lanes))
        if number == len(lanes):
            lanes.append([])
            ends.append(0.0)
        begin = one.begin
        if lanes[number]:
            last = lanes[number][-1]
            until = last.milliseconds[1]
            if until > at or (last.end > ends[number] and last.end > begin):
                begin = max(until / 1000, last.end)
        ends[number] = max(one.begin, one.end)
        end = one.end if one.end - begin >= SHORTEST - 1e-9 else begin + SHORTEST
        lanes[number].append(Annotation(begin, end, one.value))
    for number, lane in enumerate(lanes, 1):
        yield Tier(f"{actor} {name}" if number == 1 else f"{actor} {name} {number}", actor, tuple(lane))


def rows(all_tiers: Sequence[Tier]) -> Iterator[tuple[str, str, float, float, str]]:
    """Tier, actor, beginning, end and value of each annotation, by tier."""
    for tier in all_tiers:
        for one in tier.annotations:
            yield tier.name, tier.actor, round(one.begin, 6), round(one.end, 6), one.value
