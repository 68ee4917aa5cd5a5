"""What a block says of its points, held against when they come: whoever comes wrong, and in both directions."""

import re

import pytest

from engage_hri.schemas.behaviors import FaceLexeme, Gesture, Wait
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.documents.xml_decode import decode_xml
from engage_hri.services.realizer.plan.promises import broken_by
from engage_hri.services.realizer.plan.relations import Relations, relations_of
from engage_hri.services.realizer.points import ORIGIN, Point
from tests.realizer.fake_body import FakeBody, Script
from tests.realizer.planning import timed
from tests.realizer.stage import after, before, block, stage, together
from tests.realizer.test_sharing import MORE, OTHER, RIGHT, WORDS, instants, told, warned

A, B, C = Wait(id="a", duration=1.0), Wait(id="b", duration=1.0), Wait(id="c", duration=1.0)


def relations(*constraints: object, elsewhere: str = "") -> Relations:
    made = block((A, B, C), *constraints)  # type: ignore[arg-type]
    return relations_of(made, {"z": None} if elsewhere else {})


def found(said: Relations, **times: float) -> list[tuple[str, str, float]]:
    """What is broken: who is told of, the direction, and the seconds. times: `a_end` is when `a:end` comes."""
    points = {Point(*name.replace("z_", "z:").rsplit("_", 1)): at for name, at in times.items()} | {ORIGIN: 0.0}
    return [(str(each.point), each.direction, round(each.seconds, 6)) for each in broken_by(said, points)]


@pytest.mark.parametrize(
    ("times", "expected"),
    [
        ({"a_end": 1.0, "b_end": 1.5}, []),
        ({"a_end": 1.0, "b_end": 1.75}, [("b:end", "later", 0.25)]),
        ({"a_end": 1.0, "b_end": 1.25}, [("b:end", "earlier", 0.25)]),
        ({"a_end": 1.0}, []),
    ],
)
def test_what_is_one_instant_is_missed_in_both_directions(times: dict[str, float], expected: list[object]) -> None:
    assert found(relations(together("a:end+0.5", "b:end")), **times) == expected


@pytest.mark.parametrize(("b", "expected"), [(2.0, []), (1.5, []), (1.25, [("b:end", "earlier", 0.25)])])
def test_an_order_is_missed_in_one_direction_only(b: float, expected: list[object]) -> None:
    assert found(relations(after("a:end+0.5", "b:end")), a_end=1.0, b_end=b) == expected


def test_before_is_after_the_other_way_round() -> None:
    assert found(relations(before("a:end", "b:end")), a_end=1.0, b_end=1.5) == [("b:end", "later", 0.5)]


def test_of_many_points_the_extremes_are_compared() -> None:
    said = relations(together("a:end", "b:end", "c:end"))

    assert found(said, a_end=1.0, b_end=3.0, c_end=2.0) == [("c:end", "later", 1.0), ("b:end", "later", 2.0)]


@pytest.mark.parametrize(("z", "way"), [(5.0, "earlier"), (0.0, "later")])
def test_of_a_point_of_another_block_the_own_one_is_told(z: float, way: str) -> None:
    said = relations(together("z:a:end", "a:end"), elsewhere="z")

    assert found(said, a_end=1.0, z_a_end=z)[0][:2] == ("a:end", way)


def test_a_fixed_time_counts_from_the_start_of_the_block() -> None:
    assert found(relations(together("a:end", "3")), a_end=2.0) == [("a:end", "earlier", 1.0)]


# -- told by feedback ------------------------------------------------------------------------------------------------


async def test_what_should_have_come_before_a_point_of_another_block_that_is_faster_is_told() -> None:
    """The stroke sets out for the words as they are expected; they are over at once."""
    tied = block((timed(RIGHT, stroke="one:s:end-0.5"),), id="two")
    body = FakeBody({"s": Script(durations=(1.0, 1.0, 1.0, 0.1))})
    seen, _ = await told((0.0, block((WORDS,), id="one")), (0.0, tied), body=body)

    assert instants(seen)["two:q:stroke"] > instants(seen)["one:s:end"] - 0.5 + 0.1
    assert warned(seen) == [("two", "q", "LATE")]
    assert "later than it should be: q:stroke = one:s:end-0.5" in seen.warnings()[0].message


@pytest.mark.parametrize("ref", ["one:s:m1", "one:bml:start"])
async def test_what_is_past_as_a_block_begins_is_told_at_once(ref: str) -> None:
    tied = block((timed(OTHER, start="2"), timed(MORE, start=ref)), id="two")
    seen, _ = await told((0.0, block((WORDS,), id="one")), (1.5, tied))
    warning = seen.warnings()[0]

    assert warning.at is not None
    assert (warning.behavior, warning.kind, warning.at.seconds) == ("t", "LATE", 1.5)
    assert f"later than it should be: t:start = {ref}" in warning.message
    assert len(seen.warnings()) == 1


async def test_an_order_with_a_point_of_another_block_that_is_past_is_told() -> None:
    tied = block((timed(OTHER, start="1"),), before("one:s:m1", "h:start"), id="two")
    seen, _ = await told((0.0, block((WORDS,), id="one")), (1.5, tied))

    assert [(each.behavior, each.kind) for each in seen.warnings()] == [("h", "LATE")]
    assert "1.50 s later than it should be: h:start <= one:s:m1" in seen.warnings()[0].message


@pytest.mark.parametrize(
    ("said", "ref", "way"),
    [
        (together("one:s:m1", "1"), "one:s:m1", "earlier"),
        (together("one:s:end", "20"), "one:s:end", "earlier"),
        (before("one:s:m1", "5"), "one:s:m1", "earlier"),
        (after("one:s:end", "0"), "one:s:end", "later"),
    ],
)
async def test_what_is_said_of_another_block_and_the_clock_alone_is_told_of_the_block(
    said: object, ref: str, way: str
) -> None:
    tied = block((OTHER,), said, id="two")  # type: ignore[arg-type]
    seen, outcomes = await told((0.0, block((WORDS,), id="one")), (1.5, tied))

    (warning,) = seen.warnings()
    assert (warning.block, warning.behavior, warning.kind) == ("two", "", "LATE")
    assert f"{ref} is planned" in warning.message
    assert f"{way} than it should be" in warning.message
    assert {each.status for each in outcomes} == {"done"}


async def test_beside_a_behavior_that_is_late_the_other_block_and_the_clock_are_told_of() -> None:
    tied = block((timed(OTHER, start="one:s:end"),), together("one:s:m1", "9", "h:end"), id="two")
    seen, outcomes = await told((0.0, block((WORDS,), id="one")), (1.5, tied))

    assert {(each.block, each.behavior, each.kind) for each in seen.warnings()} == {
        ("two", "", "LATE"),
        ("two", "h", "LATE"),
    }
    assert {each.status for each in outcomes} == {"done"}


LATE_XML = """<bml id="b">
  <head id="n" lexeme="NOD" start="0"/>
  <speech id="s"><text>one <mark name="m"/>two</text></speech>
  <constraint>
    {}
  </constraint>
</bml>"""


@pytest.mark.parametrize(
    ("said", "message"),
    [
        ('<synchronize ref="s:m+0.5"><sync ref="n:stroke"/></synchronize>', "s:m+0.5 = n:stroke"),
        ('<before ref="1"><sync ref="n:stroke"/></before>', "n:stroke <= 1"),
    ],
)
async def test_what_is_late_is_told_with_the_line_that_asks_for_it(said: str, message: str) -> None:
    late = FakeBody({"n": Script(durations=(0.5, 0.25, 0.8, 0.25, 0.25, 0.5))})
    written = decode_xml(LATE_XML.format(said))
    assert isinstance(written, Block)
    async with stage(late) as seen:
        await seen.perform(written)

    (warning,) = [each for each in seen.warnings() if each.kind == "LATE" and "should" in each.message]
    assert re.fullmatch(
        rf"line 5: stroke came \d\.\d\d s later than it should be: {re.escape(message)}", warning.message
    )


async def test_what_is_overdue_is_told_with_the_line_of_the_behavior() -> None:
    written = decode_xml(LATE_XML.format(""))
    assert isinstance(written, Block)
    async with stage(FakeBody({"n": Script(stall="stroke")})) as seen:
        await seen.perform(written)

    (warning,) = [each for each in seen.warnings() if each.kind == "LATE"]
    assert re.fullmatch(r"line 2: stroke is \d\.\d s overdue", warning.message)


async def test_who_comes_late_since_it_waits_for_a_part_is_told_with_who_has_that_and_until_when() -> None:
    holder = timed(Gesture(id="p", lexeme="BEAT", mode="RIGHT_HAND"), stroke_end="5")
    one = block((holder, Wait(id="w", duration=2.0)), id="one")
    seen, _ = await told((0.0, one), (0.5, block((timed(RIGHT, stroke="one:w:end"),), id="two")))

    (warning,) = seen.warnings()
    assert (warning.block, warning.behavior, warning.kind) == ("two", "q", "LATE")
    assert warning.message == (
        "stroke is planned 4.25 s later than it should be: q:stroke = one:w:end; "
        "it waits for its turn: one:p has the right arm until one:p:stroke_end"
    )


async def test_who_waited_longer_than_planned_is_told_with_who_had_the_part_as_the_block_spells_it() -> None:
    written = decode_xml(
        """<bml id="b" xmlns="http://www.bml-initiative.org/bml/bml-1.0">
          <gesture id="p" lexeme="BEAT" mode="RIGHT_HAND" start="0" end="3"/>
          <gesture id="q" lexeme="BEAT" mode="RIGHT_HAND" strokeStart="4"/>
        </bml>"""
    )
    assert isinstance(written, Block)
    async with stage(FakeBody({"p": Script(durations=(0.5, 0.25, 0.5, 0.25, 0.25, 3.5))})) as seen:
        await seen.perform(written)

    (warning,) = [each for each in seen.warnings() if "should" in each.message and each.behavior == "q"]
    assert re.fullmatch(
        r"line 3: strokeStart came \d\.\d\d s later than it should be: q:strokeStart = 4; "
        "it waited for its turn: p had the right arm until p:end",
        warning.message,
    )


@pytest.mark.parametrize(("sent", "lateness"), [(0.05, ["0.05"]), (0.009, ["0.01"]), (0.007, [])])
async def test_what_is_past_is_told_at_planning_from_eight_milliseconds_on(sent: float, lateness: list[str]) -> None:
    tied = block((timed(FaceLexeme(id="f", lexeme="SMILE"), start="one:bml:start"),), id="two")
    seen, _ = await told((0.0, block((WORDS,), id="one")), (sent, tied))

    assert [re.search("planned (.*) s later", each.message)[1] for each in seen.warnings()] == lateness  # type: ignore[index]


async def test_of_all_that_is_said_of_one_point_the_lateness_is_told_at_planning() -> None:
    smile = timed(FaceLexeme(id="f", lexeme="SMILE"), start="one:bml:start")
    tied = block((smile,), before("one:bml:start+0.2", "f:start"), id="two")
    seen, _ = await told((0.0, block((WORDS,), id="one")), (0.5, tied))

    found = [re.search("planned (.*) s later than it should be: (.*)", each.message) for each in seen.warnings()]
    assert [each and each.groups() for each in found] == [
        ("0.50", "f:start = one:bml:start"), ("0.30", "f:start <= one:bml:start+0.2"),
    ]  # fmt: skip
