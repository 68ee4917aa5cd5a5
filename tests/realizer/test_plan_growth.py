"""Planning and firing grow with the size of the block, whatever its shape: counted in calls, not in seconds."""

import random
import sys
from collections.abc import Callable
from types import FrameType

import pytest

from engage_hri.schemas.behaviors import (
    After,
    BlockBehavior,
    Constraint,
    FaceLexeme,
    Gaze,
    Gesture,
    Head,
    Pointing,
    Speech,
    Synchronize,
    Timing,
)
from engage_hri.schemas.blocks import Block
from engage_hri.services.realizer.net.petri_net import fire_once_each, is_live, is_safe
from engage_hri.services.realizer.plan.assembly import Assembler, Assembly
from engage_hri.services.realizer.plan.handover import Arrangement
from engage_hri.services.realizer.plan.known import Known
from engage_hri.services.realizer.plan.planner import plan_block

Parts = tuple[list[BlockBehavior], list[Synchronize | After]]


def phrased(kind: type[Gaze | Pointing], sync: str, size: int) -> Parts:
    """Behaviors with a phrase each, which begins at `sync`; one after another."""
    behaviors: list[BlockBehavior] = []
    operators: list[Synchronize | After] = []
    for number in range(size):
        behaviors += (kind(id=f"p{number}", target="a"), Speech(id=f"s{number}", text="this one"))
        operators.append(Synchronize(ref=f"p{number}:{sync}", syncs=(f"s{number}:start",)))
        if number:
            operators.append(After(ref=f"s{number - 1}:end", syncs=(f"p{number}:start",)))
    return behaviors, operators


def references(size: int) -> Parts:
    return phrased(Pointing, "stroke_start", size)


def looks(size: int) -> Parts:
    return phrased(Gaze, "stroke", size)


def series(size: int) -> Parts:
    """Nothing is said of anything."""
    return [
        each
        for number in range(size)
        for each in (Speech(id=f"s{number}", text="one"), FaceLexeme(id=f"f{number}", lexeme="smile"))
    ], []


def measured_words(size: int) -> Parts:
    """Strokes, which cannot wait, after words."""
    behaviors: list[BlockBehavior] = []
    operators: list[Synchronize | After] = []
    for number in range(size):
        behaviors += (Speech(id=f"s{number}", text="one"), Pointing(id=f"p{number}", target="a"))
        operators.append(After(ref=f"s{number}:end", syncs=(f"p{number}:stroke",)))
        operators.append(After(ref=f"p{number - 1}:end" if number else "0", syncs=(f"s{number}:start",)))
    return behaviors, operators


def joined(size: int) -> Parts:
    """All at once."""
    speeches: list[BlockBehavior] = [Speech(id=f"s{number}", text="one") for number in range(2 * size)]
    return speeches, [Synchronize(syncs=tuple(f"{each.id}:start" for each in speeches))]


def fixed(size: int) -> Parts:
    """Each at its time, longer or shorter than is natural."""
    return [
        Speech(
            id=f"s{number}",
            text="one two",
            timing=(Timing("start", str(3 * number)), Timing("end", f"{3 * number}.4")),
        )
        for number in range(2 * size)
    ], []


def hopeless(size: int) -> Parts:
    """None has the time that it takes: each is dropped, for a reason of its own."""
    return [
        Gesture(id=f"g{number}", lexeme="BEAT", timing=(Timing("start", "0"), Timing("end", "0.001")))
        for number in range(size)
    ], []


def hasty(size: int) -> Parts:
    """Words that are to end before they can: each gives up its end."""
    return [
        Speech(id=f"s{number}", text="one two", timing=(Timing("end", f"s{number}:start+0.001"),))
        for number in range(size)
    ], []


def rivals(size: int) -> Parts:
    """All want the arm at the same time: all but the first are dropped."""
    return [
        Pointing(id=f"p{number}", target="a", mode="LEFT_HAND", timing=(Timing("start", "1"), Timing("end", "3")))
        for number in range(size)
    ], []


def preparing(size: int) -> Parts:
    """Points that set out in time for words of another block, each for its own."""
    behaviors: list[BlockBehavior] = [Pointing(id=f"p{number}", target="a") for number in range(size)]
    return behaviors, [After(ref=f"other:s{number}:end", syncs=(f"p{number}:stroke",)) for number in range(size)]


def calls(size: int, shape: Callable[[int], Parts]) -> int:
    """Python functions called, and list and dictionary methods, to plan a block, check its net and fire it."""
    behaviors, operators = shape(size)
    block = Block(id="b", behaviors=tuple(behaviors), constraints=(Constraint(operators=tuple(operators)),))
    said = tuple(Speech(id=f"s{number}", text="one") for number in range(size))
    elsewhere = {"other": Block(id="other", behaviors=said)}
    count = 0

    def counted(frame: FrameType, event: str, argument: object) -> None:
        nonlocal count
        count += event in ("call", "c_call")

    before = sys.getprofile()
    sys.setprofile(counted)
    try:
        plan = plan_block(block, known=Known(blocks=elsewhere))
        assert is_live(plan.net)
        assert is_safe(plan.net)
        fire_once_each(plan.net, plan.net.initial)
    finally:
        sys.setprofile(before)
    return count


@pytest.mark.parametrize(
    "shape",
    [references, looks, series, measured_words, joined, fixed, hopeless, hasty, rivals, preparing],
)
def test_twice_the_block_costs_twice_the_work(shape: Callable[[int], Parts]) -> None:
    calls(20, shape)  # what is remembered from now on

    assert calls(160, shape) < 2.2 * calls(80, shape)


def tied_at_random(size: int, chance: random.Random) -> Block:
    """Six of ten behaviors begin after an earlier one has begun, or as it ends."""
    kinds = (
        lambda id: Speech(id=id, text="one two three"),
        lambda id: Gaze(id=id, target="a"),
        lambda id: Head(id=id, lexeme="NOD"),
        lambda id: Gesture(id=id, lexeme="BEAT"),
    )
    behaviors = tuple(chance.choice(kinds)(f"b{number}") for number in range(size))
    operators: list[Synchronize | After] = []
    for number in range(1, size):
        if chance.random() < 0.6:
            other, start = f"b{chance.randrange(number)}", f"b{number}:start"
            if chance.random() < 0.5:
                operators.append(After(ref=f"{other}:start", syncs=(start,)))
            else:
                operators.append(Synchronize(syncs=(f"{other}:end", start)))
    return Block(id="b", behaviors=behaviors, constraints=(Constraint(operators=tuple(operators)),))


def test_random_ties_cost_few_nets(monkeypatch: pytest.MonkeyPatch) -> None:
    nets = 0
    assemble = Assembler.assemble

    def counted(self: Assembler, arrangement: Arrangement) -> Assembly:
        nonlocal nets
        nets += 1
        return assemble(self, arrangement)

    monkeypatch.setattr(Assembler, "assemble", counted)
    each = []
    for seed in range(12):
        nets = 0
        plan_block(tied_at_random(40, random.Random(seed)))
        each.append(nets)

    assert sorted(each)[6] <= 20, each
    assert max(each) <= 80, each
