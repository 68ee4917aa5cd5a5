"""A net as PNML (ISO/IEC 15909-2, place/transition nets), for the tools of others.

P/T nets have no words for seconds, sync points, XML lines and bounds. These stand in `toolspecific` elements of
ours, which other tools pass over.
"""

from lxml import etree

from engage_hri.services.realizer.net.petri_net import Bound, PetriNet, Place

PNML = "http://www.pnml.org/version-2009/grammar/pnml"
PT_NET = "http://www.pnml.org/version-2009/grammar/ptnet"
TOOL, VERSION = "engage", "1"
OURS = "urn:engage:net:1"


def as_pnml(net: PetriNet, name: str = "") -> str:
    """The net, one page, as a document. Equal nets give equal documents."""
    root = etree.Element(of_pnml("pnml"), nsmap={None: PNML, "e": OURS})  # type: ignore[dict-item]
    element = _child(root, "net", id="net", type=PT_NET)
    _name(element, name)
    page = _child(element, "page", id="page")
    for number, transition in enumerate(net.transitions):
        node = _child(page, "transition", id=f"t{number}")
        _name(node, transition.name)
        extra = _extension(node)
        for point in transition.points:
            etree.SubElement(extra, of_ours("point"), behavior=point.behavior, sync=point.sync)
    for number, place in enumerate(net.places):
        node = _child(page, "place", id=f"p{number}")
        _name(node, f"{place.kind} {place.behavior}".strip())
        if net.initial[number]:
            _child(_child(node, "initialMarking"), "text").text = str(net.initial[number])
        etree.SubElement(
            _extension(node),
            of_ours("place"),
            {**_tie(place), "shortest": repr(place.shortest), "after": place.after},
        )
        _child(page, "arc", id=f"i{number}", source=f"t{place.source}", target=f"p{number}")
        _child(page, "arc", id=f"o{number}", source=f"p{number}", target=f"t{place.target}")
    if net.bounds:
        extra = _extension(element)
        for bound in net.bounds:
            stretch = {} if bound.stretch is None else {"stretch": repr(bound.stretch)}
            ends = {"source": f"t{bound.source}", "target": f"t{bound.target}"}
            etree.SubElement(extra, of_ours("bound"), {**ends, **_tie(bound), **stretch})
    etree.indent(root)
    return etree.tostring(root, xml_declaration=True, encoding="UTF-8").decode()


def _tie(tie: Place | Bound) -> dict[str, str]:
    lines = " ".join(map(str, tie.lines))
    return {"kind": tie.kind, "lag": repr(tie.lag), "behavior": tie.behavior, "lines": lines}


def _child(parent: etree._Element, name: str, **attributes: str) -> etree._Element:
    return etree.SubElement(parent, of_pnml(name), attributes)


def _name(parent: etree._Element, text: str) -> None:
    _child(_child(parent, "name"), "text").text = text


def _extension(parent: etree._Element) -> etree._Element:
    return _child(parent, "toolspecific", tool=TOOL, version=VERSION)


def of_pnml(name: str) -> str:
    """A name of PNML, as lxml writes it."""
    return f"{{{PNML}}}{name}"


def of_ours(name: str) -> str:
    """A name of ours."""
    return f"{{{OURS}}}{name}"
