"""Prosody of a speech: the spans of its text that SSML around the words asks to be said in another way. Pure.

`Speech.markup` carries the SSML; `spans` reads from it what a voice can do, and `marked_up` writes it.
"""

import math
import re
from collections.abc import Iterable, Iterator, Sequence
from typing import Literal

from lxml import etree
from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.behaviors import Mark, Speech
from engage_hri.schemas.documents.escaping import escape, quoteattr
from engage_hri.schemas.documents.xml_source import XML, local_name
from engage_hri.schemas.units import Seconds

Emphasis = Literal["", "strong", "moderate", "reduced"]


class Prosody(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A span of a text that is to be said in another way than the rest of it.

    start, end: characters of the text. rate: of words per second, times the voice's own; 2 is twice as fast.
    pitch: fundamental frequency, times the voice's own. volume: amplitude, times the voice's own.
    pause: seconds of silence before the span; a span of no characters is that alone.
    emphasis: empty: none. language: a tag such as `de`; empty: that of the rest.
    """

    start: int
    end: int
    rate: float = 1.0
    pitch: float = 1.0
    volume: float = 1.0
    pause: Seconds = 0.0
    emphasis: Emphasis = ""
    language: str = ""


RATES = {"x-slow": 0.5, "slow": 0.75, "medium": 1.0, "fast": 1.33, "x-fast": 2.0, "default": 1.0}
PITCHES = {"x-low": 0.7, "low": 0.85, "medium": 1.0, "high": 1.2, "x-high": 1.4, "default": 1.0}
VOLUMES = {"silent": 0.0, "x-soft": 0.3, "soft": 0.6, "medium": 1.0, "loud": 1.5, "x-loud": 2.0, "default": 1.0}
BREAKS = {"none": 0.0, "x-weak": 0.1, "weak": 0.2, "medium": 0.4, "strong": 0.7, "x-strong": 1.2}
"""What the words of SSML mean here. The standard leaves it to the voice."""
_RANGE = {"rate": (0.3, 3.0), "pitch": (0.5, 2.0), "volume": (0.0, 4.0)}
LONGEST_PAUSE: Seconds = 10.0
_NUMBER = re.compile(r"\s*([+-]?)(\d+(?:\.\d+)?|\.\d+)\s*(%|st|dB|Hz|ms|s)?\s*$")


def spans(speech: Speech) -> tuple[Prosody, ...]:
    """Read the prosody of a speech from its markup. The spans do not overlap, and are in the order of the text.

    speech: one whose markup has the same words as its text; else there are none.
    """
    if not speech.markup:
        return ()
    parser = etree.XMLParser(resolve_entities=False, no_network=True, recover=False)
    try:
        root = etree.fromstring(f"<speak>{speech.markup}</speak>".encode(), parser)
    except etree.XMLSyntaxError:
        return ()
    walk = _Walk()
    walk.through(root, Prosody(start=0, end=0))
    places = [place for place, letter in enumerate(speech.text) if not letter.isspace()]
    if "".join(walk.words) != "".join(speech.text.split()):
        return ()
    return tuple(_placed(walk.spans, places, len(speech.text)))


class _Walk:
    """Collector of spans, counted in characters that are no white space."""

    def __init__(self) -> None:
        self.words: list[str] = []
        self.spans: list[Prosody] = []
        self._length = 0
        self._pause = 0.0

    def through(self, element: etree._Element, how: Prosody) -> None:
        self._say(element.text, how)
        for child in element:
            if isinstance(child.tag, str):
                local = local_name(child)
                if local == "break":
                    self._pause += _pause(child)
                self.through(child, _nested(how, child, local))
            self._say(child.tail, how)

    def _say(self, text: str | None, how: Prosody) -> None:
        said = "".join((text or "").split())
        if said:
            self.words.append(said)
            start, self._length = self._length, self._length + len(said)
            self.spans.append(replace(how, start=start, end=self._length, pause=self._pause))
            self._pause = 0.0


def _placed(found: Iterable[Prosody], places: Sequence[int], length: int) -> Iterator[Prosody]:
    for span in found:
        plain = Prosody(start=span.start, end=span.end)
        start = places[span.start]
        if span != plain:
            end = start if replace(span, pause=0.0) == plain else places[span.end - 1] + 1
            yield replace(span, start=start, end=min(end, length))


def _nested(how: Prosody, element: etree._Element, local: str) -> Prosody:
    language = element.get(f"{{{XML}}}lang") or ""
    how = replace(how, language=language) if language else how
    if local == "emphasis":
        level = element.get("level") or "moderate"
        how = replace(how, emphasis=level if level in ("strong", "moderate", "reduced") else "")
    if local == "prosody":
        how = replace(
            how,
            rate=_times(how.rate, "rate", element.get("rate"), RATES),
            pitch=_times(how.pitch, "pitch", element.get("pitch"), PITCHES),
            volume=_times(how.volume, "volume", element.get("volume"), VOLUMES),
        )
    return how


def _times(before: float, kind: str, value: str | None, words: dict[str, float]) -> float:
    """The factor `before` with what a nested element asks. A value that says nothing here changes nothing."""
    low, high = _RANGE[kind]
    return max(low, min(high, before * _factor(kind, (value or "").strip(), words)))


def _factor(kind: str, value: str, words: dict[str, float]) -> float:
    if value in words:
        return words[value]
    if (match := _NUMBER.match(value)) is None or not math.isfinite(number := float(match[2])):
        return 1.0
    sign, unit = match[1], match[3]
    signed = -number if sign == "-" else number
    if unit == "%":
        return max(0.0, 1.0 + signed / 100.0) if sign or kind != "rate" else number / 100.0
    if unit == "st" and kind == "pitch":
        return math.pow(2.0, max(-12.0, min(12.0, signed)) / 12.0)
    if unit == "dB" and kind == "volume":
        return math.pow(10.0, max(-40.0, min(12.0, signed)) / 20.0)
    if unit is None and kind == "rate" and not sign:
        return number
    if unit is None and kind == "volume":
        return 1.0 + signed / 100.0 if sign else number / 100.0
    return 1.0


def _pause(element: etree._Element) -> Seconds:
    match = _NUMBER.match(element.get("time") or "")
    if match and match[3] in ("s", "ms") and match[1] != "-":
        return min(LONGEST_PAUSE, float(match[2]) / (1000.0 if match[3] == "ms" else 1.0))
    return BREAKS.get(element.get("strength") or "medium", BREAKS["medium"])


def marked_up(text: str, marks: Sequence[Mark], start: int, end: int, **how: str) -> str:
    """Write a text with its marks as SSML, with one span of it in a `<prosody>`.

    text: the words. marks: its sync points, by characters. start, end: the span, by characters.
    how: attributes of the element, as `pitch="low"`.
    """
    opening = f"<prosody{''.join(f' {name}={quoteattr(value)}' for name, value in how.items())}>"
    cuts = [(start, 1, opening), (end, -1, "</prosody>")]
    # A mark at the start of the span stands before it, one at its end behind it.
    cuts += [(mark.position, 0, f"<mark name={quoteattr(mark.id)}/>") for mark in marks]
    ordered = sorted(cuts, key=lambda cut: cut[0])
    ordered = sorted(ordered, key=lambda cut: (cut[0], cut[1] if cut[0] in (start, end) else 0))
    written, at = "", 0
    for position, _, inserted in ordered:
        written += escape(text[at:position]) + inserted
        at = max(at, position)
    return written + escape(text[at:])
