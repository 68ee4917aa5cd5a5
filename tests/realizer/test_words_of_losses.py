"""Words about what is lost, as the author of a block reads them: who is in the way, which lines, what to do."""

import re

import pytest

from engage_hri.schemas.blocks import Block
from engage_hri.schemas.body import Estimate, Phase
from engage_hri.schemas.documents.xml_decode import decode_xml
from engage_hri.schemas.faults import Fault
from engage_hri.services.realizer.plan.planner import plan_block
from engage_hri.services.realizer.plan.relations import BlockRefused
from tests.realizer.test_losses import planned

ONE_POINT_0 = '<bml id="b" xmlns="http://www.bml-initiative.org/bml/bml-1.0">\n{}\n</bml>'
ONE_ARM = """<gesture id="g" lexeme="BEAT" mode="{}" strokeEnd="2"/>
<gesture id="h" lexeme="BEAT" mode="{}" strokeEnd="2.125"{}/>"""


@pytest.mark.parametrize(
    ("first", "second", "required", "told"),
    [
        (
            "LEFT_HAND", "LEFT_HAND", "",
            "line 3: cannot be on time: g has the left arm until g:strokeEnd, 2.00 s after the start of the block; "
            'the behavior is dropped (use the other hand with mode="RIGHT_HAND", or let one of the two begin later)',
        ),
        (
            "BOTH_HANDS", "LEFT_HAND", "",
            "line 3: cannot be on time: g has the left arm until g:strokeEnd, 2.00 s after the start of the block; "
            "the behavior is dropped (let one of the two begin later)",
        ),
        (
            "LEFT_HAND", "LEFT_HAND", ' required="true"',
            "line 2: cannot be on time: g has the left arm until g:strokeEnd, 2.00 s after the start of the block, "
            "and h cannot wait for that; the behavior is dropped "
            '(use the other hand with mode="RIGHT_HAND", or let one of the two begin later)',
        ),
    ],
)  # fmt: skip
def test_of_two_on_one_arm_at_once_it_is_told_who_has_it_until_when_and_what_to_do(
    first: str, second: str, required: str, told: str
) -> None:
    block = decode_xml(ONE_POINT_0.format(ONE_ARM.format(first, second, required)))
    assert isinstance(block, Block)

    (problem,) = planned(block).problems
    assert problem.message == told


CONTRADICTING = """<head id="n" lexeme="NOD"/>
<constraint id="c">
  <synchronize ref="1"><sync ref="n:start"/></synchronize>
  <synchronize ref="{}"><sync ref="n:{}"/></synchronize>
</constraint>"""


@pytest.mark.parametrize(
    ("at", "sync", "told"),
    [
        (1.25, "strokeEnd", "from n:start to n:strokeEnd it takes 0.44 s at least, and there are 0.25 s: "),
        (1, "strokeEnd", "from n:start to n:strokeEnd it takes 0.44 s at least, and there are 0.00 s: "),
        (9, "ready", "from n:start to n:ready it takes 0.31 s at most, and there are 8.00 s: "),
        (0.5, "strokeEnd", "n:strokeEnd would come 0.50 s before n:start: "),
    ],
)
def test_contradicting_times_are_told_with_the_lines_that_say_them(at: float, sync: str, told: str) -> None:
    block = decode_xml(ONE_POINT_0.format(CONTRADICTING.format(at, sync)))
    assert isinstance(block, Block)

    (problem,) = planned(block).problems
    assert problem.message.startswith(f"line 4: cannot be on time: {told}")
    assert problem.message.endswith(": see line 5)")


@pytest.mark.parametrize("sync", ["stroke", "end"])
def test_two_points_at_one_point_of_another_are_told_each_by_its_name(sync: str) -> None:
    words = f'<speech id="s"><text>so</text></speech><head id="n" lexeme="NOD" start="s:end" {sync}="s:end"/>'
    block = decode_xml(ONE_POINT_0.format(words))
    assert isinstance(block, Block)

    (problem,) = planned(block).problems
    assert re.match(
        rf"line 2: cannot be on time: from n:start to n:{sync} it takes \S+ s at least, and there are 0.00 s: "
        rf"n:start = n:{sync} = s:end is one instant; the behavior is dropped",
        problem.message,
    )


def test_of_a_phase_that_cannot_last_so_long_the_way_round_is_told() -> None:
    """The nod can be readied in 0.3125 s at most, not in a second: nothing takes too long there."""
    block = decode_xml('<bml id="b"><head id="n" lexeme="NOD" start="1" ready="2"/></bml>')
    assert isinstance(block, Block)

    assert [each.message for each in planned(block).problems] == [
        "line 1: cannot be on time: from n:start to n:ready it takes 0.31 s at most, and there are 1.00 s: "
        "n:ready is 2 s after bml:start, n takes at most 0.312 s from n:start to n:ready, "
        "n:start is 1 s after bml:start; the behavior is dropped (give it less time, or leave out one of its times)"
    ]


def test_contradicting_offsets_are_told_with_the_points_as_they_are_written() -> None:
    said = """<head id="n" lexeme="NOD" strokeEnd="s:end+0.5"/><speech id="s"><text>so</text></speech>
<constraint id="c"><synchronize><sync ref="n:strokeEnd"/><sync ref="s:end + 1"/></synchronize></constraint>"""
    block = decode_xml(ONE_POINT_0.format(said))
    assert isinstance(block, Block)

    with pytest.raises(BlockRefused) as refused:
        planned(block)
    assert "n:strokeEnd is already 1 s after s:end (" in str(refused.value)
    assert "stroke_end" not in str(refused.value)


def test_of_two_speeches_that_overlap_it_is_told_who_has_the_voice_and_no_riddle() -> None:
    speeches = '<speech id="a" start="1"><text>First sentence.</text></speech>'
    speeches += '<speech id="b" start="1.2"><text>Second sentence.</text></speech>'
    block = decode_xml(ONE_POINT_0.format(speeches))
    assert isinstance(block, Block)

    phase = Phase(since="start", to="end", shortest=0.9, natural=0.9)
    estimates = [Estimate(behavior=id, feasible=True, parts=("voice",), phases=(phase,)) for id in ("a", "b")]
    (problem,) = plan_block(block, estimates).problems
    reason = "line 2: cannot be on time: a has the voice until a:end: a:start is 1 s after bml:start, a takes 0.9 s "
    assert problem.message.startswith(reason)
    assert problem.message.endswith("; b:start = 1.2 is given up, so that the words are said")
    assert "would come" not in problem.message
    assert "not before" not in problem.message


TWO_FACES = """<faceFacs id="f" au="12" start="0" end="2"/>
<faceFacs id="f2" au="1" start="0" end="2"/>"""


def test_of_two_faces_at_once_it_is_told_that_one_face_can_show_both() -> None:
    block = decode_xml(ONE_POINT_0.format(TWO_FACES))
    assert isinstance(block, Block)
    faces = [Estimate(behavior=id, feasible=True, parts=("face",), phases=FACE) for id in ("f", "f2")]

    (problem,) = plan_block(block, faces).problems
    assert problem.message.endswith(
        "(put both into one <face>, each as its <lexeme> or <facs>, or let one of the two begin later)"
    )


FACE = (
    Phase(since="start", to="stroke", shortest=0.1, natural=0.25),
    Phase(since="stroke", to="relax", shortest=0.0, natural=0.5),
    Phase(since="relax", to="end", shortest=0.1, natural=0.25),
)


def test_a_required_behavior_that_the_body_refuses_is_told_with_one_advice() -> None:
    block = decode_xml(ONE_POINT_0.format('<gaze id="g" target="cap" required="true"/>'))
    assert isinstance(block, Block)
    fault = Fault(reason="the world has no 'cap'", where="g", advice="did you mean 'cup'?")

    with pytest.raises(BlockRefused) as refusal:
        plan_block(block, [Estimate(behavior="g", feasible=False, fault=fault, warning="NO_SUCH_TARGET")])
    assert str(refusal.value) == (
        "b: g, line 2: the world has no 'cap' "
        "(did you mean 'cup'?; it is required: without `required` it would be dropped)"
    )
