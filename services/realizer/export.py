"""A plan for people and programs, as text and as JSON. Watchers of a running block are told its net in messages."""

import json
from collections.abc import Iterable

from msgspec.structs import asdict

from engage_hri.schemas.behaviors import Event
from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.net.petri_net import PetriNet, is_live, is_safe
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.plan.words import Spelling

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
