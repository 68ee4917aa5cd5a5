"""The smallest story that still breaks a law: whatever can go, goes."""

import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator
from functools import partial

from msgspec.structs import replace

from tests.judge import reading
from tests.judge.story import Deed, Story

ET.register_namespace("", reading.BML_1_0)
KEPT = ("id", "target", "lexeme", "event", "type", "au", "ref", "part", "hand", "mode")
"""Attributes without which a behavior is another one, or none."""


def shrink(story: Story, is_broken: Callable[[Story], bool], most: int = 400) -> Story:
    """Take away deeds, behaviors, constraints and attributes as long as `is_broken`. most: stories to try."""
    tried = 0
    while True:
        for smaller in _smaller(story):
            tried += 1
            if tried > most:
                return story
            if is_broken(smaller):
                story = smaller
                break
        else:
            return story


def _smaller(story: Story) -> Iterator[Story]:
    """Stories with one thing less, the largest things first."""
    for deed in story.blocks:
        yield replace(
            story, deeds=tuple(_without(each, deed.block) for each in story.deeds if each.block != deed.block)
        )
    for deed in story.deeds:
        if deed.kind != "perform":
            yield replace(story, deeds=tuple(each for each in story.deeds if each is not deed))
    for key in story.faults:
        yield replace(story, faults={name: value for name, value in story.faults.items() if name != key})
    for key in story.lies:
        yield replace(story, lies={name: value for name, value in story.lies.items() if name != key})
    for number, deed in enumerate(story.deeds):
        for smaller in _smaller_deeds(deed):
            yield replace(story, deeds=(*story.deeds[:number], smaller, *story.deeds[number + 1 :]))


def _smaller_deeds(deed: Deed) -> Iterator[Deed]:
    if deed.kind != "perform":
        return
    if deed.follows:
        yield replace(deed, follows=())
    root = ET.fromstring(deed.xml)
    behaviors = [each for each in root.iter() if _name(each) in reading.TYPES and each.get("id")]
    for gone in behaviors:
        yield _edited(deed, partial(_drop, id=gone.get("id", "")))
    for kind in ("constraint", *reading.OPERATORS, "sync"):
        for number, _ in enumerate(each for each in root.iter() if _name(each) == kind):
            yield _edited(deed, partial(_drop_element, kind=kind, number=number))
    if root.get("composition"):
        yield _edited(deed, lambda copy: copy.attrib.pop("composition"))
    for one in behaviors:
        for name in one.attrib:
            if name not in KEPT:
                yield _edited(deed, partial(_drop_attribute, id=one.get("id", ""), name=name))


def _edited(deed: Deed, edit: Callable[[ET.Element], object]) -> Deed:
    root = ET.fromstring(deed.xml)
    edit(root)
    _clear(root)
    return replace(deed, xml=ET.tostring(root, encoding="unicode"))


def _drop_attribute(root: ET.Element, id: str, name: str) -> None:
    for each in root.iter():
        if each.get("id") == id and _name(each) in reading.TYPES:
            each.attrib.pop(name, None)


def _drop(root: ET.Element, id: str) -> None:
    """Take a behavior out, and everything that names it."""
    for parent in list(root.iter()):
        for child in list(parent):
            named = child.get("ref", "") if _name(child) in ("sync", *reading.OPERATORS) else ""
            is_it = child.get("id") == id and _name(child) in reading.TYPES
            if is_it or _names(named, id):
                parent.remove(child)
    for each in root.iter():
        for name, text in list(each.attrib.items()):
            if name not in KEPT and _names(text, id):
                del each.attrib[name]


def _drop_element(root: ET.Element, kind: str, number: int) -> None:
    gone = [each for each in root.iter() if _name(each) == kind][number]
    for parent in root.iter():
        if gone in list(parent):
            if _name(parent) in ("text", "speech"):
                _keep_tail(parent, gone)
            parent.remove(gone)


def _keep_tail(parent: ET.Element, gone: ET.Element) -> None:
    """Keep the words behind a mark that is taken out."""
    number = list(parent).index(gone)
    if number:
        parent[number - 1].tail = (parent[number - 1].tail or "") + (gone.tail or "")
    else:
        parent.text = (parent.text or "") + (gone.tail or "")


def _clear(root: ET.Element) -> None:
    """Take out constraints and operators that say nothing any more."""
    for parent in list(root.iter()):
        for child in list(parent):
            least = {"synchronize": 1, "after": 1, "before": 1, "constraint": 1, "required": 1}.get(_name(child), 0)
            if len(child) < least:
                parent.remove(child)


def _without(deed: Deed, block: str) -> Deed:
    """A deed that does not name a block."""
    if deed.kind != "perform":
        return deed
    deed = replace(deed, follows=tuple(each for each in deed.follows if each != block))
    return _edited(deed, lambda copy: _forget(copy, block))


def _forget(root: ET.Element, block: str) -> None:
    for parent in list(root.iter()):
        for child in list(parent):
            if child.get("ref", "").startswith(f"{block}:") and _name(child) in ("sync", *reading.OPERATORS):
                parent.remove(child)
        for name, text in list(parent.attrib.items()):
            if text.startswith(f"{block}:"):
                del parent.attrib[name]


def _names(ref: str, id: str) -> bool:
    """True if a reference is to a point of this behavior of the same block."""
    return ref.split(":")[0].strip() == id


def _name(element: ET.Element) -> str:
    return str(element.tag).rpartition("}")[2]
