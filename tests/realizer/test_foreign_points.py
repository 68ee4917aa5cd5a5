"""Points of other blocks in a plan: when they count, and the message about its net."""

from typing import Any

import pytest
from msgspec.structs import replace

from engage_hri.schemas.behaviors import Head, Speech, Wait
from engage_hri.schemas.blocks import Block, Fired
from engage_hri.schemas.units import Stamp
from engage_hri.services.realizer.export import described, firings
from engage_hri.services.realizer.plan.known import BLOCK_END, Known, coming_with, is_behind
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.plan.planner import plan_block
from engage_hri.services.realizer.plan.words import Spelling
from engage_hri.services.realizer.points import Point
from tests.realizer.oracle import estimate
from tests.realizer.planning import timed
from tests.realizer.stage import after, before, block, together

NOD = Head(id="n", lexeme="NOD")
OTHERS = {"other": Block(id="other", behaviors=(Wait(id="x"), Wait(id="y")))}


def planned(*constraints: object, start: str = "", **ends: float) -> Plan:
    """A nod, tied to the ends of two waits of another block, of which it is known when they come."""
    nod = timed(NOD, start=start) if start else NOD
    known = Known(blocks=OTHERS, points={Point(f"other:{id}", "end"): at for id, at in ends.items()})
    return plan_block(block((nod,), *constraints), [estimate(NOD)], known=known)  # type: ignore[arg-type]


def starts(made: Plan) -> float:
    return round(made.predicted(Point("n", "start")), 6)


@pytest.mark.parametrize(("x", "y"), [(1.0, 2.0), (2.0, 1.0), (2.0, 2.0), (-1.0, 2.0), (2.0, 0.0)])
@pytest.mark.parametrize("way", ["together", "after"])
def test_of_two_points_of_other_blocks_the_later_counts(way: str, x: float, y: float) -> None:
    if way == "together":
        made = planned(together("n:start", "other:x:end", "other:y:end"), x=x, y=y)
    else:
        made = planned(after("other:x:end", "n:start"), after("other:y:end", "n:start"), x=x, y=y)

    assert starts(made) == 2.0


@pytest.mark.parametrize(("x", "expected"), [(-1.0, 0.5), (-1.5, 0.0), (-3.0, 0.0), (0.0, 1.5), (4.0, 5.5)])
def test_an_offset_counts_from_when_the_point_was_and_nothing_comes_before_the_block(
    x: float, expected: float
) -> None:
    assert starts(planned(start="other:x:end+1.5", x=x)) == expected
    assert starts(planned(after("other:x:end+1.5", "n:start"), x=x)) == expected


def test_a_point_of_which_nobody_knows_when_it_comes_delays_nothing_in_the_plan() -> None:
    assert starts(planned(start="other:x:end")) == 0.0
    assert starts(planned(after("other:x:end", "n:start"), y=3.0)) == 0.0


@pytest.mark.parametrize(("x", "is_told"), [(5.0, False), (1.0, True)])
def test_who_cannot_be_before_a_point_of_another_block_is_told(x: float, *, is_told: bool) -> None:
    made = planned(before("other:x:end", "n:start"), start="2", x=x)

    assert starts(made) == 2.0
    told = [(str(each.point), each.direction, each.seconds) for each in made.broken]
    assert told == ([("n:start", "later", 1.0)] if is_told else [])


@pytest.mark.parametrize("begins", [0.5, 1.25, 3.0])
def test_who_begins_too_late_for_a_time_is_late_and_not_lost(begins: float) -> None:
    """A nod that can be made in a second is to be over by 1.5 s; when it began, or can begin, is known."""
    nod = timed(NOD, start="0.5", end="1.5")
    known = Known(points={Point("n", "start"): begins}, begun=frozenset({"n"}))
    made = plan_block(block((nod,)), [estimate(NOD)], known=known)

    assert (made.dropped, made.problems) == ((), ())
    assert starts(made) == 0.5


@pytest.mark.parametrize("x", [0.0, 2.0])
def test_who_is_given_too_little_time_between_points_of_another_block_is_lost_whenever_these_come(x: float) -> None:
    """The nod is not lost for when the point comes, but for how near its own two are to it: the tie is no way out."""
    other = timed(Head(id="m", lexeme="SHAKE"), start="other:x:end", end="other:x:end+5")
    nod = timed(NOD, start="other:x:end", end="other:x:end+0.1")
    known = Known(blocks=OTHERS, points={Point("other:x", "end"): x})
    made = plan_block(block((other, nod)), [replace(estimate(other), parts=("arm",)), estimate(NOD)], known=known)

    assert made.dropped == ("n",)
    assert made.predicted(Point("m", "start")) == x


@pytest.mark.parametrize(("x", "expected"), [(0.5, 1.0), (5.0, 1.0)])
def test_what_shared_a_tie_to_a_point_that_comes_too_late_stays_tied(x: float, expected: float) -> None:
    """The nod has a time of its own, which the point of the other block misses; the words belong to the nod."""
    words = Speech(id="s", text="so")
    known = Known(blocks=OTHERS, points={Point("other:x", "end"): x})
    tied = block((timed(NOD, start="1"), words), together("n:start", "other:x:end", "s:start"))
    made = plan_block(tied, [estimate(NOD), estimate(words)], known=known)

    assert (starts(made), made.predicted(Point("s", "start"))) == (expected, expected)
    assert (made.dropped, bool(made.broken)) == ((), True)


# -- the message about a net -----------------------------------------------------------------------------------------


def test_the_message_about_a_net_has_all_of_it() -> None:
    made = planned(after("other:x:end", "n:stroke"), start="1", x=1.5)
    message = described(made, Stamp("c", 7.0), made.net.initial, {0: 0.0, 2: 1.25}, Spelling(made.block))

    assert (message.block, message.at) == ("b", Stamp("c", 7.0))
    told = [[(each.behavior, each.sync) for each in one.points] for one in message.transitions]
    assert (told[0][0], told[-1]) == (("", "start"), [("", "end")])
    names = {point: number for number, points in enumerate(told) for point in points}
    for point, at in made.at.items():
        assert names[point.behavior, point.sync] == at
        assert message.transitions[at].time == made.predicted(point)
    assert len(message.places) == len(made.net.places)
    for ours, theirs in zip(made.net.places, message.places, strict=True):
        assert (ours.kind, ours.source, ours.target, ours.lag, ours.behavior) == (
            theirs.kind, theirs.source, theirs.target, theirs.lag, theirs.behavior,
        )  # fmt: skip
    idle = [number for number, each in enumerate(message.places) if each.kind == "idle"]
    assert list(message.marked) == idle != []
    assert message.fired == (Fired(transition=0, time=0.0), Fired(transition=2, time=1.25))


def test_firings_keep_their_numbers_and_are_told_in_order() -> None:
    assert firings({3: 0.5, 1: 0.25}) == (Fired(transition=3, time=0.5), Fired(transition=1, time=0.25))


def test_a_point_that_waits_for_one_of_this_block_is_expected_after_it_and_no_earlier_than_before() -> None:
    own, theirs, ended = Point("w", "start"), Point("other:x", "start"), Point("other:x", "end")
    waiting = {theirs: {own: 0.5}, ended: {BLOCK_END: 0.25, own: 0.5}}
    known = Known(points={theirs: 1.0, ended: 1.5}, awaiting=waiting)

    assert known.in_truth((), {own: 2.0}, 4.0) == {own: 2.0, theirs: 2.5, ended: 4.25}
    assert known.in_truth((), {own: 0.25}, 0.5) == {own: 0.25, theirs: 1.0, ended: 1.5}


@pytest.mark.parametrize(
    ("own", "expected"),
    [(Point("n", "end"), True), (Point("w", "end"), True), (Point("s", "end"), False), (BLOCK_END, True)],
    ids=str,
)
def test_a_point_of_another_block_that_waits_for_what_follows_a_behavior_is_behind_it(
    own: Point, *, expected: bool
) -> None:
    """The wait follows the nod, the speech follows nothing, and a block ends after all."""
    both = block((NOD, Wait(id="w"), Speech(id="s", text="So")), after("n:stroke", "w:start"))
    made: Any = plan_block(both, [estimate(NOD)])
    theirs = Point("other:x", "start")

    assert is_behind(made, Known(awaiting={theirs: {own: 0.5}}), theirs, "n") is expected
    assert not is_behind(made, Known(), theirs, "n")


@pytest.mark.parametrize(("first", "second", "waits"), [(1.0, 2.0, {"n"}), (2.0, 1.0, {"n"})])
def test_what_comes_with_a_point_of_another_block_is_what_waits_for_that_block(
    first: float, second: float, waits: set[str]
) -> None:
    """And not what waits for a third one, whichever of them comes first."""
    mine = Block(id="third", behaviors=(Wait(id="y"),))
    theirs, thirds = Point("other:x", "end"), Point("third:y", "end")
    known = Known(blocks={**OTHERS, "third": mine}, points={theirs: first, thirds: second})
    tied = block((NOD, Wait(id="w")), after("other:x:end", "n:start"), after("third:y:end", "w:start"))
    made: Any = plan_block(tied, [estimate(NOD)], known=known)

    assert {each.behavior for each in coming_with(made, known, theirs)} - {"other:x"} == waits
