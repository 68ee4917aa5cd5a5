"""Files of annotations: ELAN (`.eaf`), Praat (`.TextGrid`), and CSV. Pure: tiers in, text out."""

import csv
import io
from collections.abc import Sequence

from lxml import etree

from engage_hri.schemas.units import Seconds
from engage_hri.schemas.utf8 import printable
from engage_hri.services.recording.tiers import Tier, milliseconds, rows

_XSI = "http://www.w3.org/2001/XMLSchema-instance"
_FORMAT = "http://www.mpi.nl/tools/elan/EAFv3.0.xsd"
COLUMNS = ("tier", "actor", "begin", "end", "value")


def eaf(tiers: Sequence[Tier], *, date: str, media: str = "", author: str = "engage") -> bytes:
    """An ELAN document. date: of the recording, ISO 8601. media: address of a film of it; empty: none."""
    root = etree.Element("ANNOTATION_DOCUMENT", nsmap={"xsi": _XSI})
    for name, value in (("AUTHOR", author), ("DATE", date), ("FORMAT", "3.0"), ("VERSION", "3.0")):
        root.set(name, value)
    root.set(f"{{{_XSI}}}noNamespaceSchemaLocation", _FORMAT)
    header = etree.SubElement(root, "HEADER", MEDIA_FILE="", TIME_UNITS="milliseconds")
    if media:
        mime = "video/mp4" if media.endswith(".mp4") else "image/gif"
        etree.SubElement(header, "MEDIA_DESCRIPTOR", MEDIA_URL=media, MIME_TYPE=mime, RELATIVE_MEDIA_URL=media)
    times = sorted({milliseconds(at) for tier in tiers for one in tier.annotations for at in (one.begin, one.end)})
    slots = {at: f"ts{number}" for number, at in enumerate(times, 1)}
    order = etree.SubElement(root, "TIME_ORDER")
    for at, slot in slots.items():
        etree.SubElement(order, "TIME_SLOT", TIME_SLOT_ID=slot, TIME_VALUE=str(at))
    number = 0
    for tier in tiers:
        element = etree.SubElement(
            root, "TIER", LINGUISTIC_TYPE_REF="default-lt", PARTICIPANT=_xml(tier.actor), TIER_ID=_xml(tier.name)
        )  # fmt: skip
        for one in tier.annotations:
            number += 1
            begin, end = (slots[milliseconds(at)] for at in (one.begin, one.end))
            holder = etree.SubElement(element, "ANNOTATION")
            annotation = etree.SubElement(
                holder, "ALIGNABLE_ANNOTATION", ANNOTATION_ID=f"a{number}", TIME_SLOT_REF1=begin, TIME_SLOT_REF2=end
            )  # fmt: skip
            etree.SubElement(annotation, "ANNOTATION_VALUE").text = _xml(one.value)
    etree.SubElement(
        root, "LINGUISTIC_TYPE", GRAPHIC_REFERENCES="false", LINGUISTIC_TYPE_ID="default-lt", TIME_ALIGNABLE="true"
    )  # fmt: skip
    return etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True)


def _xml(text: str) -> str:
    """Text without what XML cannot hold."""
    return "".join(
        letter for letter in text if letter in "\t\n\r" or (letter >= " " and letter not in "\ufffe\uffff")
    )


def textgrid(tiers: Sequence[Tier], duration: Seconds) -> str:
    """A TextGrid in Praat's long form. Each tier fills the whole time; what nothing is said of is empty."""
    end = max([duration, *(one.end for tier in tiers for one in tier.annotations)], default=0.0)
    lines = [
        'File type = "ooTextFile"', 'Object class = "TextGrid"', "", "xmin = 0", f"xmax = {end:.6f}",
        "tiers? <exists>", f"size = {len(tiers)}", "item []:",
    ]  # fmt: skip
    for number, tier in enumerate(tiers, 1):
        intervals: list[tuple[Seconds, Seconds, str]] = []
        at = 0.0
        for one in tier.annotations:
            if one.begin - at > 5e-7:
                intervals.append((at, one.begin, ""))
            begin = max(at, one.begin)
            intervals.append((begin, max(one.end, begin + 1e-6), one.value))
            at = intervals[-1][1]
        if end - at > 5e-7:
            intervals.append((at, end, ""))
        lines += [
            f"    item [{number}]:", '        class = "IntervalTier"', f"        name = {_quoted(tier.name)}",
            "        xmin = 0", f"        xmax = {end:.6f}", f"        intervals: size = {len(intervals)}",
        ]  # fmt: skip
        for place, (begin, until, value) in enumerate(intervals, 1):
            lines += [
                f"        intervals [{place}]:", f"            xmin = {begin:.6f}",
                f"            xmax = {until:.6f}", f"            text = {_quoted(value)}",
            ]  # fmt: skip
    return "\n".join(lines) + "\n"


def _quoted(text: str) -> str:
    return '"' + printable(text).replace("\n", " ").replace('"', '""') + '"'


def table(tiers: Sequence[Tier]) -> str:
    """CSV: tier, actor, beginning, end in seconds, value."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows(rows(tiers))
    return text.getvalue()
