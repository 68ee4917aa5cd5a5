"""Parsing of XML from strangers: no entities, DTD, network or surprises of size; each element with its line.

lxml reports the line on which a start tag ends; people look for the one on which it begins, so tags are counted.
"""

import re
from collections.abc import Iterable, Iterator
from itertools import islice
from typing import cast

from lxml import etree

from engage_hri.schemas.access import LARGEST
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.text import utf8

DRAFT = "org.mindmakers.bml"
BML_1_0 = "http://www.bml-initiative.org/bml/bml-1.0"
EBML = "edu.wpi.ebml"
BML_1_0_EXTENSIONS = "http://www.bml-initiative.org/bml/coreextensions-1.0"
"""Namespace of the standard's own extensions: `faceFacs` is in it, though many write that in the core."""
CORE = frozenset({"", DRAFT, BML_1_0, BML_1_0_EXTENSIONS})
"""Namespaces of BML proper."""
READ = CORE | {EBML}
"""Namespaces that are read; of all others it is only told that they are there."""
SSML = "http://www.w3.org/2001/10/synthesis"
XML = "http://www.w3.org/XML/1998/namespace"
_OF_THE_DOCUMENT = frozenset({XML, "http://www.w3.org/2001/XMLSchema-instance"})
"""Namespaces of attributes that say something of the document, and nothing of what is to be performed."""
DEEPEST = 64
"""Levels of nesting."""

MOST_ELEMENTS = 120_000
MOST_BEHAVIORS = 20_000
MOST_ATTRIBUTES = 100
"""Attributes of one element. None in use has twenty, and lxml takes time quadratic in their number."""

_ADVICE = {
    "ERR_UNDECLARED_ENTITY": "write the character itself; only &amp; &lt; &gt; &quot; &apos; are known",
    "ERR_INVALID_CHAR": "remove it: XML holds no control characters",
    "ERR_DOCUMENT_END": "a document is one <bml> or one <ebml>",
    "ERR_ATTRIBUTE_REDEFINED": "name each attribute once",
    "NS_ERR_UNDEFINED_NAMESPACE": f'declare the prefix, for example xmlns:ebml="{EBML}"',
}
"""Advice by libxml2's name of the error."""
_DECLARED = re.compile(rb"(?:\xef\xbb\xbf)?<\?xml[^>?]*?\sencoding\s*=\s*[\"']([A-Za-z0-9._-]+)[\"']")
_ROOT_ID = re.compile(rb"<(?:[\w.-]+:)?e?bml\s[^<>]*?\bid\s*=\s*[\"']([^\"'<>&]+)[\"']")
"""Id of the document, near its beginning."""
_NEAR = 4096
_DOCTYPE = re.compile(r"\A\ufeff?(?>\s+|<\?.*?\?>|<!--.*?-->)*+<!DOCTYPE", re.DOTALL)
_TAGS = re.compile(r"<!--.*?-->|<!\[CDATA\[.*?\]\]>|<\?.*?\?>|<([^\s/>!?][^\s/>]*)", re.DOTALL)


class Source:
    """A parsed document: its `root`, the id of that (`block`), its source's name, and the line of each element."""

    def __init__(self, data: bytes | str, name: str = "") -> None:
        """Parse a document. Raises InputRefused if it is too large or too deep, malformed, or has a document type."""
        self.name = name
        self.block: str | None = None
        if len(data) > LARGEST:
            raise self.refusal(
                f"{len(data)} bytes; at most {LARGEST} are read", advice="split it into several blocks"
            )
        text = data if isinstance(data, str) else self._decoded(data)
        text = text.removeprefix("\ufeff")
        if doctype := _DOCTYPE.match(text):
            raise self._doctype(text.count("\n", 0, doctype.end()) + 1)
        self.root = self._parse(text)
        self.block = self.root.get("id") or None
        # No further than that: a million elements take seconds to look at.
        elements = list(islice(self.root.iter(etree.Element), MOST_ELEMENTS + 1))
        for count, most, what in (
            (len(self.root), MOST_BEHAVIORS, "behaviors and constraints"),
            (len(elements), MOST_ELEMENTS, "elements"),
        ):
            if count > most:
                raise self.refusal(f"more than {most} {what}", advice="split it into several blocks")
        self._lines = dict(zip(elements, _start_lines(text), strict=False))
        self._require_plain(elements)
        self._require_shallow()

    def line(self, element: etree._Element) -> int:
        """Line on which the element begins, from 1."""
        return self._lines.get(element, 0) or cast(int, element.sourceline or 0)

    def line_of_text(self, element: etree._Element, *, is_behind: bool = False) -> int:
        """The line on which the text of an element begins, or that behind the element."""
        text = str((element.tail if is_behind else element.text) or "")
        since = _last_line(element) if is_behind else cast(int, element.sourceline or 0)
        return since + text[: len(text) - len(text.lstrip())].count("\n")

    def refusal(
        self, reason: str, element: etree._Element | None = None, *, line: int = 0, advice: str = ""
    ) -> InputRefused:
        if element is not None:
            line = self.line(element)
        return InputRefused(Fault(reason=reason, where=self.name, line=line, advice=advice), self.block)

    def _decoded(self, data: bytes) -> str:
        """Decode the bytes. Raises InputRefused for another encoding than UTF-8, or UTF-16 with its mark."""
        declared = _DECLARED.match(data)
        if declared and declared[1].upper() not in (b"UTF-8", b"UTF8", b"US-ASCII", b"ASCII"):
            reason = f"malformed XML: encoding {declared[1].decode()[:40]!r} is not read"
            raise self.refusal(reason, line=1, advice="save it as UTF-8")
        try:
            return utf8(data)
        except InputRefused as error:
            reason = f"malformed XML: {error.fault.reason}"
            raise self.refusal(reason, line=error.fault.line, advice=error.fault.advice) from error

    def _parse(self, text: str) -> etree._Element:
        parser = _parser()
        try:
            root = etree.fromstring(text.encode(errors="surrogatepass"), parser)
        except etree.XMLSyntaxError as error:
            wrong = next((entry for entry in parser.error_log if entry.level_name != "WARNING"), None)
            reason, kind = (wrong.message.strip(), wrong.type_name) if wrong else (str(error), "")
            line = int(wrong.line if wrong else error.lineno or 0)
            if reason.startswith("Excessive depth"):
                raise self.refusal(f"nested deeper than {DEEPEST} levels", line=line, advice="unnest it") from error
            advice = _ADVICE.get(kind, "close and quote everything")
            raise self.refusal(f"malformed XML: {reason}", line=line, advice=advice) from error
        if root.getroottree().docinfo.doctype:  # type: ignore[union-attr]
            raise self._doctype(0)
        return root

    def _doctype(self, line: int) -> InputRefused:
        reason = "a document type (<!DOCTYPE>) is not read"
        return self.refusal(reason, line=line, advice="remove it: no entities, no DTD")

    def _require_plain(self, elements: Iterable[etree._Element]) -> None:
        """Refuse elements with too many attributes. Raises InputRefused."""
        for element in elements:
            if (count := len(element.attrib)) > MOST_ATTRIBUTES:
                reason = f"<{split(str(element.tag))[1]}> has {count} attributes; at most {MOST_ATTRIBUTES} are read"
                raise self.refusal(reason, element)

    def _require_shallow(self) -> None:
        depth = 0
        for event, element in etree.iterwalk(self.root, events=("start", "end")):
            depth += 1 if event == "start" else -1
            if depth > DEEPEST:
                raise self.refusal(f"nested deeper than {DEEPEST} levels", element, advice="unnest it")


def id_of(data: bytes) -> str | None:
    """Find the id of a document without parsing it; None if it is not near the beginning."""
    found = _ROOT_ID.search(data[:_NEAR])
    return found[1].decode(errors="replace") if found else None


def _parser() -> etree.XMLParser:
    return etree.XMLParser(
        encoding="utf-8", recover=False, resolve_entities=False, load_dtd=False, dtd_validation=False,
        no_network=True, huge_tree=False, remove_comments=True, remove_pis=True,
    )  # fmt: skip


def _last_line(element: etree._Element) -> int:
    """The line on which the end tag of an element begins."""
    if len(element):
        return _last_line(element[-1]) + str(element[-1].tail or "").count("\n")
    return cast(int, element.sourceline or 0) + str(element.text or "").count("\n")


def _start_lines(text: str) -> Iterator[int]:
    """Lines of all start tags, in document order."""
    line, position = 1, 0
    for tag in _TAGS.finditer(text):
        line += text.count("\n", position, tag.start())
        position = tag.start()
        if tag[1]:
            yield line


def split(tag: str) -> tuple[str, str]:
    """Namespace and local name of an element or attribute."""
    namespace, _, local = tag.rpartition("}")
    return namespace.removeprefix("{"), local


def bml_children(parent: etree._Element) -> Iterator[tuple[etree._Element, str, str]]:
    """Children that are BML or EBML, with namespace and local name."""
    for child in parent:
        namespace, local = split(str(child.tag))
        if namespace in READ:
            yield child, namespace, local


def foreign_children(parent: etree._Element) -> Iterator[tuple[etree._Element, str]]:
    """Children that are neither BML, EBML nor prosodic markup, with namespace."""
    for child in parent:
        namespace = split(str(child.tag))[0]
        if namespace not in READ and namespace != SSML:
            yield child, namespace


def foreign_attributes(element: etree._Element) -> Iterator[str]:
    """Names of the attributes of other namespaces, with their prefixes."""
    for name in map(str, element.attrib):
        namespace, local = split(name)
        if namespace not in READ and namespace not in _OF_THE_DOCUMENT:
            prefixes = (prefix for prefix, uri in element.nsmap.items() if prefix and uri == namespace)
            yield f"{next(prefixes, '')}:{local}"


def prefixed_name(element: etree._Element) -> str:
    """Name of an element as it is written, with its prefix if it has one."""
    return f"{element.prefix}:{local_name(element)}" if element.prefix else local_name(element)


def children_named(parent: etree._Element, local: str) -> list[etree._Element]:
    """Children with this name that are BML or EBML."""
    return [child for child, _, name in bml_children(parent) if name == local]


def local_name(element: etree._Element) -> str:
    return split(str(element.tag))[1]


def attributes(element: etree._Element) -> dict[str, str]:
    """Attributes of BML and EBML, by local name."""
    split_names = ((*split(str(name)), str(value)) for name, value in element.items())
    return {local: value for space, local, value in split_names if space in READ}


_TEXT = str.maketrans({"&": "&amp;", "<": "&lt;", ">": "&gt;"})
_VALUE = _TEXT | str.maketrans({'"': "&quot;", "\n": "&#10;", "\r": "&#13;", "\t": "&#9;"})


def escape(text: str) -> str:
    """Write text between tags."""
    return text.translate(_TEXT)


def quoteattr(value: str) -> str:
    """Write the value of an attribute, with its quotes."""
    return f'"{value.translate(_VALUE)}"'
