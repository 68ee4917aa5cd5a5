"""Grammars of the forms of BML 1.0, and the removal of what is not BML's before they are asked."""

from functools import cache
from pathlib import Path

from lxml import etree

from engage_hri.schemas.documents.xml_source import EBML

HERE = Path(__file__).parent


def violations(xml: bytes | str, grammar: str = "bml-1.0.rng") -> list[str]:
    """What is wrong with a document by the grammar, our own elements and attributes taken out of it."""
    root = etree.fromstring(xml.encode() if isinstance(xml, str) else xml)
    validator = _validator(grammar)
    validator.validate(without_extension(root))
    return [str(error.message) for error in validator.error_log]


@cache
def _validator(grammar: str) -> etree.RelaxNG:
    return etree.RelaxNG(etree.parse(HERE / grammar))


def without_extension(root: etree._Element) -> etree._Element:
    """A copy without elements and attributes of our namespace; text that follows an element stays."""
    etree.strip_elements(root, f"{{{EBML}}}*", with_tail=False)
    for element in root.iter(etree.Element):
        for name in [str(name) for name in element.attrib if str(name).startswith(f"{{{EBML}}}")]:
            del element.attrib[name]
    return root
