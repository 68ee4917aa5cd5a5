"""Speech in XML: text, the marks inside it, and prosodic markup around it.

White space is collapsed as a voice would; a mark's position counts the characters of the collapsed text before
it. `xml:space="preserve"` keeps the text as it stands.
"""

import re
from typing import NamedTuple

from lxml import etree

from engage_hri.schemas.behaviors import Mark, Speech, Timing
from engage_hri.schemas.documents.xml_source import (
    BML_1_0,
    CORE,
    EBML,
    READ,
    SSML,
    XML,
    Source,
    attributes,
    escape,
    local_name,
    quoteattr,
    split,
)
from engage_hri.schemas.faults import InputRefused

MARKS = ("sync", "tm", "mark")
_WHITE = re.compile("[ \t\r\n]+")
_LANGUAGE = re.compile("[A-Za-z]{1,8}(-[A-Za-z0-9]{1,8})*")
"""The form of a tag for a language, RFC 3066 as `xml:lang` has it."""


class Spoken(NamedTuple):
    """Content of a <speech>."""

    text: str
    marks: tuple[Mark, ...]
    markup: str
    timing: tuple[Timing, ...]
    """Timing of marks that name another sync point where they stand: `<sync ref="gaze-1:stroke"/>`."""
    is_attribute: bool = False
    """True if the words stand in an attribute of the <speech>: `<speech id="s" text="Hello"/>`."""


def spoken(source: Source, speech: etree._Element, id: str) -> Spoken:
    """Read the content of a <speech>. Raises InputRefused for speech without text."""
    texts = [child for child in speech if _kind(child) == "text"]
    if len(texts) > 1:
        raise source.refusal("more than one <text>", texts[1], advice="one <speech> for each")
    content = texts[0] if texts else speech
    description, attribute = _ssml(speech), attributes(speech).get("text", "")
    preserve = content.get(f"{{{XML}}}space") == "preserve"
    reading = _Reading(source, id, preserve=preserve, hears_all=bool(texts) or description is None)
    reading.content(content)
    said = reading.result("")
    if not said.text and description is None and attribute.strip():
        reading.say(attribute)
        return reading.result("")._replace(is_attribute=True)
    if not texts and not said.text and not said.marks:
        if description is None:
            raise source.refusal(f"speech {id!r} says nothing", speech, advice="write <text>…</text> into it")
        reading.content(description)
    if texts and any(part.strip() for part in [speech.text or "", *(child.tail or "" for child in speech)]):
        raise source.refusal("words beside <text>", speech, advice="put all words inside <text>")
    return reading.result("" if description is None else serialized(description))


def language(source: Source, speech: etree._Element) -> str:
    """Read the language of a <speech>: the nearest `xml:lang` of its <text>, itself and what it stands in.

    Raises InputRefused for what is no tag. Empty: there is none.
    """
    texts = [child for child in speech if _kind(child) == "text"]
    for element in (*texts, speech, *speech.iterancestors()):
        tag = element.get(f"{{{XML}}}lang")
        if tag is not None:
            if tag and not _LANGUAGE.fullmatch(tag):
                advice = "a tag such as `de` or `pt-BR`"
                raise source.refusal(f"xml:lang={tag!r} is no language", element, advice=advice)
            return str(tag)
    return ""


def _ssml(speech: etree._Element) -> etree._Element | None:
    """Find the prosodic markup, in a `<description type="application/ssml+xml">` of BML 1.0."""
    for child in speech:
        if _kind(child) == "description" and child.get("type") == "application/ssml+xml":
            return child[0] if len(child) and split(str(child[0].tag))[1] == "speak" else child
    return None


def _kind(element: etree._Element) -> str:
    """Local name of a core element; empty for elements of other namespaces."""
    namespace, local = split(str(element.tag))
    return local if namespace in CORE else ""


class _Reading:
    """Collector of text and marks, in one walk through a speech.

    hears_all: words inside elements of other namespaces count, too.
    """

    def __init__(self, source: Source, id: str, *, preserve: bool, hears_all: bool) -> None:
        self._hears_all = hears_all
        self._said: list[str] = []
        self._length = 0
        self._source = source
        self._id = id
        self._preserve = preserve
        self._marks: list[Mark] = []
        self._timing: list[Timing] = []
        self._prosodic: etree._Element | None = None

    def content(self, element: etree._Element, *, nested: bool = False) -> None:
        self.say(element.text or "")
        for child in element:
            namespace, local = split(str(child.tag))
            known = namespace in CORE or namespace == SSML
            if known and local in MARKS:
                self._mark(child)
            elif known and local != "description":
                self._prosodic = element if self._prosodic is None and not nested else self._prosodic
                self.content(child, nested=True)
            elif namespace not in READ and self._hears_all:
                self.content(child, nested=True)
            self.say(child.tail or "")

    def say(self, words: str) -> None:
        if not self._preserve:
            words = _WHITE.sub(" ", words)
            if not self._length or self._said[-1].endswith(" "):
                words = words.removeprefix(" ")
        if words:
            self._said.append(words)
            self._length += len(words)

    def _mark(self, element: etree._Element) -> None:
        id, ref = element.get("id") or element.get("name") or "", element.get("ref") or ""
        is_tied = ":" in ref or (id and ref and ref != id)
        if not id and ":" not in ref:
            id = ref
        if not id and ref.partition(":")[0].strip() == self._id:
            id, ref = ref.partition(":")[2].strip(), ""
        if not id and not ref:
            raise self._source.refusal("a mark without a name", element, advice='<sync id="m1"/>')
        id = id or f"sync-{len(self._marks) + 1}"
        if is_tied and ref:
            self._timing.append(Timing(id, ref))
        self._marks.append(Mark(id, self._length))

    def result(self, described: str) -> Spoken:
        text = "".join(self._said)
        if not self._preserve:
            text = text.removesuffix(" ")
        marks = tuple(Mark(mark.id, min(mark.position, len(text))) for mark in self._marks)
        markup = described or ("" if self._prosodic is None else serialized(self._prosodic))
        return Spoken(text, marks, markup, tuple(self._timing))


def serialized(element: etree._Element) -> str:
    """Write the inner XML without namespaces, as a voice takes it; marks as SSML's `<mark name>`."""
    parts = [escape(element.text or "")]
    for child in element:
        local = local_name(child)
        if local in MARKS:
            parts.append(f"<mark name={quoteattr(child.get('id') or child.get('name') or child.get('ref') or '')}/>")
        elif local != "description":
            inner = serialized(child)
            opening = f"{local}{''.join(_attribute(str(name), str(value)) for name, value in child.items())}"
            parts.append(f"<{opening}>{inner}</{local}>" if inner else f"<{opening}/>")
        parts.append(escape(child.tail or ""))
    return "".join(parts)


def _attribute(name: str, value: str) -> str:
    namespace, local = split(name)
    prefix = "xml:" if namespace == XML else ""
    return f" {prefix}{local}={quoteattr(value)}" if prefix or not namespace else ""


def fill(element: etree._Element, speech: Speech, namespace: str) -> None:
    """Write text, marks and markup into an empty <speech>, so that `spoken` reads the same.

    Markup stands in a description beside the text in BML 1.0, in the text itself in the drafts; markup that is no XML
    is an attribute of our namespace.
    """
    markup = _read_back(speech, namespace) if speech.markup else None
    if markup is not None and namespace != BML_1_0:
        element.append(markup)
        return
    content = etree.SubElement(element, f"{{{namespace}}}text")
    if markup is not None:
        element.append(markup)
    elif speech.markup:
        element.set(f"{{{EBML}}}markup", speech.markup)
    if speech.text != _WHITE.sub(" ", speech.text).strip(" "):
        content.set(f"{{{XML}}}space", "preserve")
    tied = ties(speech, namespace)
    ends = [*(mark.position for mark in speech.marks), len(speech.text)]
    content.text = speech.text[: ends[0]] or None
    for mark, end in zip(speech.marks, ends[1:], strict=True):
        element = etree.SubElement(content, f"{{{namespace}}}sync", {"id": mark.id, **tied.get(mark.id, {})})
        element.tail = speech.text[mark.position : end] or None


def ties(speech: Speech, namespace: str) -> dict[str, dict[str, str]]:
    """Timing of marks that can be written at the marks, because it is read again in the same order."""
    order = [mark.id for mark in speech.marks]
    timed = [timing.sync for timing in speech.timing if timing.sync in order]
    ahead = [timing.sync for timing in speech.timing[: len(speech.timing) - len(timed)]]
    is_last = not set(order).intersection(ahead) and timed == [id for id in order if id in timed]
    if namespace != BML_1_0 or not is_last or any(timing.sync == timing.ref for timing in speech.timing):
        return {}
    return {timing.sync: {"ref": timing.ref} for timing in speech.timing if timing.sync in order}


def _read_back(speech: Speech, namespace: str) -> etree._Element | None:
    """Make an element of the markup: in BML 1.0 a description beside the text, in the drafts the text itself.

    None if reading it would not give the same speech: it is no XML, or has other words than the text.
    """
    if namespace == BML_1_0:
        ssml = f'<speak xmlns="{SSML}">{speech.markup}</speak>'
        content = f'<text/><description priority="1" type="application/ssml+xml">{ssml}</description>'
        expected = Spoken("", (), speech.markup, ())
    else:
        content = f"<text>{speech.markup}</text>"
        expected = Spoken(speech.text, speech.marks, speech.markup, ())
    try:
        source = Source(f'<speech xmlns="{namespace}">{content}</speech>')
        is_same = spoken(source, source.root, speech.id) == expected
    except InputRefused:
        return None
    return source.root[-1] if is_same else None
