"""Reader of nets in PNML: of ours, with all that they say, and of those of other tools."""

from collections.abc import Iterator
from typing import get_args

from lxml import etree

from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.export import PT_NET, TOOL, VERSION, of_ours, of_pnml
from engage_hri.services.realizer.net.petri_net import Bound, PetriNet, Place, PlaceKind, Transition
from engage_hri.services.realizer.points import Point


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
    net = root.find(of_pnml("net"))
    if net is None or net.get("type") != PT_NET:
        raise ValueError("no place/transition net")
    nodes = list(net.iter(of_pnml("transition")))
    number = {_attribute(node, "id"): index for index, node in enumerate(nodes)}
    sources: dict[str, int] = {}
    targets: dict[str, int] = {}
    for arc in net.iter(of_pnml("arc")):
        source, target = _attribute(arc, "source"), _attribute(arc, "target")
        if _text(arc, "inscription", "1") != "1":
            raise ValueError(f"an arc at {target} carries more than one token")
        place, ends, transition = (target, sources, source) if source in number else (source, targets, target)
        if place in ends:
            raise ValueError(f"place {place} is shared by several transitions")
        ends[place] = number[transition]
    return PetriNet(
        tuple(_transition(node) for node in nodes),
        tuple(_place(node, sources, targets) for node in net.iter(of_pnml("place"))),
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


def _read_tie(node: etree._Element) -> tuple[PlaceKind, Seconds, str, tuple[int, ...]]:
    if (kind := _attribute(node, "kind")) not in get_args(PlaceKind):
        raise ValueError(f"unknown kind {kind!r}")
    lines = tuple(map(int, node.get("lines", "").split()))
    return kind, float(_attribute(node, "lag")), node.get("behavior", ""), lines  # type: ignore[return-value]


def _extensions(parent: etree._Element, name: str) -> Iterator[etree._Element]:
    for each in parent.findall(of_pnml("toolspecific")):
        if each.get("tool") == TOOL and each.get("version") == VERSION:
            yield from each.iterfind(of_ours(name))


def _attribute(node: etree._Element, name: str) -> str:
    if (value := node.get(name)) is None:
        raise ValueError(f"<{node.tag!s}> has no attribute {name!r}")
    return str(value)


def _text(parent: etree._Element, label: str, default: str) -> str:
    return (parent.findtext(f"{of_pnml(label)}/{of_pnml('text')}") or default).strip()
