"""Nets as data: small random nets, played through marking by marking; and the words and drawings of a plan."""

import json
import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from engage_hri.schemas.behaviors import Gaze, Pointing, Speech, Wait
from engage_hri.services.realizer.export import as_dot, as_json, as_message, as_text, net_as_pnml
from engage_hri.services.realizer.net.petri_net import (
    Bound,
    PetriNet,
    Place,
    Transition,
    fire_once_each,
    is_live,
    is_safe,
    order,
)
from engage_hri.services.realizer.points import Point
from tests.random_cases import share_of
from tests.realizer.firing import enabled, fire
from tests.realizer.planning import at, plan, timed
from tests.realizer.pnml_reader import read_pnml
from tests.realizer.stage import after, before, block, together


@st.composite
def marked(draw: st.DrawFn) -> PetriNet:
    """Up to five transitions, tied anyhow; every one has an input, so that no place can fill up for ever at once."""
    size = draw(st.integers(2, 5))
    ends = st.integers(0, size - 1)
    ties = draw(st.lists(st.tuples(ends, ends, st.booleans()), max_size=6))
    ring = [(each, (each + 1) % size, each == size - 1) for each in range(size)] if draw(st.booleans()) else []
    places = tuple(Place("idle" if has_token else "order", a, b) for a, b, has_token in (*ring, *ties) if a != b)
    return PetriNet(tuple(Transition(str(each), ()) for each in range(size)), places)


def step(net: PetriNet, marking: tuple[int, ...]) -> dict[int, tuple[int, ...]]:
    """The marking after each transition that can fire."""
    found = {}
    for transition in range(len(net.transitions)):
        if all(marking[n] for n, place in enumerate(net.places) if place.target == transition):
            found[transition] = tuple(
                tokens - (place.target == transition) + (place.source == transition)
                for tokens, place in zip(marking, net.places, strict=True)
            )
    return found


def cycles_hold_tokens(net: PetriNet) -> bool:
    """Is there no way round through empty places alone?"""
    empty = {(place.source, place.target) for place in net.places if place.kind != "idle"}
    for _ in net.transitions:
        empty |= {(a, d) for a, b in empty for c, d in empty if b == c}
    return all(a != b for a, b in empty)


@settings(max_examples=share_of(200), deadline=None)
@given(marked(), st.lists(st.integers(0, 4), max_size=8))
def test_the_game_of_tokens_is_played_by_its_rules(net: PetriNet, wishes: list[int]) -> None:
    marking = tuple(int(place.kind == "idle") for place in net.places)
    assert tuple(net.initial) == marking
    for wish in wishes:
        possible = step(net, marking)
        assert enabled(net, bytes(marking)) == tuple(possible)
        assert enabled(net, bytes(marking), (0, 1)) == tuple(each for each in possible if each < 2)
        if wish in possible:
            assert tuple(fire(net, bytes(marking), wish)) == possible[wish]
            marking = possible[wish]
        elif wish < len(net.transitions):
            place = next(n for n, it in enumerate(net.places) if it.target == wish and not marking[n])
            with pytest.raises(ValueError, match=f"'{wish}' is not enabled: place {place} is empty"):
                fire(net, bytes(marking), wish)
        if max(marking, default=0) > 200:
            return
    start, fired = marking, list[int]()
    while ready := [each for each in step(net, marking) if each not in fired]:
        marking = step(net, marking)[ready[0]]
        fired.append(ready[0])
    found = fire_once_each(net, bytes(start))
    assert sorted(found.fired) == sorted(fired)
    assert tuple(found.marking) == marking


@settings(max_examples=share_of(200), deadline=None)
@given(marked(), st.sets(st.integers(0, 4), max_size=2))
def test_what_lives_and_what_is_safe_is_what_the_game_says(net: PetriNet, sources: set[int]) -> None:
    sources = {each for each in sources if each < len(net.transitions)}
    assert is_live(net) == cycles_hold_tokens(net)
    found = order(net)
    assert (found is not None) == is_live(net)
    if found is not None:
        rank = {each: number for number, each in enumerate(found)}
        assert all(rank[it.source] < rank[it.target] for it in net.places if it.kind != "idle")
    later = set(sources)
    for _ in net.transitions:
        later |= {it.target for it in net.places if it.kind != "idle" and it.source in later}
    assert net.later(sources) == later
    if is_live(net):
        seen, todo = set[tuple[int, ...]](), [tuple(net.initial)]
        while todo and len(seen) < 400 and max(todo[-1], default=0) < 2:
            here = todo.pop()
            seen.add(here)
            todo += [each for each in step(net, here).values() if each not in seen]
        if len(seen) < 400:
            assert is_safe(net) == (not todo)
    else:
        assert not is_safe(net)


SECONDS = st.sampled_from((0.0, 0.1 + 0.2, 1 / 3, 2.0))
NAMES = st.sampled_from(("", "a", "s:m-1", "<é>&"))
LINES = st.sampled_from(((), (3,), (3, 14)))


@st.composite
def any_nets(draw: st.DrawFn) -> PetriNet:
    size = draw(st.integers(1, 4))
    ends = st.integers(0, size - 1)
    points = st.lists(st.tuples(NAMES, NAMES).map(lambda each: Point(*each)), max_size=2).map(tuple)
    kinds = st.sampled_from(("phase", "delay", "order", "series", "handover", "idle"))
    places = st.builds(Place, kinds, ends, ends, SECONDS, SECONDS, NAMES, LINES)
    bounds = st.builds(Bound, kinds, ends, ends, SECONDS, st.one_of(st.none(), SECONDS), NAMES, LINES)
    return PetriNet(
        tuple(draw(st.lists(st.builds(Transition, NAMES, points), min_size=size, max_size=size))),
        tuple(draw(st.lists(places, max_size=5))),
        tuple(draw(st.lists(bounds, max_size=3))),
    )


@settings(max_examples=share_of(100), deadline=None)
@given(any_nets(), NAMES)
def test_any_net_comes_back_from_pnml_equal(net: PetriNet, name: str) -> None:
    document = net_as_pnml(net, name)

    assert read_pnml(document) == net == read_pnml(document.encode())
    assert document.count("initialMarking") == 2 * sum(place.kind == "idle" for place in net.places)


def test_what_another_version_or_tool_has_added_is_passed_over() -> None:
    net = PetriNet((Transition("x", ()), Transition("y", ())), (Place("order", 0, 1, 2.0, 2.0), Place("idle", 1, 0)))
    plain = replace(net, places=(Place("order", 0, 1), Place("idle", 1, 0)))
    document = net_as_pnml(net)

    assert read_pnml(document) == net
    for old, new in (('tool="engage" version="1"', 'tool="engage" version="2"'), ('tool="engage"', 'tool="other"')):
        assert read_pnml(document.replace(old, new)) == plain


# -- words and drawings ------------------------------------------------------------------------------------------

BEHAVIORS = (
    Gaze(id="g", target="can"),
    timed(Pointing(id="p", target="can"), start="1.5"),
    Speech(id="s", text="This can?", line=4),
    Speech(id="t", text="Or that?", line=5),
)
EXAMPLE = block(BEHAVIORS, after("p:stroke+0.25", "s:start"), before("p:end+2", "t:start"), id="ex")


def test_what_is_one_instant_is_told_once_and_not_as_two_limits() -> None:
    """A fixed time, points so many seconds apart, and what two constraints say of the same points."""
    behaviors = (
        Wait(id="v", duration=1.0),
        timed(Wait(id="w"), start="v:start+0.5", end="4"),
        Wait(id="x", duration=1.0),
    )
    ordered = (after("v:end+2", "x:start"), before("v:end+2", "x:start"))
    lines = as_text(plan(block(behaviors, *ordered))).splitlines()
    said = [
        line for line in lines if any(how in line for how in ("  at  ", "  no earlier than  ", "  no later than  "))
    ]
    assert [line for line in said if not line.startswith("  bml:end")] == [
        "  w:end  at  bml:start +4 s", "  w:start  at  v:start +0.5 s", "  x:start  at  v:end +2 s",
    ]  # fmt: skip


def test_a_plan_in_words() -> None:
    """Each instant with its time, in order, a star on the critical path; ties with seconds and lines; what lasts."""
    made = plan(EXAMPLE)
    names = [each.name for each in made.net.transitions]
    lines = as_text(made).splitlines()
    assert lines[0] == f"block ex: {len(names)} transitions, {len(made.net.places)} places, live, safe"
    first, second, *_ = (number for number, line in enumerate(lines) if not line)
    shown = [re.fullmatch(r"([* ])\s*(\d+\.\d{3}) s  (.*)", line) for line in lines[first + 1 : second]]
    told = [(float(each[2]), each[3], each[1] == "*") for each in shown if each]
    assert len(told) == len(names) == second - first - 1
    assert [each[0] for each in told] == sorted(each[0] for each in told)
    for time, name, is_critical in told:
        number = names.index(name)
        assert time == pytest.approx(made.schedule[number], abs=5e-4)
        assert is_critical == (number in made.critical)
    ties = [line for line in lines[second + 1 : -1] if line.startswith("  ")]
    assert "  s:start  no earlier than  p:stroke +0.25 s" in ties
    assert "  t:start  no later than  p:end +2 s" in ties
    assert "  p:start  at  bml:start +1.5 s" in ties
    assert "  t:start  no earlier than  s:end  (line 5)" in ties
    assert not [line for line in ties if line.startswith("  p:ready") or "no earlier than  bml:start" in line]
    assert len(ties) == len({place for place in made.net.places if place.kind in ("order", "series") and place.source}
                            | {bound for bound in made.net.bounds if bound.kind != "phase"})  # fmt: skip
    assert len(ties) == len(set(ties))
    assert lines[second + 1] == "what the block says:"
    added = lines[lines.index("what the planner adds:") + 1 : -2]
    assert "  t:start  no earlier than  s:end  (line 5)" in added
    assert "  p:start  at  bml:start +1.5 s" not in added
    assert lines[-1] == "ends when something takes its place, or with the block: g"


def test_a_plan_as_a_drawing_has_every_place_bound_and_token() -> None:
    made = plan(EXAMPLE)
    drawing, net = as_dot(made), made.net
    assert drawing.startswith('digraph "ex" {\n')
    for number, transition in enumerate(net.transitions):
        width = 2 if number in made.critical else 0.5
        label = json.dumps(f"{transition.name}\n{made.schedule[number]:.2f} s", ensure_ascii=False)
        assert f"t{number} [shape=box, style=filled, fillcolor=gray85, penwidth={width}, label={label}];" in drawing
    for number, place in enumerate(net.places):
        text = "●" if place.kind == "idle" else f"{place.lag:.3g}" if place.lag else ""
        assert f'p{number} [shape=circle, label="{text}", tooltip="{place.kind}"];' in drawing
        loose = ", constraint=false" if place.kind == "idle" else ""
        arcs = f"t{place.source} -> p{number}; p{number} -> t{place.target} [style=solid{loose}];"
        assert arcs in drawing
    dashed = re.findall(r't(\d+) -> t(\d+) \[style=dashed, constraint=false, label="(.*)"\]', drawing)
    bounds = [bound for bound in net.bounds if bound.kind != "phase"]
    assert [(int(a), int(b), float(lag)) for a, b, lag in dashed] == [(it.source, it.target, it.lag) for it in bounds]
    assert bounds


def test_a_plan_as_data_and_as_a_message_says_the_same() -> None:
    dropped = timed(Pointing(id="q", target="can", mode="LEFT_HAND"), start="0", stroke="0.1")
    late = timed(Speech(id="u", text="so"), start="0", end="0.25")
    made = plan(block((*BEHAVIORS, dropped, late), together("g:stroke", "s:start"), id="ex"))
    document, message = json.loads(as_json(made)), as_message(made)
    assert (document["block"], message.block) == ("ex", "ex")
    assert [each["time"] for each in document["transitions"]] == [round(each, 6) for each in made.schedule]
    assert [each.time for each in message.transitions] == list(made.schedule)
    for told, shown, transition in zip(
        document["transitions"], message.transitions, made.net.transitions, strict=True
    ):
        assert told["name"] == transition.name
        assert told["points"] == [str(each) for each in transition.points]
        spelled = [f"{each.behavior or 'bml'}:{each.sync}" for each in shown.points]
        assert spelled == (told["points"] or ["bml:end"])
    for number, (place, tie) in enumerate(zip(document["places"], made.net.places, strict=True)):
        assert (place["kind"], place["source"], place["target"], place["lag"]) == (
            tie.kind, tie.source, tie.target, tie.lag,
        )  # fmt: skip
        assert place["tokens"] == int(number in message.marked) == int(tie.kind == "idle")
    assert len(document["bounds"]) == len(made.net.bounds)
    assert document["behaviors"]["p"]["stroke"] == at(made, "p:stroke")
    assert (document["dropped"], document["given_up"], document["natural"]) == (["q"], ["u"], ["g"])
    assert [each["behavior"] for each in document["problems"]] == [each.behavior for each in made.problems]
    assert (document["live"], document["safe"], message.fired) == (True, True, ())
