"""A plan for people and programs: text, JSON, a drawing of its net (DOT), and the net for other tools (PNML).

P/T nets have no words for seconds, sync points, XML lines and bounds. In PNML these stand in `toolspecific` elements
of ours, which other tools pass over. Watchers of a running block are told the same net in messages (`described`).
"""

import json
from collections.abc import Iterable, Mapping

from lxml import etree
from msgspec.structs import asdict

from engage_hri.schemas.behaviors import Event, Speech
from engage_hri.schemas.blocks import Fired, NetPlace, NetPlanned, NetPoint, NetSpeech, NetTransition
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.realizer.net.petri_net import Bound, Marking, PetriNet, Place, is_live, is_safe
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.plan.words import Spelling
from engage_hri.services.realizer.points import FINISH, Point, as_told


def described(
    plan: Plan, began: Stamp, marking: Marking, fired: Mapping[int, Seconds], spelling: Spelling
) -> NetPlanned:
    """The net of a plan with its tokens. began: when the block started. fired: transitions, seconds after that.

    Points that have one name in the block's dialect are told once: in BML 1.0 a gaze's `stroke_start` is its `start`.
    """
    transitions = [
        NetTransition(
            points=tuple(dict.fromkeys(_point(point, spelling) for point in each.points or (FINISH,))),
            time=time,
        )
        for each, time in zip(plan.net.transitions, plan.schedule, strict=True)
    ]
    places = [
        NetPlace(kind=each.kind, source=each.source, target=each.target, lag=each.lag, behavior=each.behavior)
        for each in plan.net.places
    ]
    return NetPlanned(
        block=plan.block.id,
        at=began,
        transitions=tuple(transitions),
        places=tuple(places),
        marked=tuple(number for number, content in enumerate(marking) if content),
        fired=firings(fired),
        speeches=tuple(
            NetSpeech(behavior=as_told(each.id), text=each.text)
            for each in plan.block.behaviors
            if isinstance(each, Speech)
        ),
    )


def _point(point: Point, spelling: Spelling) -> NetPoint:
    return NetPoint(behavior=as_told(point.behavior), sync=spelling.sync(point))


def firings(fired: Mapping[int, Seconds]) -> tuple[Fired, ...]:
    """Transitions with their times, in the order in which they fired."""
    return tuple(Fired(transition=transition, time=time) for transition, time in fired.items())


ADDED = ("series", "handover")
"""Kinds of ties that nothing in the block asks for."""


def as_text(plan: Plan) -> str:
    """The schedule, instant by instant, then what ties the instants, then what was dropped.

    Sync points are named as the block spells them. A star marks the critical path: what makes the block as long as
    it is.
    """
    net, spelling = plan.net, Spelling(plan.block)
    by_time = sorted(range(len(net.transitions)), key=lambda each: (plan.schedule[each], each))
    soundness = ("live" if is_live(net) else "NOT live") + (", safe" if is_safe(net) else ", NOT safe")
    size = f"{len(net.transitions)} transitions, {len(net.places)} places"
    critical = frozenset(plan.critical)
    lines = [f"block {plan.block.id}: {size}, {soundness}", ""]
    lines += [
        f"{'*' if each in critical else ' '}{plan.schedule[each]:8.3f} s  {spelling.instant(net.transitions[each])}"
        for each in by_time
    ]
    for heading, ties in _ties(plan, spelling).items():
        lines += ["", heading, *ties] if ties else []
    lines += [""] if plan.natural else []
    lines += [f"ends when something takes its place, or with the block: {id}" for id in sorted(plan.natural)]
    limited = [each for each in plan.block.behaviors if isinstance(each, Event) and each.limit is not None]
    lines += [""] if limited else []
    lines += [f"may be answered for {each.limit:g} s: {each.id}" for each in limited]
    return "\n".join(lines) + "\n"


def _ties(plan: Plan, spelling: Spelling) -> dict[str, list[str]]:
    """Lines for the ties between instants, each once, under headings: those that the block asks for, and the others.

    A lower and an upper limit that are equal are one instant.
    """
    net = plan.net
    end = len(net.transitions) - 1
    said: dict[str, None] = {}
    added: dict[str, None] = {}
    limits: dict[tuple[int, int, Seconds], set[int]] = {}
    for bound in net.bounds:
        if bound.kind != "phase":
            limits.setdefault((bound.target, bound.source, -bound.lag), set()).update(bound.lines)
    for place in net.places:
        if place.kind in ("phase", "idle"):
            continue
        tie = (place.source, place.target, place.lag)
        if (limit := limits.pop(tie, None)) is not None:
            said[_tie(net, spelling, "at", tie, {*place.lines, *limit})] = None
        elif place.source:
            is_added = place.kind in ADDED or (place.target == end and not place.lines)
            (added if is_added else said)[_tie(net, spelling, "no earlier than", tie, place.lines)] = None
    for tie, lines in limits.items():
        said[_tie(net, spelling, "no later than", tie, lines)] = None
    return {"what the block says:": [*said], "what the planner adds:": [each for each in added if each not in said]}


def _tie(net: PetriNet, spelling: Spelling, how: str, tie: tuple[int, int, Seconds], lines: Iterable[int]) -> str:
    """Write `  g:end  no later than  bml:start +2 s  (line 4)`. tie: since which instant, to which, and seconds."""
    since, to, seconds = tie
    one, other = (spelling.instant(net.transitions[each]) for each in (to, since))
    told = ", ".join(map(str, sorted(lines)))
    because = f"  (line{'s' * (',' in told)} {told})" if told else ""
    offset = f" {seconds:+g} s" if seconds else ""
    return f"  {one}  {how}  {other}{offset}{because}"


def as_json(plan: Plan) -> str:
    """Everything: transitions with their times, places with the initial marking, bounds, behaviors, problems.

    Sync points are named as the block spells them.
    """
    net, spelling = plan.net, Spelling(plan.block)
    document = {
        "block": plan.block.id,
        "transitions": [
            {
                "name": spelling.instant(transition),
                "points": list(dict.fromkeys(map(spelling, transition.points))),
                "time": round(time, 6),
            }
            for transition, time in zip(net.transitions, plan.schedule, strict=True)
        ],
        "places": [asdict(place) | {"tokens": tokens} for place, tokens in zip(net.places, net.initial, strict=True)],
        "bounds": [asdict(bound) for bound in net.bounds],
        "critical": list(plan.critical),
        "live": is_live(net),
        "safe": is_safe(net),
        "behaviors": {
            id: {spelling.sync(point): round(plan.predicted(point), 6) for point in chain.points}
            for id, chain in plan.chains.items()
        },
        "natural": sorted(plan.natural),
        "dropped": list(plan.dropped),
        "given_up": list(plan.given_up),
        "problems": [
            {"kind": problem.kind, "behavior": problem.behavior, "message": problem.message}
            for problem in plan.problems
        ],
    }
    return json.dumps(document, indent=2, ensure_ascii=False)


def as_message(plan: Plan) -> NetPlanned:
    """The net as watchers are told of it, before the block has begun: with its initial marking."""
    return described(plan, Stamp("", 0.0), plan.net.initial, {}, Spelling(plan.block))


def as_pnml(plan: Plan) -> str:
    """The net as a P/T net of ISO/IEC 15909-2, with the drafts' names."""
    return net_as_pnml(plan.net, plan.block.id)


def as_dot(plan: Plan) -> str:
    """The net for Graphviz: bars are transitions (framed if critical), circles places, dashed arrows bounds."""
    net, spelling = plan.net, Spelling(plan.block)
    critical = frozenset(plan.critical)
    lines = [f"digraph {_quoted(plan.block.id)} {{", "  rankdir=LR;", '  node [fontname="sans-serif", fontsize=10];']
    for number, transition in enumerate(net.transitions):
        label = _quoted(f"{spelling.instant(transition)}\n{plan.schedule[number]:.2f} s")
        frame = 2 if number in critical else 0.5
        lines.append(f"  t{number} [shape=box, style=filled, fillcolor=gray85, penwidth={frame}, label={label}];")
    for number, place in enumerate(net.places):
        text = "●" if net.initial[number] else f"{place.lag:.3g}" if place.lag else ""
        constraint = ", constraint=false" if place.kind == "idle" else ""
        lines.append(f"  p{number} [shape=circle, label={_quoted(text)}, tooltip={_quoted(place.kind)}];")
        lines.append(f"  t{place.source} -> p{number}; p{number} -> t{place.target} [style=solid{constraint}];")
    for bound in net.bounds:
        if bound.kind != "phase":
            label = _quoted(f"{bound.lag:g}")
            lines.append(f"  t{bound.source} -> t{bound.target} [style=dashed, constraint=false, label={label}];")
    return "\n".join((*lines, "}")) + "\n"


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)


PNML = "http://www.pnml.org/version-2009/grammar/pnml"
PT_NET = "http://www.pnml.org/version-2009/grammar/ptnet"
TOOL, VERSION = "engage", "1"
OURS = "urn:engage:net:1"


def net_as_pnml(net: PetriNet, name: str = "") -> str:
    """The net as PNML (ISO/IEC 15909-2), one page. Equal nets give equal documents."""
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
            {**_tie_attributes(place), "shortest": repr(place.shortest), "after": place.after},
        )
        _child(page, "arc", id=f"i{number}", source=f"t{place.source}", target=f"p{number}")
        _child(page, "arc", id=f"o{number}", source=f"p{number}", target=f"t{place.target}")
    if net.bounds:
        extra = _extension(element)
        for bound in net.bounds:
            stretch = {} if bound.stretch is None else {"stretch": repr(bound.stretch)}
            ends = {"source": f"t{bound.source}", "target": f"t{bound.target}"}
            etree.SubElement(extra, of_ours("bound"), {**ends, **_tie_attributes(bound), **stretch})
    etree.indent(root)
    return etree.tostring(root, xml_declaration=True, encoding="UTF-8").decode()


def _tie_attributes(tie: Place | Bound) -> dict[str, str]:
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
