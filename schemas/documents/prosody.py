"""Prosody of a speech: the spans of its text that SSML around the words asks to be said in another way. Pure.

`Speech.markup` carries the SSML; `spans` reads from it what a voice can do, and `marked_up` writes it.
"""

import math
import re
from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from typing import Literal, NamedTuple

from lxml import etree
from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.behaviors import Mark, Speech
from engage_hri.schemas.documents.xml_source import XML, escape, local_name, quoteattr
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
READ = ("speak", "p", "s", "w", "token", "lang", "mark", "desc", "break", "prosody", "emphasis")
"""Elements of SSML that a voice here reads, or that say nothing about how the words are said."""
_WORDS = {"rate": RATES, "pitch": PITCHES, "volume": VOLUMES}
_RANGE = {"rate": (0.3, 3.0), "pitch": (0.5, 2.0), "volume": (0.0, 4.0)}
LONGEST_PAUSE: Seconds = 10.0
_NUMBER = re.compile(r"\s*([+-]?)(\d+(?:\.\d+)?|\.\d+)\s*(%|st|dB|Hz|ms|s)?\s*$")


class Markup(NamedTuple):
    """The part that a voice can do of the markup of a speech.

    spans: they do not overlap, and are in the order of the text. unread: what has no effect, in words.
    """

    spans: tuple[Prosody, ...] = ()
    unread: tuple[str, ...] = ()


def spans(speech: Speech) -> tuple[Prosody, ...]:
    """Read the prosody of a speech from its markup. The spans do not overlap, and are in the order of the text.

    speech: one whose markup has the same words as its text; else there are none.
    """
    return _read(speech.text, speech.markup).spans


def unread(speech: Speech) -> tuple[str, ...]:
    """Say what of the markup of a speech no voice here can do, though it would take time or change the words."""
    return _read(speech.text, speech.markup).unread


@lru_cache(256)  # of a plan the same speeches are estimated again and again
def _read(text: str, markup: str) -> Markup:
    if not markup:
        return Markup()
    parser = etree.XMLParser(resolve_entities=False, no_network=True, recover=False)
    try:
        root = etree.fromstring(f"<speak>{markup}</speak>".encode(), parser)
    except etree.XMLSyntaxError:
        return Markup(unread=("its markup is no XML; the text is said without it",))
    walk = _Walk()
    walk.through(root, Prosody(start=0, end=0))
    places = [place for place, letter in enumerate(text) if not letter.isspace()]
    if "".join(walk.words) != "".join(text.split()):
        return Markup(unread=("its markup has other words than its text, which is said without it",))
    end = Prosody(start=len(text), end=len(text), pause=walk.pause)
    last = (end,) if walk.pause and places else ()
    return Markup((*_placed(walk.spans, places, len(text)), *last), tuple(dict.fromkeys(walk.unread)))


class _Walk:
    """Collector of spans, counted in characters that are no white space. pause: seconds after the last words."""

    def __init__(self) -> None:
        self.words: list[str] = []
        self.spans: list[Prosody] = []
        self.unread: list[str] = []
        self.pause = 0.0
        self._length = 0

    def through(self, element: etree._Element, how: Prosody) -> None:
        self._say(element.text, how)
        for child in element:
            if isinstance(child.tag, str):
                local = local_name(child)
                self.unread += _unread(child, local)
                if local == "break":
                    self.pause += _pause(child)
                self.through(child, _nested(how, child, local))
            self._say(child.tail, how)

    def _say(self, text: str | None, how: Prosody) -> None:
        said = "".join((text or "").split())
        if said:
            self.words.append(said)
            start, self._length = self._length, self._length + len(said)
            self.spans.append(replace(how, start=start, end=self._length, pause=self.pause))
            self.pause = 0.0


def _placed(found: Iterable[Prosody], places: Sequence[int], length: int) -> Iterator[Prosody]:
    for span in found:
        plain = Prosody(start=span.start, end=span.end)
        start = places[span.start]
        if span != plain:
            end = start if replace(span, pause=0.0) == plain else places[span.end - 1] + 1
            yield replace(span, start=start, end=min(end, length))


def _unread(element: etree._Element, local: str) -> Iterator[str]:
    """Tell what of an element has no effect on a voice here."""
    if local not in READ and element.keys() != [f"{{{XML}}}lang"]:
        yield f"<{local}> has no effect: its words are said as they are written"
    for name in ("duration", "contour", "range") if local == "prosody" else ():
        if element.get(name) is not None:
            yield f"{name!r} of <prosody> has no effect"
    for kind, words in _WORDS.items() if local == "prosody" else ():
        value = (element.get(kind) or "").strip()
        if value and value not in words and _factor_of(kind, value) is None:
            yield f"<prosody {kind}={value!r}> has no effect: no voice here can read that"
    if local == "break" and (time := element.get("time")) is not None and _seconds(time) is None:
        yield f"<break time={time!r}> is no time: write it in `s` or `ms`"
    elif local == "break" and (strength := element.get("strength")) is not None and strength not in BREAKS:
        yield f"<break strength={strength!r}> is no strength: {', '.join(BREAKS)}"


def _nested(how: Prosody, element: etree._Element, local: str) -> Prosody:
    language = element.get(f"{{{XML}}}lang") or ""
    how = replace(how, language=language) if language else how
    if local == "emphasis":
        level = element.get("level") or "moderate"
        how = replace(how, emphasis=level if level in ("strong", "moderate", "reduced") else "")
    if local == "prosody":
        how = replace(
            how,
            rate=_times(how.rate, "rate", element.get("rate")),
            pitch=_times(how.pitch, "pitch", element.get("pitch")),
            volume=_times(how.volume, "volume", element.get("volume")),
        )
    return how


def _times(before: float, kind: str, value: str | None) -> float:
    """The factor `before` with what a nested element asks. A value that says nothing here changes nothing."""
    low, high = _RANGE[kind]
    return max(low, min(high, before * _factor(kind, (value or "").strip())))


def _factor(kind: str, value: str) -> float:
    if value in _WORDS[kind]:
        return _WORDS[kind][value]
    factor = _factor_of(kind, value)
    return 1.0 if factor is None else factor


def _factor_of(kind: str, value: str) -> float | None:
    """The factor that a number stands for; None: it says nothing here."""
    if (match := _NUMBER.match(value)) is None or not math.isfinite(number := float(match[2])):
        return None
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
    return None


def _pause(element: etree._Element) -> Seconds:
    seconds = _seconds(element.get("time") or "")
    return BREAKS.get(element.get("strength") or "medium", BREAKS["medium"]) if seconds is None else seconds


def _seconds(time: str) -> Seconds | None:
    match = _NUMBER.match(time)
    if match is None or match[3] not in ("s", "ms") or match[1] == "-":
        return None
    return min(LONGEST_PAUSE, float(match[2]) / (1000.0 if match[3] == "ms" else 1.0))


def marked_up(text: str, marks: Sequence[Mark], start: int, end: int, **how: str) -> str:
    """Write a text with its marks as SSML, with one span of it in a `<prosody>`.

    text: the words. marks: its sync points, by characters. start, end: the span, by characters.
    how: attributes of the element, as `pitch="low"`.
    """
    opening = f"<prosody{''.join(f' {name}={quoteattr(value)}' for name, value in how.items())}>"
    cuts = [(start, 1, opening), (end, -1, "</prosody>")]
    # A mark at the start of the span stands before it, one at its end behind it.
    cuts += [(mark.position, 0, f"<mark name={quoteattr(mark.id)}/>") for mark in marks]
    written, at = "", 0
    for position, _, inserted in sorted(cuts, key=lambda cut: cut[:2]):
        written += escape(text[at:position]) + inserted
        at = max(at, position)
    return written + escape(text[at:])
