"""The elements of BML and EBML: which struct each becomes, and what may stand in it."""

from collections.abc import Iterator

from lxml import etree

from engage_hri.schemas import behaviors as of
from engage_hri.schemas.behavior_types import ROWS
from engage_hri.schemas.documents.xml_names import ours
from engage_hri.schemas.documents.xml_source import CORE, EBML, split

CORE_BEHAVIORS = {row.name: row.kind for row in ROWS if row.is_standard}
EXTENSIONS = {row.name: row.kind for row in ROWS if not row.is_standard}
OPERATORS: dict[str, type[of.Synchronize | of.Before | of.After]] = {
    "synchronize": of.Synchronize,
    "before": of.Before,
    "after": of.After,
}
CHILDREN = {
    "face": {"lexeme", "facs"}, "faceShift": {"lexeme", "facs"}, "posture": {"stance", "pose"},
    "postureShift": {"stance", "pose"}, "emit": {"event"}, "reference": {"speechOption"},
    "event": {"object", "anchor"}, "speechOption": {"distractor"}, "synchronize": {"sync"}, "before": {"sync"},
    "after": {"sync"},
}  # fmt: skip
"""What else stands in them is misplaced; in those that are not listed, everything is."""
_ANYWHERE = ("description", "timing")
_FREE = ("description", "event")
"""Their content is their author's affair."""


def misplaced(element: etree._Element) -> Iterator[tuple[etree._Element, str, str]]:
    """Elements below this one that their parent cannot hold, with their own and the parent's name."""
    holder = split(str(element.tag))[1]
    for child, _, name in ours(element):
        if name not in CHILDREN.get(holder, ()) and name not in _ANYWHERE:
            yield child, name, holder
        elif name not in _FREE:
            yield from misplaced(child)


def behaviors_inside(speech: etree._Element, *, is_strict: bool) -> Iterator[etree._Element]:
    """Behaviors and constraints below a speech, which is no place for them. is_strict: in a fragment."""
    for child in speech:
        namespace, local = split(str(child.tag))
        is_core = namespace in CORE and local in (*CORE_BEHAVIORS, "constraint", "required")
        if is_core or ((namespace == EBML or (not namespace and is_strict)) and local in EXTENSIONS):
            yield child
        elif local != "description":
            yield from behaviors_inside(child, is_strict=is_strict)


def take_out(element: etree._Element) -> None:
    """Of its parent; the text behind it stays."""
    parent, before = element.getparent(), element.getprevious()
    assert parent is not None
    if before is not None:
        before.tail = f"{before.tail or ''}{element.tail or ''}"
    else:
        parent.text = f"{parent.text or ''}{element.tail or ''}"
    parent.remove(element)
