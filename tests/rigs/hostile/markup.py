"""BML and EBML documents that were valid before some of their elements and attributes were changed at random."""

from collections.abc import Callable

from lxml import etree

from tests.rigs.hostile.chance import Chance, happens

SEEDS = (
    """<bml xmlns="org.mindmakers.bml" id="{id}"><gaze id="g" target="{entity}"/>
<speech id="s" start="g:stroke"><text>Take the <sync id="m"/> piece</text></speech>
<pointing id="p" target="{entity}" mode="RIGHT_HAND"/><wait id="w" duration="0.5"/>
<constraint id="c"><synchronize ref="s:m"><sync ref="p:stroke"/></synchronize>
<after ref="g:end"><sync ref="w:start+0.5"/></after></constraint></bml>""",
    """<bml xmlns="http://www.bml-initiative.org/bml/bml-1.0" id="{id}" characterId="robot" composition="MERGE">
<gazeShift id="g" target="{entity}"/><head id="h" lexeme="NOD" repetition="2" start="g:end"/>
<faceLexeme id="f" lexeme="SMILE" amount="0.5"/><gesture id="b" lexeme="BEAT"/>
<required><speech id="s"><text>Hello there</text></speech></required></bml>""",
    """<ebml:ebml xmlns:ebml="edu.wpi.ebml" xmlns="org.mindmakers.bml" id="{id}" turnIndex="1" turnStatus="full">
<speech id="s"><text>Please move</text></speech>
<ebml:reference id="r" target="{entity}" minimumReliability="0.95">
<ebml:speechOption text="the blue piece" cost="3"/></ebml:reference></ebml:ebml>""",
)
VALUES = (
    "", " ", "s", "g:start", "g:stroke+1e9", "bml:start", "nan", "-1", "1e308", "0.5", "REPLACE", "APPEND",
    "BOTH_HANDS", "true", "x" * 400, "\U0001f916", "&", "a:b:c:d", "person", "nobody", "2",
)  # fmt: skip
DEPTH = 80


def document(chance: Chance, entities: tuple[str, ...]) -> bytes:
    """Make a document with up to six changes. Most are still well-formed XML."""
    text = chance.choice(SEEDS).format(id=f"m{chance.randrange(0, 9)}", entity=chance.choice(entities))
    root = etree.fromstring(text)
    for _ in range(chance.randrange(0, 7)):
        chance.choice(CHANGES)(chance, root)
    data = etree.tostring(root)
    if happens(chance, 0.05):
        return data[: chance.randrange(0, len(data))]
    return data.replace(b">", b"><!DOCTYPE x>", 1) if happens(chance, 0.02) else data


def _random_element(chance: Chance, root: etree._Element) -> etree._Element:
    return chance.choice([element for element in root.iter() if isinstance(element.tag, str)])


def _remove(chance: Chance, root: etree._Element) -> None:
    element = _random_element(chance, root)
    if (parent := element.getparent()) is not None:
        parent.remove(element)


def _move(chance: Chance, root: etree._Element) -> None:
    element, into = _random_element(chance, root), _random_element(chance, root)
    if element is not root and element not in (into, *into.iterancestors()):
        into.insert(chance.randrange(0, len(into) + 1), element)


def _double(chance: Chance, root: etree._Element) -> None:
    copy = etree.fromstring(etree.tostring(_random_element(chance, root), with_tail=False))
    _random_element(chance, root).append(copy)


def _rename(chance: Chance, root: etree._Element) -> None:
    _random_element(chance, root).tag = _random_element(chance, root).tag if happens(chance, 0.7) else "unheardOf"


def _set_attribute(chance: Chance, root: etree._Element) -> None:
    names = [str(name) for name in _random_element(chance, root).attrib] or ["start"]
    name = chance.choice((*names, "id", "end", "stroke", "ref", "target", "unheardOf"))
    _random_element(chance, root).set(name, chance.choice(VALUES))


def _remove_attribute(chance: Chance, root: etree._Element) -> None:
    element = _random_element(chance, root)
    if names := list(element.attrib):
        del element.attrib[chance.choice(names)]


def _set_text(chance: Chance, root: etree._Element) -> None:
    _random_element(chance, root).text = chance.choice(VALUES)


def _nest(chance: Chance, root: etree._Element) -> None:
    """Nest elements, at times deeper than the reader goes."""
    element = _random_element(chance, root)
    for _ in range(DEPTH if happens(chance, 0.3) else 2):
        element = etree.SubElement(element, "required")


CHANGES: tuple[Callable[[Chance, etree._Element], None], ...] = (
    _remove, _move, _double, _rename, *(_set_attribute,) * 3, _remove_attribute, _set_text, _nest,
)  # fmt: skip
