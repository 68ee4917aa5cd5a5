"""Random blocks: every one ends exactly once, what it asked for holds in what was measured, and its net is live.

The oracle knows neither nets nor classes: it relaxes inequalities between single points until nothing moves.
"""

import asyncio
from itertools import pairwise

from hypothesis import example, given, settings
from hypothesis import strategies as st
from msgspec import Struct

from engage_hri.schemas.behavior_types import sync_points
from engage_hri.schemas.behaviors import (
    After,
    Before,
    BlockBehavior,
    Constraint,
    Gaze,
    Gesture,
    Head,
    Mark,
    Pointing,
    Speech,
    Synchronize,
    Wait,
)
from engage_hri.schemas.blocks import Block, BlockOutcome
from engage_hri.schemas.references import SyncRef
from engage_hri.services.realizer.config import RealizerConfig
from engage_hri.services.realizer.net.petri_net import is_live
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.plan.planner import plan_block
from engage_hri.services.realizer.plan.relations import BlockRefused
from engage_hri.services.realizer.points import Point
from engage_hri.services.requests.ends import RequestRefused
from engage_hri.services.runtime.virtual_time import run_virtual
from tests.random_cases import share_of
from tests.realizer.fake_body import HOLDS, FakeBody, Script, natural_durations, type_of
from tests.realizer.firing import enabled, fire
from tests.realizer.stage import stage

OFFSETS = (-1.0, 0.0, 0.0, 0.0, 0.5, 2.0)


class Seen(Struct):
    outcome: BlockOutcome | None
    times: dict[str, float]
    ends: int
    warnings: list[str]
    stops: list[str]
    left: int


@st.composite
def behaviors(draw: st.DrawFn) -> tuple[BlockBehavior, ...]:
    """At most ten, no two of one part but speeches."""
    possible: list[BlockBehavior] = [
        Gaze(id="g", target="a"),
        Pointing(id="p-left", target="a", mode="LEFT_HAND"),
        Pointing(id="p-right", target="b", mode="RIGHT_HAND"),
        Gesture(id="beat", lexeme="BEAT", mode="BOTH_HANDS"),
        Head(id="nod", lexeme="NOD"),
        Speech(id="s1", text="one two", marks=(Mark("m-1", 3),)),
        Speech(id="s2", text="three"),
        Speech(id="s3", text="four five", marks=(Mark("m", 4),)),
        Wait(id="w1", duration=0.75),
        Wait(id="w2", duration=1.5),
    ]
    return tuple(draw(st.lists(st.sampled_from(possible), min_size=1, max_size=10, unique_by=lambda each: each.id)))


@st.composite
def blocks(draw: st.DrawFn) -> Block:
    chosen = draw(behaviors())
    refs = [SyncRef(behavior=each.id, sync=sync) for each in chosen for sync in sync_points(each)]

    def ref() -> str:
        point = draw(st.sampled_from(refs))
        return str(SyncRef(behavior=point.behavior, sync=point.sync, offset=draw(st.sampled_from(OFFSETS))))

    operators: list[Synchronize | After | Before] = []
    for _ in range(draw(st.integers(0, 5))):
        kind = draw(st.sampled_from((Synchronize, After, Before)))
        operators.append(kind(ref=ref(), syncs=tuple(ref() for _ in range(draw(st.integers(1, 2))))))
    return Block(id="b", behaviors=chosen, constraints=(Constraint(operators=tuple(operators)),))


def perform(block: Block, body: FakeBody) -> Seen:
    async def main() -> Seen:
        async with stage(body, config=RealizerConfig()) as seen:
            try:
                outcome = await asyncio.wait_for(seen.ask(block).outcome, 300.0)
            except RequestRefused:
                outcome = None
            await asyncio.sleep(0)
            kinds = [each.kind for each in seen.warnings()]
            ends, stops = len(seen.ends()), list(seen.body.stops)
            result = Seen(outcome, seen.times(), ends, kinds, stops, len(seen.body.acts))  # type: ignore[arg-type]
        others = asyncio.all_tasks() - {asyncio.current_task()}  # type: ignore[arg-type]
        assert not [task for task in others if not task.done()]
        return result

    return run_virtual(main())


def value(text: str, times: dict[str, float], block: Block) -> float:
    point, offset = _split(text, block)
    return times[point] + offset


def broken(block: Block, times: dict[str, float]) -> list[str]:
    """Operators that do not hold in `times`."""
    found = []
    for operator in block.constraints[0].operators:
        ref = value(operator.ref, times, block)
        for text in operator.syncs:
            sync = value(text, times, block)
            holds = {
                Synchronize: abs(sync - ref) < 1e-4,
                After: sync >= ref - 1e-4,
                Before: sync <= ref + 1e-4,
            }[type(operator)]
            if not holds:
                found.append(f"{operator}: {sync} against {ref}")
    return found


def planned(block: Block) -> Plan | None:
    body = FakeBody()
    try:
        return plan_block(block, [body.estimate(each) for each in block.behaviors if not isinstance(each, Wait)])
    except BlockRefused:
        return None


@settings(max_examples=share_of(50), deadline=None)
@given(blocks())
def test_an_exact_body_keeps_every_constraint_of_any_block(block: Block) -> None:
    plan = planned(block)
    seen = perform(block, FakeBody())

    if plan is None:
        assert seen.outcome is None
        return
    assert seen.outcome is not None
    assert seen.ends == 1
    assert seen.left == 0
    if not (plan.dropped or plan.given_up):
        assert broken(block, seen.times) == []
        assert seen.warnings == []


TARGET_AND_AWAY_AT_ONCE = Block(
    id="b",
    behaviors=(Speech(id="s2", text="three"), Gaze(id="g", target="a")),
    constraints=(
        Constraint(
            operators=(
                Synchronize(ref="s2:start", syncs=("g:stroke-1",)),
                Synchronize(ref="g:stroke-1", syncs=("g:stroke_end-1",)),
            )
        ),
    ),
)
"""The gaze may not stay on target, so it cannot wait there: it has to start late enough."""


@settings(max_examples=share_of(30), deadline=None)
@given(blocks())
@example(TARGET_AND_AWAY_AT_ONCE)
def test_an_exact_body_keeps_the_predicted_schedule(block: Block) -> None:
    plan = planned(block)
    if plan is None or plan.dropped or plan.given_up:
        return
    seen = perform(block, FakeBody())

    expected = {f"{point.behavior}:{point.sync}": plan.predicted(point) for point in plan.at if point.behavior}
    assert {name: round(time, 4) for name, time in seen.times.items()} == {
        name: round(time, 4) for name, time in expected.items()
    }


SCRIPTS = st.fixed_dictionaries(
    {},
    optional={
        id: st.sampled_from(
            (Script(slow=2.0), Script(slow=0.5), Script(refuse=True), Script(fail="end"), Script(stall="end"))
        )
        for id in ("g", "p-left", "p-right", "beat", "nod", "s1", "s2")
    },
)


@settings(max_examples=share_of(60), deadline=None)
@given(blocks(), SCRIPTS)
def test_every_block_ends_exactly_once_whatever_the_body_does(block: Block, scripts: dict[str, Script]) -> None:
    seen = perform(block, FakeBody(scripts))

    assert (seen.outcome is None) == (seen.ends == 0)
    assert seen.ends <= 1
    assert seen.left == 0


@settings(max_examples=share_of(100), deadline=None)
@given(blocks(), st.randoms(use_true_random=False))
def test_the_order_of_elements_does_not_change_the_net(block: Block, chance: object) -> None:
    others = list(block.behaviors)
    operators = list(block.constraints[0].operators)
    chance.shuffle(others)  # type: ignore[attr-defined]
    chance.shuffle(operators)  # type: ignore[attr-defined]
    other = Block(
        id="b",
        behaviors=_types_in_order(others, block.behaviors),
        constraints=(Constraint(operators=tuple(operators)),),
    )

    one, two = planned(block), planned(other)
    assert (one is None) == (two is None)
    if one is not None and two is not None and not one.dropped:
        assert one.net == two.net
        assert one.schedule == two.schedule


def _types_in_order(shuffled: list[BlockBehavior], written: tuple[BlockBehavior, ...]) -> tuple[BlockBehavior, ...]:
    """Those of one type, or of the arms, in the order they were written in: it says which follows which."""

    def kind(behavior: BlockBehavior) -> str:
        return "arm" if isinstance(behavior, Pointing | Gesture) else type_of(behavior)

    queues = {kind(each): [other for other in written if kind(other) == kind(each)] for each in written}
    return tuple(queues[kind(each)].pop(0) for each in shuffled)


@settings(max_examples=share_of(100), deadline=None)
@given(blocks())
def test_every_net_is_live_and_holds_one_token_at_most(block: Block) -> None:
    plan = planned(block)
    if plan is None:
        return
    assert is_live(plan.net)

    marking, fired = plan.net.initial, 0
    while fired < len(plan.net.transitions):
        marking = fire(plan.net, marking, enabled(plan.net, marking)[0])
        assert max(marking) == 1
        fired += 1
    assert marking == plan.net.initial


def oracle(block: Block, *, prompt: bool = True) -> dict[str, float] | None:
    """Earliest times by brute force over single points; None if some never settle.

    prompt: a gaze comes on target just in time, as it does where nothing fixes its start; else it may wait there.
    """
    times: dict[str, float] = {}
    lags: list[tuple[str, str, float]] = []
    for behavior in block.behaviors:
        points = [f"{behavior.id}:{sync}" for sync in sync_points(behavior)]
        times |= dict.fromkeys(points, 0.0)
        durations = (behavior.duration or 0.0,) if isinstance(behavior, Wait) else natural_durations(behavior)
        holds = HOLDS.get(type_of(behavior), ("end",) if isinstance(behavior, Wait) else ())
        if isinstance(behavior, Gaze):
            lags.append((f"{behavior.id}:relax", f"{behavior.id}:stroke_end", 0.0))
        for (since, to), seconds in zip(pairwise(points), durations, strict=True):
            lags.append((since, to, seconds))
            held = to.rpartition(":")[2] in holds or (isinstance(behavior, Gaze) and to.endswith(":stroke_end"))
            is_on_target = isinstance(behavior, Gaze) and to.endswith(":stroke")
            if not held or (is_on_target and prompt):
                lags.append((to, since, -seconds))
    for operator in block.constraints[0].operators:
        ref, offset = _split(operator.ref, block)
        for text in operator.syncs:
            sync, other = _split(text, block)
            if not isinstance(operator, Before):
                lags.append((ref, sync, offset - other))
            if not isinstance(operator, After):
                lags.append((sync, ref, other - offset))
    for _ in range(len(times) + 1):
        moved = False
        for since, to, seconds in lags:
            if times[since] + seconds > times[to] + 1e-9:
                times[to], moved = times[since] + seconds, True
        if not moved:
            return times
    return None


def _split(text: str, block: Block) -> tuple[str, float]:
    behavior = next(each for each in block.behaviors if each.id == SyncRef.parse(text).behavior)
    ref = SyncRef.parse(text, [mark.id for mark in getattr(behavior, "marks", ())])
    return f"{ref.behavior}:{ref.sync}", ref.offset


@settings(max_examples=share_of(100), deadline=None)
@given(blocks())
def test_the_schedule_is_the_earliest_there_is(block: Block) -> None:
    """Where no order is put on a point that cannot wait (that waits for a measurement) and no gaze ends by itself."""
    plan = planned(block)
    if plan is None or plan.dropped or plan.given_up or plan.natural or _is_measured_first(plan):
        return
    if {place.kind for place in plan.net.places} & {"series", "handover"}:
        return

    times = {f"{p.behavior}:{p.sync}": round(plan.predicted(p), 6) for p in plan.at if p.behavior}
    expected = oracle(block)
    if expected is None:  # some gaze must wait on its target
        earliest = oracle(block, prompt=False)
        assert earliest is not None
        assert all(times[name] >= round(time, 6) for name, time in earliest.items())
    else:
        assert times == {name: round(time, 6) for name, time in expected.items()}


def _is_measured_first(plan: Plan) -> bool:
    return any(
        place.kind == "order" and place.source != 0 and any(m.kind == "passive" for m in plan.members[place.target])
        for place in plan.net.places
    )


def test_the_oracle_is_asked_often_enough() -> None:
    """Figure 4.4 without its gaze is one of the cases."""
    block = Block(
        id="b",
        behaviors=(Pointing(id="p", target="a"), Speech(id="s", text="this")),
        constraints=(Constraint(operators=(Synchronize(ref="p:stroke_start", syncs=("s:start",)),)),),
    )
    plan = planned(block)
    assert plan is not None

    assert oracle(block) == {f"{p.behavior}:{p.sync}": plan.predicted(p) for p in plan.at if p.behavior}
    assert plan.predicted(Point("s", "start")) == 0.75
