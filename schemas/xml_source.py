"""XML from strangers: parsed without entities, DTD, network or size surprises, each element with its line.

lxml reports the line on which a start tag ends; people look for the line on which it begins, so tags are counted.
"""

import re
from collections.abc import Iterator
from typing import cast

from lxml import etree

from schemas.faults import Fault, InputRefused

DRAFT = "org.mindmakers.bml"
BML_1_0 = "http://www.bml-initiative.org/bml/bml-1.0"
EBML = "edu.wpi.ebml"
CORE = frozenset({"", DRAFT, BML_1_0})
"""Namespaces of BML proper; elements of any other but ours are somebody else's and are left alone."""

LARGEST = 4 * 1024 * 1024
"""Bytes. A block of a thousand behaviors has about 200 kB."""
DEEPEST = 64
"""Levels of nesting."""

_UNDECLARED_PREFIX = "NS_ERR_UNDEFINED_NAMESPACE"
_DOCTYPE = re.compile(r"\A\ufeff?(?>\s+|<\?.*?\?>|<!--.*?-->)*+<!DOCTYPE", re.DOTALL)
_TAGS = re.compile(r"<!--.*?-->|<!\[CDATA\[.*?\]\]>|<\?.*?\?>|<([^\s/>!?][^\s/>]*)", re.DOTALL)


class Source:
    """A parsed document. `root`, the name of its source, and the line of each element."""

    def __init__(self, data: bytes | str, name: str = "") -> None:
        """Raises InputRefused: too large, too deep, not well-formed, or with a document type."""
        self.name = name
        if len(data) > LARGEST:
            raise self.refusal(
                f"{len(data)} bytes; at most {LARGEST} are read", advice="split it into several blocks"
            )
        text = data if isinstance(data, str) else _decoded(data)
        if _DOCTYPE.match(text):
            raise self.refusal("a document type (<!DOCTYPE>) is not read", advice="remove it: no entities, no DTD")
        self.root = self._parse(data)
        self._lines = dict(zip(self._elements(), _start_lines(text), strict=False))
        self._require_declared()
        self._require_shallow()

    def line(self, element: etree._Element) -> int:
        """Where the element begins, from 1."""
        return self._lines.get(element, 0) or _last_line(element)

    def refusal(
        self, reason: str, element: etree._Element | None = None, *, line: int = 0, advice: str = ""
    ) -> InputRefused:
        if element is not None:
            line = self.line(element)
        return InputRefused(Fault(reason=reason, where=self.name, line=line, advice=advice))

    def _elements(self) -> Iterator[etree._Element]:
        return self.root.iter(etree.Element)

    def _parse(self, data: bytes | str) -> etree._Element:
        raw, encoding = (data, None) if isinstance(data, bytes) else (data.encode(), "utf-8")
        parser = _parser(encoding, recover=False)
        try:
            root = etree.fromstring(raw, parser)
        except etree.XMLSyntaxError as error:
            root = self._without_undeclared(raw, encoding, parser, error)
        if root.getroottree().docinfo.doctype:  # type: ignore[union-attr]
            raise self.refusal("a document type (<!DOCTYPE>) is not read", advice="remove it: no entities, no DTD")
        return root

    def _without_undeclared(
        self, raw: bytes, encoding: str | None, parser: etree.XMLParser, error: etree.XMLSyntaxError
    ) -> etree._Element:
        """An attribute whose prefix nobody declared is somebody else's; every other error refuses the document."""
        bad = [entry for entry in parser.error_log if entry.level_name != "WARNING"]
        for entry in bad or [None]:
            if entry is None or entry.type_name != _UNDECLARED_PREFIX:
                line = int(entry.line if entry else error.lineno or 0)
                reason = entry.message.strip() if entry else str(error)
                raise self.refusal(
                    f"malformed XML: {reason}", line=line, advice="close and quote everything"
                ) from error
        return etree.fromstring(raw, _parser(encoding, recover=True))

    def _require_declared(self) -> None:
        for element in self._elements():
            if ":" in split(str(element.tag))[1]:
                advice = f'declare the prefix, for example xmlns:ebml="{EBML}"'
                raise self.refusal(
                    f"malformed XML: prefix of <{element.tag}> is not declared", element, advice=advice
                )

    def _require_shallow(self) -> None:
        depth = 0
        for event, element in etree.iterwalk(self.root, events=("start", "end")):
            depth += 1 if event == "start" else -1
            if depth > DEEPEST:
                raise self.refusal(f"nested deeper than {DEEPEST} levels", element)


def _parser(encoding: str | None, *, recover: bool) -> etree.XMLParser:
    return etree.XMLParser(
        encoding=encoding,
        recover=recover,
        resolve_entities=False,
        load_dtd=False,
        dtd_validation=False,
        no_network=True,
        huge_tree=False,
        remove_comments=True,
        remove_pis=True,
    )


def _last_line(element: etree._Element) -> int:
    return cast(int, element.sourceline or 0)


def _decoded(data: bytes) -> str:
    """Good enough to find tags and line ends, whatever single-byte encoding is declared."""
    encoding = "utf-16" if data[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8"
    return data.decode(encoding, errors="replace")


def _start_lines(text: str) -> Iterator[int]:
    """The line of each start tag, in document order."""
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
