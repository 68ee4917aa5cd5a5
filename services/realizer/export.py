"""A plan for people and programs: text, JSON, a drawing of its net (DOT), and the net for other tools (PNML)."""

import json
from collections.abc import Iterable, Iterator

from msgspec.structs import asdict

from engage_hri.schemas.nets import NetPlanned
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.realizer.net import pnml
from engage_hri.services.realizer.net.petri_net import is_live, is_safe
from engage_hri.services.realizer.perform.net_message import described
from engage_hri.services.realizer.plan.plan import Plan


def as_text(plan: Plan) -> str:
    """The schedule, instant by instant, then what ties the instants, then what was dropped.

    A star marks the critical path: what makes the block as long as it is.
    """
    net = plan.net
    by_time = sorted(range(len(net.transitions)), key=lambda each: (plan.schedule[each], each))
    soundness = ("live" if is_live(net) else "NOT live") + (", safe" if is_safe(net) else ", NOT safe")
    size = f"{len(net.transitions)} transitions, {len(net.places)} places"
    critical = frozenset(plan.critical)
    lines = [f"block {plan.block.id}: {size}, {soundness}", ""]
    lines += [
        f"{'*' if each in critical else ' '}{plan.schedule[each]:8.3f} s  {net.transitions[each].name}"
        for each in by_time
    ]
    ties = list(_ties(plan))
    lines += ["", *ties] if ties else []
    lines += [f"ends when something takes its place, or with the block: {id}" for id in sorted(plan.natural)]
    return "\n".join(lines) + "\n"


def _ties(plan: Plan) -> Iterator[str]:
    """A line for each tie between instants; a lower and an upper limit that are equal are one instant."""
    net = plan.net
    limits: dict[tuple[int, int, Seconds], set[int]] = {}
    for bound in net.bounds:
        if bound.kind != "phase":
            limits.setdefault((bound.target, bound.source, -bound.lag), set()).update(bound.lines)
    for place in net.places:
        if place.kind in ("phase", "idle"):
            continue
        if (limit := limits.pop((place.source, place.target, place.lag), None)) is not None:
            yield _tie(plan, place.target, "at", place.source, place.lag, {*place.lines, *limit})
        elif place.source:
            yield _tie(plan, place.target, "no earlier than", place.source, place.lag, place.lines)
    for (source, target, lag), said in limits.items():
        yield _tie(plan, target, "no later than", source, lag, said)


def _tie(plan: Plan, one: int, how: str, other: int, seconds: Seconds, lines: Iterable[int]) -> str:
    """Write `  g:end  no later than  bml:start +2 s  (line 4)`."""
    names = plan.net.transitions
    said = ", ".join(map(str, sorted(lines)))
    because = f"  (line {said})" if said else ""
    offset = f" {seconds:+g} s" if seconds else ""
    return f"  {names[one].name}  {how}  {names[other].name}{offset}{because}"


def as_json(plan: Plan) -> str:
    """Everything: transitions with their times, places with the initial marking, bounds, behaviors, problems."""
    net = plan.net
    document = {
        "block": plan.block.id,
        "transitions": [
            {"name": transition.name, "points": list(map(str, transition.points)), "time": round(time, 6)}
            for transition, time in zip(net.transitions, plan.schedule, strict=True)
        ],
        "places": [asdict(place) | {"tokens": tokens} for place, tokens in zip(net.places, net.initial, strict=True)],
        "bounds": [asdict(bound) for bound in net.bounds],
        "critical": list(plan.critical),
        "live": is_live(net),
        "safe": is_safe(net),
        "behaviors": {
            id: {point.sync: round(plan.predicted(point), 6) for point in chain.points}
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
    return described(plan, Stamp("", 0.0), plan.net.initial, {})


def as_pnml(plan: Plan) -> str:
    """The net as a P/T net of ISO/IEC 15909-2; `pnml.read_pnml` reads it back."""
    return pnml.as_pnml(plan.net, plan.block.id)


def as_dot(plan: Plan) -> str:
    """The net for Graphviz: bars are transitions (framed if critical), circles places, dashed arrows bounds."""
    net = plan.net
    critical = frozenset(plan.critical)
    lines = [f"digraph {_quoted(plan.block.id)} {{", "  rankdir=LR;", '  node [fontname="sans-serif", fontsize=10];']
    for number, transition in enumerate(net.transitions):
        label = _quoted(f"{transition.name}\n{plan.schedule[number]:.2f} s")
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
