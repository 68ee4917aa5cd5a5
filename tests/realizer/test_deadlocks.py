"""Circles of waiting: the points, seconds and lines that a refusal tells are those of the circle, and no others.

Random rings of waits, tied in all ways that BML has, with other behaviors around them that are in no circle.
"""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec import Struct, field

from engage_hri.schemas.behaviors import (
    After,
    Before,
    BlockBehavior,
    Constraint,
    Gesture,
    Synchronize,
    Timing,
    Wait,
)
from engage_hri.schemas.blocks import Block
from engage_hri.services.realizer.net.petri_net import Bound, PetriNet, Place, Transition
from engage_hri.services.realizer.plan.planner import plan_block
from engage_hri.services.realizer.plan.relations import BlockRefused
from engage_hri.services.realizer.plan.words import way_round
from tests.random_cases import share_of
from tests.realizer.way_round import UNSAID, closed_by_behaviors, read

Operator = Synchronize | After | Before


class Ring(Struct):
    """A block with one circle. ties: from each of its points to the next, with the seconds. lines: those to blame."""

    behaviors: list[BlockBehavior] = field(default_factory=list)
    operators: list[Operator] = field(default_factory=list)
    ties: list[tuple[str, str, float]] = field(default_factory=list)
    lines: set[int] = field(default_factory=set)
    line: int = 0

    def wait(self, id: str, seconds: float, *, is_blamed: bool = False) -> None:
        line = self.next_line()
        self.behaviors.append(Wait(id=id, duration=seconds, line=line))
        self.lines |= {line} if is_blamed else set()

    def next_line(self) -> int:
        self.line += 1
        return self.line

    def say(self, operator: type[Operator], ref: str, sync: str, *, is_blamed: bool = True) -> None:
        line = self.next_line()
        self.operators.append(operator(ref=ref, syncs=(sync,), line=line))
        self.lines |= {line} if is_blamed else set()

    @property
    def block(self) -> Block:
        return Block(
            id="b", behaviors=tuple(self.behaviors), constraints=(Constraint(operators=tuple(self.operators)),)
        )


@st.composite
def rings(draw: st.DrawFn) -> Ring:
    """At least one link is an order: a circle of nothing but synchronizations is another fault, a contradiction."""
    ring, size = Ring(), draw(st.integers(2, 5))
    seconds = [draw(st.sampled_from((0.25, 0.5, 1.0, 3.0))) for _ in range(size)]
    for number in range(size):
        ring.wait(f"w{number}", seconds[number], is_blamed=True)
        ring.ties.append((f"w{number}:start", f"w{number}:end", seconds[number]))
    kinds = draw(
        st.lists(st.sampled_from(("order", "meet", "later", "by way of another")), min_size=size, max_size=size)
    )
    kinds[draw(st.integers(0, size - 1))] = draw(st.sampled_from(("order", "by way of another")))
    is_before = draw(st.booleans())
    for number, kind in enumerate(kinds):
        here, there = f"w{number}:end", f"w{(number + 1) % size}:start"
        gap = draw(st.sampled_from((0.0, 0.0, 0.5, 2.0)))
        offset = f"+{gap}" if gap else ""
        if kind == "order" and is_before:
            ring.say(Before, there, here + offset)
        elif kind == "order":
            ring.say(After, here + offset, there)
        elif kind == "meet":
            ring.say(Synchronize, *((here, there) if draw(st.booleans()) else (there, here)))
            continue
        elif kind == "later":
            gap = gap or 0.75
            ring.say(Synchronize, there, f"{here}+{gap}")
        else:
            ring.wait(f"x{number}", 9.0)
            ring.say(Synchronize, f"x{number}:start", here)
            ring.say(After, f"x{number}:start{offset}", there)
        ring.ties.append((here, there, gap))
    for number in range(draw(st.integers(0, 4))):
        ring.wait(f"n{number}", 1.0)
        other = f"w{draw(st.integers(0, size - 1))}:{draw(st.sampled_from(('start', 'end')))}"
        ring.say(draw(st.sampled_from((After, Synchronize))), other, f"n{number}:start", is_blamed=False)
    chance = draw(st.randoms(use_true_random=False))
    chance.shuffle(ring.operators)
    chance.shuffle(ring.behaviors)
    return ring


@settings(max_examples=share_of(150), deadline=None)
@given(rings())
def test_a_refusal_tells_the_points_and_lines_of_the_circle_and_no_others(ring: Ring) -> None:
    with pytest.raises(BlockRefused) as refusal:
        plan_block(ring.block)

    fault = refusal.value.fault
    assert refusal.value.kind == "IMPOSSIBLE_TO_SCHEDULE"
    assert (fault.where, fault.line) == ("b", min(ring.lines))
    told = sorted(ring.lines)
    assert fault.advice == "leave one of them out" + (f"; see lines {_list(told)}" if len(told) > 1 else "")
    words, _, route = fault.reason.partition(": ")
    assert words == "these points wait for each other in a circle"
    followed = [
        (since, to, seconds)
        for names, others, took in closed_by_behaviors(read(route))
        for since, to, seconds in ring.ties
        if since in names and to in others and took in (seconds, UNSAID)
    ]
    assert sorted(followed) == sorted(ring.ties)


def test_points_of_one_line_are_told_with_that_line_alone_and_without_lines_with_none() -> None:
    for line, told in ((7, 7), (0, 0)):
        operators = (After(ref="a:end", syncs=("b:start",)), After(ref="b:end", syncs=("a:start",)))
        constraint = Constraint(operators=operators, line=line)
        behaviors = (Wait(id="a", duration=1.0), Wait(id="b", duration=1.0))
        with pytest.raises(BlockRefused) as refusal:
            plan_block(Block(id="b", behaviors=behaviors, constraints=(constraint,)))
        assert (refusal.value.fault.line, refusal.value.fault.advice) == (told, "leave one of them out")
        assert refusal.value.fault.reason == (
            "these points wait for each other in a circle: b:start is not before a:end, a:start is not before b:end"
        )


def test_behaviors_that_begin_with_each_others_ends_are_told_in_so_many_words() -> None:
    behaviors = (
        Gesture(id="a", lexeme="BEAT", timing=(Timing("start", "b:relax"),), line=3),
        Gesture(id="b", lexeme="BEAT", timing=(Timing("stroke", "a:end"),), line=4),
    )
    with pytest.raises(BlockRefused) as refusal:
        plan_block(Block(id="b", behaviors=behaviors))
    assert refusal.value.fault.reason == (
        "these points wait for each other in a circle: b:stroke comes when a ends, a starts when b:relax comes"
    )


def _list(lines: list[int]) -> str:
    return ", ".join(map(str, lines))


NET = PetriNet(tuple(Transition(name, ()) for name in ("bml:start", "a:start", "a:ready", "a:end = b:start")), ())


@pytest.mark.parametrize(
    ("tie", "seconds", "words"),
    [
        (Place("phase", 1, 2, 1.0, 0.5, "a"), 0.5, "a takes 0.5 s from a:start to a:ready"),
        (Bound("phase", 2, 1, -1.0, 0.25, "a"), -1.25, "a takes at most 1.25 s from a:start to a:ready"),
        (Bound("phase", 2, 1, 0.0, 0.0, "a"), 0.0, "a takes at most 0 s from a:start to a:ready"),
        (Place("delay", 0, 1, 2.0, 2.0), 2.0, "a:start is 2 s after bml:start"),
        (Bound("delay", 1, 0, -2.0), -2.0, "a:start is 2 s after bml:start"),
        (Place("order", 1, 3, 0.0), 0.0, "a:end = b:start is not before a:start"),
        (Place("series", 1, 3, 0.75, 0.75), 0.75, "a:end = b:start is at least 0.75 s after a:start"),
        (Bound("order", 3, 0, -1.5), -1.5, "a:end = b:start is at most 1.5 s after bml:start"),
        (Bound("order", 3, 0, 0.0), 0.0, "a:end = b:start is not after bml:start"),
    ],
)
def test_each_tie_of_a_circle_has_its_words(tie: Place | Bound, seconds: float, words: str) -> None:
    assert way_round(NET, ((tie, seconds),)) == words


def test_phases_that_follow_one_another_are_one_wherever_the_circle_begins() -> None:
    ready, end = (Place("phase", since, since + 1, 1.0, 1.0, "a") for since in (1, 2))
    back = Bound("delay", 3, 1, -0.5)
    circle = ((ready, 1.0), (end, 0.75), (back, -0.5))
    for number in range(3):
        turned = (*circle[number:], *circle[:number])
        assert sorted(way_round(NET, turned).split(", ")) == [
            "a takes 1.75 s from a:start to a:end = b:start", "a:end = b:start is 0.5 s after a:start",
        ]  # fmt: skip
