"""The net that runs: its marking is the one that plan, reports and time give, computed here from the definition."""

import random
from collections.abc import Mapping
from math import inf

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engage_hri.schemas.behaviors import Event, Gaze, Gesture, Mark, Pointing, Speech, Wait
from engage_hri.schemas.blocks import Block
from engage_hri.services.realizer.config import RealizerConfig
from engage_hri.services.realizer.decide.decisions import Decisions
from engage_hri.services.realizer.net.petri_net import Place
from engage_hri.services.realizer.net.running import RunningNet
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.plan.planner import plan_block
from engage_hri.services.realizer.points import Point
from tests.random_cases import share_of
from tests.realizer.fake_body import FakeBody
from tests.realizer.player import Player
from tests.realizer.stage import after, block, together
from tests.realizer.test_forecast import planned
from tests.realizer.test_properties import blocks


def gates_of(plan: Plan) -> dict[tuple[str, int], Point]:
    """For each behavior and transition, the point at which the behavior passes it."""
    return {
        (member.behavior, number): member.point for number, members in enumerate(plan.members) for member in members
    }


def fired_by(plan: Plan, began: float, reached: Mapping[Point, float], now: float) -> dict[int, float]:
    """When each transition has fired, by the definition: all its behaviors, and all ripe tokens before it."""
    end = len(plan.net.transitions) - 1
    fired = {0: began}
    gates = gates_of(plan)

    def put_at(place: Place) -> float:
        if place.after:
            return reached.get(gates[place.after, place.source], inf)
        return fired.get(place.source, inf)

    leading, arcs = (
        {end},
        [(each.source, each.target) for each in plan.net.places if each.kind not in ("idle", "handover")],
    )
    while more := {source for source, target in arcs if target in leading} - leading:
        leading |= more
    changed = True
    while changed:
        changed = False
        for transition in range(1, end + 1):
            if transition in fired:
                continue
            if transition == end:
                times = [fired.get(each) for each in leading - {end}]
            else:
                times = [reached.get(member.point) for member in plan.members[transition]]
                for place in plan.net.places:
                    if place.target == transition and place.kind in ("order", "delay", "series"):
                        ripe = put_at(place) + place.lag
                        times.append(ripe if ripe <= now + 1e-6 else None)
            if None not in times:
                fired[transition] = max(each for each in times if each is not None)
                changed = True
    return fired


def marking_by(plan: Plan, began: float, reached: Mapping[Point, float], now: float) -> bytes:
    """Tokens by the definition: in a phase between its two points, elsewhere between its two transitions."""
    fired = fired_by(plan, began, reached, now)
    gates = gates_of(plan)
    tokens = []
    for place in plan.net.places:
        if place.kind == "phase":
            since, to = (gates[place.behavior, each] for each in (place.source, place.target))
            tokens.append(since in reached and to not in reached)
        elif place.kind == "idle":
            tokens.append(place.target not in fired or place.source in fired)
        else:
            has_come = place.source in fired if not place.after else gates[place.after, place.source] in reached
            tokens.append(has_come and place.target not in fired)
    return bytes(tokens)


def check(decisions: Decisions, now: float) -> None:
    decisions.net.tick(now)
    reached = decisions.facts.reached
    assert decisions.net.marking == marking_by(decisions.plan, decisions.began, reached, now)
    assert decisions.net.fired == pytest.approx(fired_by(decisions.plan, decisions.began, reached, now))


@settings(max_examples=share_of(60), deadline=None)
@given(
    blocks(),
    st.sampled_from(((1.0, 1.0), (0.5, 3.0))),
    st.dictionaries(st.sampled_from(("g", "p-left", "s1", "s3", "nod")), st.sampled_from((0.5, 1.25, 2.0, 3.0))),
)
def test_at_any_time_the_marking_is_the_one_that_the_reports_give(
    made: Block, elastic: tuple[float, float], slow: dict[str, float]
) -> None:
    if (plan := planned(made, elastic)) is None:
        return
    player = Player(plan, lambda id: slow.get(id, 1.0), lambda decisions: check(decisions, player.now))
    player.play()
    net = player.decisions.net

    assert set(net.fired) >= set(range(len(plan.members))) - {
        plan.at[Point(id, "end")] for id in plan.chains.keys() - plan.waited_for
    }
    net.let_go()
    assert net.marking == plan.net.initial
    net.clear()
    assert not any(net.marking)


@settings(max_examples=share_of(60), deadline=None)
@given(blocks(), st.integers(0, 10_000))
def test_the_marking_stays_true_when_reports_lie_and_behaviors_are_dropped(made: Block, seed: int) -> None:
    """Reports at random, in any order; what is dropped, and what is held, at random, too."""
    chance, now = random.Random(seed), 0.0
    if (plan := planned(made, (0.5, 3.0))) is None or not plan.chains:
        return
    decisions = Decisions(plan, 0.0, RealizerConfig())
    points = [point for chain in plan.chains.values() for point in chain.points]
    for _ in range(40):
        now += chance.choice((0.0, 0.0, 0.2, 1.0))
        decisions.advance(now)
        match chance.randrange(6):
            case 0 | 1 | 2:
                decisions.reach(chance.choice(points), now)
            case 3:
                decisions.arrive(chance.choice(points), now)
            case 4 if len(decisions.plan.chains) > 1:
                gone = (*decisions.plan.dropped, chance.choice(sorted(decisions.plan.chains)))
                decisions.replan(plan_block(made, plan.estimates.values(), dropped=gone))
        check(decisions, now)


def test_the_clock_of_a_place_counts_from_the_measured_instant_and_stops_while_it_is_held() -> None:
    made = block((Wait(id="w", duration=1.0), Wait(id="v", duration=1.0)), together("w:end+2", "v:start"))
    decisions = Decisions(plan_block(made), 0.0, RealizerConfig())

    def begun(now: float) -> bool:
        decisions.advance(now)
        return "v" in decisions.facts.begun

    assert not begun(0.0)
    decisions.reach(Point("w", "start"), 0.0)
    decisions.reach(Point("w", "end"), 1.5)  # half a second late
    assert not begun(3.4)
    decisions.hold(None, 3.4)
    assert not begun(9.0)
    decisions.hold((), 10.0)
    assert not begun(10.05)
    assert begun(10.1)


def test_the_tokens_of_a_figure_move_one_by_one() -> None:
    """Fig. 4.8: a gaze, a point that begins on target, words that begin with the stroke."""
    made = block(
        (
            Gaze(id="gaze-1", target="can-1"),
            Pointing(id="point-1", target="can-1", mode="RIGHT_HAND"),
            Speech(id="speech-1", text="This can?"),
        ),
        together("gaze-1:stroke", "point-1:start"),
        together("point-1:stroke_start", "speech-1:start"),
    )
    body = FakeBody()
    plan = plan_block(made, [body.estimate(each) for each in made.behaviors])
    seen: list[tuple[str, ...]] = []

    def note(decisions: Decisions) -> None:
        now = tuple(
            sorted(
                f"{place.behavior}>{plan.net.transitions[place.target].name}"
                for place, tokens in zip(plan.net.places, decisions.net.marking, strict=True)
                if tokens and place.kind == "phase"
            )
        )
        if not seen or seen[-1] != now:
            seen.append(now)

    Player(plan, after_each=note).play()

    look = "gaze-1>gaze-1:stroke_end = gaze-1:relax"
    assert seen == [
        ("gaze-1>gaze-1:stroke = point-1:start",),
        (look, "point-1>point-1:ready"),
        (look, "point-1>point-1:stroke_start = speech-1:start"),
        (look, "point-1>point-1:stroke", "speech-1>speech-1:end"),
        (look, "point-1>point-1:stroke_end", "speech-1>speech-1:end"),
        (look, "point-1>point-1:relax", "speech-1>speech-1:end"),
        (look, "point-1>point-1:relax"),
        (look, "point-1>point-1:end"),
        (look,),
        ("gaze-1>gaze-1:end",),
    ]


def test_a_word_that_cannot_wait_goes_on_and_the_instant_fires_with_the_last() -> None:
    made = block(
        (
            Gesture(id="beat", lexeme="BEAT", mode="RIGHT_HAND"),
            Speech(id="s", text="one two", marks=(Mark("m", 3),)),
        ),
        together("beat:stroke", "s:m"),
        after("beat:stroke", "s:end"),
    )
    plan = plan_block(made, [FakeBody().estimate(each) for each in made.behaviors])
    decisions = Decisions(plan, 0.0, RealizerConfig())
    decisions.advance(0.0)
    decisions.advance(10.0)
    for id in ("beat", "s"):
        decisions.reach(Point(id, "start"), 10.0)
    decisions.reach(Point("s", "m"), 11.0)
    word = plan.at[Point("s", "m")]

    assert word not in decisions.net.fired
    decisions.reach(Point("s", "end"), 11.5)
    assert not any(
        tokens and place.behavior == "s" and place.kind == "phase"
        for place, tokens in zip(plan.net.places, decisions.net.marking, strict=True)
    )
    decisions.reach(Point("beat", "stroke"), 12.0)

    assert decisions.net.fired[word] == 12.0
    assert decisions.net.fired[plan.at[Point("s", "end")]] == 12.0
    assert decisions.net.passed[plan.at[Point("s", "end")]] == 11.5


def test_an_event_that_is_decided_before_its_instant_fires_leaves_the_initial_marking() -> None:
    made = block(
        (
            Speech(id="s", text="one two"),
            Event(id="e", kind="directed_gaze", responder="human", objects=("blue-square",)),
        ),
        together("s:start", "e:start"),
    )
    plan = plan_block(made, [FakeBody().estimate(made.behaviors[0])])
    net = RunningNet(plan.net, plan.members, plan.at)
    net.start(0.0)
    for id in ("e", "s"):
        net.begin(id, 0.0)
    for number, point in enumerate((Point("e", "start"), Point("e", "end"), Point("s", "start"), Point("s", "end"))):
        net.reach(point, number / 10)

    assert any(place.kind == "idle" and place.behavior == "e" for place in plan.net.places)
    assert net.is_over
    assert net.marking == plan.net.initial
