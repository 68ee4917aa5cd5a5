"""Annotations in tiers in which nothing overlaps, as annotation tools want it. Pure."""

from collections.abc import Iterable, Iterator, Sequence

from msgspec import Struct

from engage_hri.schemas.units import Seconds


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
    """Make tiers in which nothing overlaps."""
    lanes: list[list[Annotation]] = []
    for one in sorted(annotations, key=lambda one: (one.begin, one.end)):
        begin, _ = one.milliseconds
        lane = next((lane for lane in lanes if lane[-1].milliseconds[1] <= begin), None)
        if lane is None:
            lanes.append(lane := [])
        lane.append(one)
    for number, lane in enumerate(lanes, 1):
        yield Tier(f"{actor} {name}" if number == 1 else f"{actor} {name} {number}", actor, tuple(lane))


def rows(all_tiers: Sequence[Tier]) -> Iterator[tuple[str, str, float, float, str]]:
    """Tier, actor, beginning, end and value of each annotation, by tier."""
    for tier in all_tiers:
        for one in tier.annotations:
            yield tier.name, tier.actor, round(one.begin, 6), round(one.end, 6), one.value
