"""A net as PNML (ISO/IEC 15909-2, place/transition nets) and back, for the tools of others.

P/T nets have no words for seconds, sync points, XML lines and bounds. These stand in `toolspecific` elements of
ours, which other tools pass over.
"""

from collections.abc import Iterator
from typing import get_args

from lxml import etree

from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.net.petri_net import Bound, PetriNet, Place, PlaceKind, Transition
from engage_hri.services.realizer.points import Point

PNML = "http://www.pnml.org/version-2009/grammar/pnml"
PT_NET = "http://www.pnml.org/version-2009/grammar/ptnet"
TOOL, VERSION = "engage", "1"
OURS = "urn:engage:net:1"


def as_pnml(net: PetriNet, name: str = "") -> str:
    """The net, one page, as a document. Equal nets give equal documents."""
    root = etree.Element(_pnml("pnml"), nsmap={None: PNML, "e": OURS})  # type: ignore[dict-item]
    element = _child(root, "net", id="net", type=PT_NET)
    _name(element, name)
    page = _child(element, "page", id="page")
    for number, transition in enumerate(net.transitions):
        node = _child(page, "transition", id=f"t{number}")
        _name(node, transition.name)
        extra = _extension(node)
        for point in transition.points:
            etree.SubElement(extra, _ours("point"), behavior=point.behavior, sync=point.sync)
    for number, place in enumerate(net.places):
        node = _child(page, "place", id=f"p{number}")
        _name(node, f"{place.kind} {place.behavior}".strip())
        if net.initial[number]:
            _child(_child(node, "initialMarking"), "text").text = str(net.initial[number])
        etree.SubElement(
            _extension(node), _ours("place"), {**_tie(place), "shortest": repr(place.shortest), "after": place.after}
        )
        _child(page, "arc", id=f"i{number}", source=f"t{place.source}", target=f"p{number}")
        _child(page, "arc", id=f"o{number}", source=f"p{number}", target=f"t{place.target}")
    if net.bounds:
        extra = _extension(element)
        for bound in net.bounds:
            stretch = {} if bound.stretch is None else {"stretch": repr(bound.stretch)}
            ends = {"source": f"t{bound.source}", "target": f"t{bound.target}"}
            etree.SubElement(extra, _ours("bound"), {**ends, **_tie(bound), **stretch})
    etree.indent(root)
    return etree.tostring(root, xml_declaration=True, encoding="UTF-8").decode()


def read_pnml(document: str | bytes) -> PetriNet:
    """The net of `as_pnml`; or of another tool, if each place has one input, one output and one token at most.

    Raises InputRefused.
    """
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, remove_comments=True)
    try:
        root = etree.fromstring(document.encode() if isinstance(document, str) else document, parser)
        return _read(root)
    except etree.XMLSyntaxError as error:
        raise InputRefused(Fault(reason=str(error.msg), where="PNML", line=error.lineno or 0)) from error
    except (KeyError, ValueError) as error:
        raise InputRefused(Fault(reason=f"not a net that can be read: {error}", where="PNML")) from error


def _read(root: etree._Element) -> PetriNet:
    net = root.find(_pnml("net"))
    if net is None or net.get("type") != PT_NET:
        raise ValueError("no place/transition net")
    nodes = list(net.iter(_pnml("transition")))
    number = {_attribute(node, "id"): index for index, node in enumerate(nodes)}
    sources: dict[str, int] = {}
    targets: dict[str, int] = {}
    for arc in net.iter(_pnml("arc")):
        source, target = _attribute(arc, "source"), _attribute(arc, "target")
        if _text(arc, "inscription", "1") != "1":
            raise ValueError(f"an arc at {target} carries more than one token")
        place, ends, transition = (target, sources, source) if source in number else (source, targets, target)
        if place in ends:
            raise ValueError(f"place {place} is shared by several transitions")
        ends[place] = number[transition]
    return PetriNet(
        tuple(_transition(node) for node in nodes),
        tuple(_place(node, sources, targets) for node in net.iter(_pnml("place"))),
        tuple(_bound(node, number) for node in _extensions(net, "bound")),
    )


def _transition(node: etree._Element) -> Transition:
    points = tuple(
        Point(_attribute(each, "behavior"), _attribute(each, "sync")) for each in _extensions(node, "point")
    )
    return Transition(_text(node, "name", ""), points)


def _place(node: etree._Element, sources: dict[str, int], targets: dict[str, int]) -> Place:
    id = _attribute(node, "id")
    tokens = int(_text(node, "initialMarking", "0"))
    ours = next(_extensions(node, "place"), None)
    kind, lag, behavior, lines = _read_tie(ours) if ours is not None else ("idle" if tokens else "order", 0.0, "", ())
    if tokens != int(kind == "idle"):
        raise ValueError(f"place {id} begins with {tokens} tokens")
    shortest = lag if ours is None else float(ours.get("shortest", lag))
    after = "" if ours is None else ours.get("after", "")
    return Place(kind, sources[id], targets[id], lag, shortest, behavior, lines, after)


def _bound(node: etree._Element, number: dict[str, int]) -> Bound:
    kind, lag, behavior, lines = _read_tie(node)
    stretch = None if (text := node.get("stretch")) is None else float(text)
    source, target = number[_attribute(node, "source")], number[_attribute(node, "target")]
    return Bound(kind, source, target, lag, stretch, behavior, lines)


def _tie(tie: Place | Bound) -> dict[str, str]:
    lines = " ".join(map(str, tie.lines))
    return {"kind": tie.kind, "lag": repr(tie.lag), "behavior": tie.behavior, "lines": lines}


def _read_tie(node: etree._Element) -> tuple[PlaceKind, Seconds, str, tuple[int, ...]]:
    if (kind := _attribute(node, "kind")) not in get_args(PlaceKind):
        raise ValueError(f"unknown kind {kind!r}")
    lines = tuple(map(int, node.get("lines", "").split()))
    return kind, float(_attribute(node, "lag")), node.get("behavior", ""), lines  # type: ignore[return-value]


def _child(parent: etree._Element, name: str, **attributes: str) -> etree._Element:
    return etree.SubElement(parent, _pnml(name), attributes)


def _name(parent: etree._Element, text: str) -> None:
    _child(_child(parent, "name"), "text").text = text


def _extension(parent: etree._Element) -> etree._Element:
    return _child(parent, "toolspecific", tool=TOOL, version=VERSION)


def _extensions(parent: etree._Element, name: str) -> Iterator[etree._Element]:
    for each in parent.findall(_pnml("toolspecific")):
        if each.get("tool") == TOOL and each.get("version") == VERSION:
            yield from each.iterfind(_ours(name))


def _attribute(node: etree._Element, name: str) -> str:
    if (value := node.get(name)) is None:
        raise ValueError(f"<{node.tag!s}> has no attribute {name!r}")
    return str(value)


def _text(parent: etree._Element, label: str, default: str) -> str:
    return (parent.findtext(f"{_pnml(label)}/{_pnml('text')}") or default).strip()


def _pnml(name: str) -> str:
    return f"{{{PNML}}}{name}"


def _ours(name: str) -> str:
    return f"{{{OURS}}}{name}"
