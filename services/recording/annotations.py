"""Annotations in tiers in which nothing overlaps, and files of them: ELAN (`.eaf`), and CSV. Pure."""

import csv
import io
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

from lxml import etree
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


_XSI = "http://www.w3.org/2001/XMLSchema-instance"
_FORMAT = "http://www.mpi.nl/tools/elan/EAFv3.0.xsd"
COLUMNS = ("tier", "actor", "begin", "end", "value")


class Media(NamedTuple):
    """A film of a recording, from its beginning on and as fast as it was. relative: address from the document."""

    address: str
    relative: str


def eaf(tiers: Sequence[Tier], *, date: str, media: Media | None = None) -> bytes:
    """An ELAN document. date: of the recording, as XML Schema has it. media: a film of it."""
    root = etree.Element("ANNOTATION_DOCUMENT", nsmap={"xsi": _XSI})
    for name, value in (("AUTHOR", "engage"), ("DATE", date), ("FORMAT", "3.0"), ("VERSION", "3.0")):
        root.set(name, value)
    root.set(f"{{{_XSI}}}noNamespaceSchemaLocation", _FORMAT)
    header = etree.SubElement(root, "HEADER", MEDIA_FILE="", TIME_UNITS="milliseconds")
    if media is not None:
        address, relative = media
        etree.SubElement(
            header, "MEDIA_DESCRIPTOR", MEDIA_URL=address, MIME_TYPE="video/mp4", RELATIVE_MEDIA_URL=relative
        )  # fmt: skip
    times = sorted({at for tier in tiers for one in tier.annotations for at in one.milliseconds})
    slots = {at: f"ts{number}" for number, at in enumerate(times, 1)}
    order = etree.SubElement(root, "TIME_ORDER")
    for at, slot in slots.items():
        etree.SubElement(order, "TIME_SLOT", TIME_SLOT_ID=slot, TIME_VALUE=str(at))
    number = 0
    for tier, name in zip(tiers, _unique([_xml(tier.name) for tier in tiers]), strict=True):
        element = etree.SubElement(
            root, "TIER", LINGUISTIC_TYPE_REF="default-lt", PARTICIPANT=_xml(tier.actor), TIER_ID=name
        )  # fmt: skip
        for one in tier.annotations:
            number += 1
            begin, end = (slots[at] for at in one.milliseconds)
            holder = etree.SubElement(element, "ANNOTATION")
            annotation = etree.SubElement(
                holder, "ALIGNABLE_ANNOTATION", ANNOTATION_ID=f"a{number}", TIME_SLOT_REF1=begin, TIME_SLOT_REF2=end
            )  # fmt: skip
            etree.SubElement(annotation, "ANNOTATION_VALUE").text = _xml(one.value)
    etree.SubElement(
        root, "LINGUISTIC_TYPE", GRAPHIC_REFERENCES="false", LINGUISTIC_TYPE_ID="default-lt", TIME_ALIGNABLE="true"
    )  # fmt: skip
    return etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True)


def _unique(names: Sequence[str]) -> list[str]:
    """The same names, each with a number behind it if there was one like it."""
    found: dict[str, None] = {}
    for name in names:
        new, number = name, 1
        while new in found:
            number += 1
            new = f"{name} ({number})"
        found[new] = None
    return list(found)


def _xml(text: str) -> str:
    """Text without what XML cannot hold."""
    return "".join(
        letter for letter in text if letter in "\t\n\r" or (letter >= " " and letter not in "\ufffe\uffff")
    )


def table(tiers: Sequence[Tier]) -> str:
    """CSV: tier, actor, beginning, end in seconds, value."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows(rows(tiers))
    return text.getvalue()
