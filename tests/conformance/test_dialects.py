"""Two spellings of one block compile to the identical net."""

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from msgspec import structs

from schemas import behaviors as of
from schemas.blocks import Block
from schemas.dialects import spelled
from schemas.faults import InputRefused
from schemas.json_codec import encode_json, read
from schemas.references import type_name, without_lines
from schemas.syncref import SYNC_POINTS, SyncRef
from schemas.xml_codec import encode_xml
from services.realizer.planner import Plan, plan_block
from tests.conformance.case import Case, cases
from tests.schemas.grammar import violations

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


def points(type: str) -> list[str]:
    """As the drafts spell them."""
    if type == "speech":
        return ["start", "m-a", "end"]
    if type in ("gazeShift", "wait", "postureShift"):
        return ["start", "end"]
    return list(SYNC_POINTS)


KINDS: list[of.BlockBehavior] = [
    of.Gaze(id="", target="t"), of.GazeShift(id="", target="t"), of.Pointing(id="", target="t", mode="LEFT_HAND"),
    of.Gesture(id="", lexeme="BEAT"), of.Head(id="", lexeme="NOD"), of.FaceLexeme(id="", lexeme="SMILE"),
    of.FaceFacs(id="", au=12, side="LEFT"), of.Posture(id="", stance="SITTING"), of.PostureShift(id="", stance="X"),
    of.Speech(id="", text="One two", marks=(of.Mark("m-a", 4),)), of.Wait(id="", duration=1.0),
]  # fmt: skip


@st.composite
def any_blocks(draw: st.DrawFn) -> Block:
    """In the drafts' spelling, of what every dialect can say."""
    chosen = draw(st.lists(st.sampled_from(KINDS), min_size=1, max_size=5))
    behaviors = [structs.replace(kind, id=f"x-{number}") for number, kind in enumerate(chosen)]

    def reference() -> str:
        behavior = draw(st.sampled_from(behaviors))
        offset = draw(st.sampled_from([0.0, 0.0, 0.5, -1.0, 2.0]))
        if draw(st.integers(0, 5)) == 0:
            return str(abs(offset))
        sync = draw(st.sampled_from(points(type_name(behavior))))
        return str(SyncRef(behavior=behavior.id, sync=sync, offset=offset))

    timed = []
    for behavior in behaviors:
        syncs = draw(st.lists(st.sampled_from(points(type_name(behavior))), max_size=1))
        timed.append(structs.replace(behavior, timing=tuple(of.Timing(sync, reference()) for sync in syncs)))
    operators = [
        draw(st.sampled_from([of.Synchronize, of.After, of.Before]))(ref=reference(), syncs=(reference(),))
        for _ in range(draw(st.integers(0, 2)))
    ]
    constraints = (of.Constraint(operators=tuple(operators)),) if operators else ()
    return Block(id="b", behaviors=tuple(timed), constraints=constraints)


def verdict(data: bytes) -> object:
    """The plan, wherever its XML has which line. Not why there is none: 1.0 calls some points otherwise."""
    (block,) = read(data)
    assert isinstance(block, Block)
    try:
        return _essence(plan_block(without_lines(block)))
    except InputRefused:
        return None


@settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(any_blocks())
def test_any_block_has_the_same_net_in_each_dialect(block: Block) -> None:
    draft = encode_xml(block)
    expected = verdict(draft)

    assert verdict(draft.replace(b' xmlns="org.mindmakers.bml"', b"")) == expected
    assert verdict(encode_xml(spelled(block, "bml-1.0"))) == expected
    assert verdict(encode_xml(spelled(spelled(block, "bml-1.0"), "draft"))) == expected
    assert verdict(encode_json(block)) == expected


@settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(any_blocks())
def test_any_block_is_bml_1_0_once_spelled_so(block: Block) -> None:
    written = encode_xml(spelled(block, "bml-1.0"))

    assert violations(written) == []
    assert b"edu.wpi.ebml" not in written
