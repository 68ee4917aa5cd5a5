"""Two spellings of one block compile to the identical net."""

import re
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from msgspec import structs

from engage_hri.schemas import behaviors as of
from engage_hri.schemas.behavior_types import SYNC_POINTS, dialect_sync
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.documents.dialects import core, in_dialect
from engage_hri.schemas.documents.json_codec import encode_json, read
from engage_hri.schemas.documents.xml_encode import encode_xml
from engage_hri.schemas.faults import InputRefused
from engage_hri.schemas.references import SyncRef, type_name
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.plan.planner import plan_block
from tests.conformance.case import Case, cases
from tests.random_cases import share_of
from tests.schemas.grammar import violations
from tests.schemas.strategies import without_lines

CASES = list(cases(Path(__file__).parent / "cases"))
RULES = {
    case.rule: [each for each in CASES if each.rule == case.rule]
    for case in CASES
    if case.outcome[0] != "refused" and len(case.blocks) == 1
}


def net_of(case: Case) -> object:
    (block,) = read(case.blocks[0].xml.encode())
    assert isinstance(block, Block)
    return _essence(plan_block(block))


def _essence(plan: Plan) -> object:
    kinds = [(problem.kind, problem.behavior) for problem in plan.problems]
    return plan.net, plan.schedule, plan.at, plan.natural, plan.dropped, kinds


@pytest.mark.parametrize("rule", RULES)
def test_the_cases_have_the_same_net_in_each_dialect(rule: str) -> None:
    first, *others = [net_of(case) for case in RULES[rule]]

    assert all(other == first for other in others)


def points(type: str, *, every: bool) -> list[str]:
    """As the drafts spell them. every: also those for which BML 1.0 has only the name of their instant."""
    if type == "speech":
        return ["start", "m-a", "end"]
    if type in ("gazeShift", "wait", "postureShift"):
        return ["start", "end"]
    return [sync for sync in SYNC_POINTS if every or dialect_sync(sync, type, "bml-1.0") is not None]


KINDS: list[of.BlockBehavior] = [
    of.Gaze(id="", target="t"), of.GazeShift(id="", target="t"), of.Pointing(id="", target="t", mode="LEFT_HAND"),
    of.Gesture(id="", lexeme="BEAT"), of.Head(id="", lexeme="NOD"), of.FaceLexeme(id="", lexeme="SMILE"),
    of.FaceFacs(id="", au=12, side="LEFT"), of.Posture(id="", stance="SITTING"), of.PostureShift(id="", stance="X"),
    of.Speech(id="", text="One two", marks=(of.Mark("m-a", 4),)), of.Wait(id="", duration=1.0),
]  # fmt: skip


@st.composite
def any_blocks(draw: st.DrawFn, *, every: bool = False) -> Block:
    """In the drafts' spelling. every: naming also points that BML 1.0 calls otherwise."""
    chosen = draw(st.lists(st.sampled_from(KINDS), min_size=1, max_size=5))
    behaviors = [structs.replace(kind, id=f"x-{number}") for number, kind in enumerate(chosen)]

    def reference() -> str:
        behavior = draw(st.sampled_from(behaviors))
        offset = draw(st.sampled_from([0.0, 0.0, 0.5, -1.0, 2.0]))
        if draw(st.integers(0, 5)) == 0:
            return str(abs(offset))
        sync = draw(st.sampled_from(points(type_name(behavior), every=every)))
        return str(SyncRef(behavior=behavior.id, sync=sync, offset=offset))

    timed = []
    for behavior in behaviors:
        syncs = draw(st.lists(st.sampled_from(points(type_name(behavior), every=every)), max_size=1))
        timed.append(structs.replace(behavior, timing=tuple(of.Timing(sync, reference()) for sync in syncs)))
    operators = [
        draw(st.sampled_from([of.Synchronize, of.After, of.Before]))(ref=reference(), syncs=(reference(),))
        for _ in range(draw(st.integers(0, 2)))
    ]
    constraints = (of.Constraint(operators=tuple(operators)),) if operators else ()
    return Block(id="b", behaviors=tuple(timed), constraints=constraints)


def verdict(data: bytes) -> object:
    """The plan, or on which line there is none."""
    (block,) = read(data)
    assert isinstance(block, Block)
    return _verdict(block)


def meaning(data: bytes) -> object:
    """The plan, wherever its XML has which line, or why there is none."""
    (block,) = read(data)
    assert isinstance(block, Block)
    return _verdict(without_lines(block))


def _verdict(block: Block) -> object:
    try:
        return _essence(plan_block(block))
    except InputRefused as error:
        return error.fault.line, re.sub(r"'[^']*'|:\w+", "", error.fault.reason)  # each dialect has names of its own


@settings(max_examples=share_of(80), deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(any_blocks())
def test_any_block_has_the_same_net_in_each_dialect(block: Block) -> None:
    draft = encode_xml(block)
    expected = verdict(draft)

    assert verdict(draft.replace(b' xmlns="org.mindmakers.bml"', b"")) == expected
    (read_back,) = read(draft)
    assert verdict(encode_json(read_back)) == expected
    assert meaning(encode_xml(in_dialect(block, "bml-1.0"))) == meaning(draft)
    assert meaning(encode_xml(in_dialect(in_dialect(block, "bml-1.0"), "draft"))) == meaning(draft)


@settings(max_examples=share_of(80), deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(any_blocks(every=True))
def test_any_block_is_bml_1_0_once_spelled_so(block: Block) -> None:
    written = encode_xml(in_dialect(block, "bml-1.0"))

    assert violations(written) == []
    assert b"edu.wpi.ebml" not in written


def test_two_points_that_bml_1_0_calls_by_one_name_stay_timed_both() -> None:
    gaze = of.Gaze(id="g", target="t", timing=(of.Timing("start", "w:end"), of.Timing("stroke_start", "v:end")))
    waits = (of.Wait(id="w", duration=1.0), of.Wait(id="v", duration=2.0))
    block = Block(id="b", behaviors=(gaze, *waits))

    named = in_dialect(block, "bml-1.0")

    assert named.constraints != ()
    assert violations(encode_xml(named)) == []
    assert meaning(encode_xml(named)) == meaning(encode_xml(block))


def test_without_an_event_what_was_tied_to_it_stays_tied_to_one_another() -> None:
    event = of.Event(id="e", kind="directed_gaze", responder="human", objects=("t",))
    words = [of.Wait(id=id, duration=1.0) for id in ("w", "v", "u")]
    ties = (
        of.Synchronize(ref="e:start", syncs=("w:start", "v:start")),
        of.After(ref="w:end", syncs=("e:start", "u:start")),
        of.After(ref="e:end", syncs=("v:end",)),
    )
    block = Block(id="b", behaviors=(event, *words), constraints=(of.Constraint(operators=ties),))

    (left,) = core(block).constraints

    assert left.operators == (
        of.Synchronize(syncs=("w:start", "v:start")),
        of.After(ref="w:end", syncs=("u:start",)),
    )
