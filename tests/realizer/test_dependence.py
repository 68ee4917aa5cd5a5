"""Points of other blocks that come only after those of a block, held against what happens if one of these is late.

The oracle plans all blocks twice, one after the other: as expected, and with one point of the first a long time
later. What comes later by that waits for it. It knows nothing of nets.
"""

from collections.abc import Collection, Mapping, Sequence
from contextlib import ExitStack
from random import Random

import pytest

from engage_hri.schemas.behaviors import BlockBehavior, Gesture, Head, Mark, Speech, Wait
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.plan.known import BLOCK_END, BLOCK_START, Known, qualified
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.plan.planner import plan_block
from engage_hri.services.realizer.points import Point
from engage_hri.services.realizer.together.knowledge import needed_by, waiting_for
from engage_hri.services.realizer.together.live_blocks import LiveBlocks, WaitingBlock
from tests.random_cases import share_of
from tests.realizer.fake_body import FakeBody
from tests.realizer.planning import timed
from tests.realizer.stage import after, block

LATE: Seconds = 100.0
BODY = FakeBody()


class Performed(WaitingBlock):
    """A block that others may be tied to, as `LiveBlocks` sees it; it tells no times."""

    def __init__(self, plan: Plan, live: LiveBlocks, leaders: Collection[str] = ()) -> None:
        super().__init__(plan, live, lambda: 0.0, leaders)

    def times(self) -> Mapping[Point, Seconds]:
        return {}


class World:
    """Blocks in the order in which they came, each planned with the times of those before it. behind: see `add`."""

    def __init__(self, late: Point | None = None) -> None:
        """late: the point that comes `LATE` seconds later than it is planned."""
        self.late = late
        self.live, self._opened = LiveBlocks(lambda: 0.0), ExitStack()
        self.blocks: dict[str, Block] = {}
        self.times: dict[Point, Seconds] = {}
        self.plans: dict[str, Plan] = {}

    def add(self, block: Block, behind: Sequence[str] = ()) -> None:
        """Plan one more block; behind: blocks that have to end before it begins."""
        since = max((self.times[qualified(each, BLOCK_END)] for each in behind), default=0.0)
        known = {point: at - since for point, at in self.times.items()}
        moved = [each for each in block.behaviors if not isinstance(each, Wait)]
        plan = plan_block(block, map(BODY.estimate, moved), known=Known(blocks=self.blocks, points=known))
        self.blocks[block.id], self.plans[block.id] = block, plan
        own = {point: plan.schedule[at] for point, at in plan.at.items() if ":" not in point.behavior}
        for point, at in {**own, BLOCK_START: 0.0, BLOCK_END: plan.schedule[-1]}.items():
            name = qualified(block.id, point)
            self.times[name] = since + at + (LATE if name == self.late else 0.0)
        self._opened.enter_context(self.live.opened(block))
        self.live.perform(block.id, Performed(plan, self.live, behind), self.blocks)

    def reach(self, name: str, *points: str) -> None:
        for each in points:
            behavior, _, sync = each.partition(":")
            self.live.reach(name, Point(behavior, sync), 0.0)


def waits(world: World, name: str) -> dict[Point, set[Point]]:
    return {point: set(of) for point, of in waiting_for(name, world.live).items()}


# -- the oracle ------------------------------------------------------------------------------------------------------

Told = list[tuple[Block, tuple[str, ...]]]


def behavior_of(chance: Random, number: int) -> BlockBehavior:
    kind = chance.randrange(4)
    if kind == 0:
        return Gesture(id=f"g{number}", lexeme="BEAT", mode=chance.choice(("LEFT_HAND", "RIGHT_HAND")))
    if kind == 1:
        return Speech(id=f"s{number}", text="one two three", marks=(Mark("m", 4),))
    if kind == 2:
        return Head(id=f"h{number}", lexeme="NOD")
    return Wait(id=f"w{number}", duration=1.0)


SYNCS: Mapping[type, tuple[str, ...]] = {
    Gesture: ("start", "ready", "stroke_start", "stroke", "stroke_end", "relax", "end"),
    Head: ("start", "ready", "stroke_start", "stroke", "stroke_end", "relax", "end"),
    Speech: ("start", "m", "end"),
    Wait: ("start", "end"),
}
TIED: Mapping[type, tuple[str, ...]] = {
    Gesture: ("start", "ready", "stroke_end", "relax"), Head: ("start", "ready"), Speech: ("start",),
    Wait: ("start",),
}  # fmt: skip
"""Points where a behavior can wait for something: what comes by prediction alone is not late for it by `LATE`."""


def told(chance: Random) -> Told:
    """Blocks, each with those that have to end before it begins."""
    found: Told = []
    for number in range(chance.randint(2, 4)):
        behaviors: list[BlockBehavior] = []
        for each in range(chance.randint(1, 3)):
            one = behavior_of(chance, each)
            if found and chance.random() < 0.6:
                other, _ = chance.choice(found)
                to = chance.choice(other.behaviors)
                ref = f"{other.id}:{to.id}:{chance.choice(SYNCS[type(to)])}"
                if chance.random() < 0.2:
                    ref = f"{other.id}:bml:end"
                one = timed(one, **{chance.choice(TIED[type(one)]): ref})
            elif behaviors and chance.random() < 0.4:
                to = chance.choice(behaviors)
                one = timed(one, **{chance.choice(TIED[type(one)]): f"{to.id}:{chance.choice(SYNCS[type(to)])}"})
            behaviors.append(one)
        behind = tuple(each.id for each, _ in found) if found and chance.random() < 0.3 else ()
        found.append((block(tuple(behaviors), id=f"b{number}"), behind))
    return found


def world(blocks: Told, late: Point | None = None) -> World:
    made = World(late)
    for each, behind in blocks:
        made.add(each, behind)
    return made


@pytest.mark.parametrize("seed", range(share_of(60)))
def test_what_comes_later_if_a_point_is_late_waits_for_it_and_nothing_else_does(seed: int) -> None:
    """Where another order would serve then, the plans differ, and say nothing."""
    blocks = told(Random(seed))
    expected = world(blocks)
    found = waits(expected, "b0")
    named = {point for plan in expected.plans.values() for point in plan.foreign if point.behavior.startswith("b0:")}
    for point in sorted({*named, qualified("b0", BLOCK_END)}):
        late = world(blocks, point)
        if [each.turns for each in late.plans.values()] != [each.turns for each in expected.plans.values()]:
            continue
        later = {each for each, at in late.times.items() if at > expected.times[each] + LATE / 2}
        own = Point(point.behavior.removeprefix("b0:"), point.sync)
        of_others = {each for each in later if is_of_others(each)}

        assert {each for each, of in found.items() if own in of and is_of_others(each)} == of_others, (seed, point)


def is_of_others(point: Point) -> bool:
    return not point.behavior.startswith("b0:") and not point.behavior.endswith(":")


# -- by hand ---------------------------------------------------------------------------------------------------------

ARM = Gesture(id="g", lexeme="BEAT", mode="LEFT_HAND")
OTHER_ARM = Gesture(id="h", lexeme="BEAT", mode="RIGHT_HAND")
WORDS = Speech(id="s", text="one two three", marks=(Mark("m", 4),))
END = "b0:bml:end"


def two(*behaviors: BlockBehavior, first: Sequence[BlockBehavior] = (ARM,), behind: Sequence[str] = ()) -> World:
    made = World()
    made.add(block(tuple(first), id="b0"))
    made.add(block(behaviors, id="b1"), behind)
    return made


def syncs(world: World, own: str, behavior: str) -> list[str]:
    """Points of a behavior, `block:behavior`, that wait for a point of the first block."""
    of, _, sync = own.partition(":")
    found = waiting_for("b0", world.live).items()
    return [point.sync for point, waits in found if point.behavior == behavior and Point(of, sync) in waits]


def test_what_comes_before_the_tie_does_not_wait() -> None:
    made = two(timed(OTHER_ARM, stroke_end="b0:g:start"))

    assert sorted(syncs(made, "g:start", "b1:h")) == ["end", "relax", "stroke_end"]
    assert Point("b1:bml", "end") in waits(made, "b0")


def test_seconds_are_counted_from_the_point() -> None:
    made = two(timed(OTHER_ARM, start="b0:g:ready+0.25"))
    found = waiting_for("b0", made.live)[Point("b1:h", "stroke")]

    shortest = [each.shortest for each in BODY.estimate(OTHER_ARM).phases]
    assert found[Point("g", "ready")] == pytest.approx(0.25 + sum(shortest[:3]))


def test_who_sets_out_just_in_time_waits_before_it_does() -> None:
    made = two(timed(OTHER_ARM, stroke="b0:g:relax"))

    assert len(syncs(made, "g:relax", "b1:h")) == 7
    assert len(syncs(two(timed(OTHER_ARM, stroke_end="b0:g:relax")), "g:relax", "b1:h")) == 3


def test_words_wait_before_they_begin_for_what_a_mark_is_tied_to() -> None:
    made = two(timed(WORDS, m="b0:g:relax"))

    assert sorted(syncs(made, "g:relax", "b1:s")) == ["end", "m", "start"]


def test_words_that_are_said_wait_for_nothing() -> None:
    made = two(timed(WORDS, end="b0:g:end"))
    assert "end" in syncs(made, "g:end", "b1:s")
    made.reach("b1", "s:start")

    assert syncs(made, "g:end", "b1:s") == []


def test_what_is_left_of_an_instant_waits_though_a_word_has_passed_it() -> None:
    made = World()
    made.add(block((ARM,), id="b0"))
    made.add(block((WORDS, timed(OTHER_ARM, stroke_end="s:m")), after("b0:g:relax", "s:m"), id="b1"))
    made.reach("b1", "s:start", "s:m", "h:start", "h:ready", "h:stroke_start", "h:stroke")

    assert sorted(syncs(made, "g:relax", "b1:h")) == ["end", "relax", "stroke_end"]


def test_nobody_waits_for_what_has_been() -> None:
    made = two(timed(OTHER_ARM, start="b0:g:start"))
    made.reach("b0", "g:start")

    assert syncs(made, "g:start", "b1:h") == []


def test_a_block_that_waits_for_its_turn_waits_for_the_end_with_all_it_has() -> None:
    made = two(OTHER_ARM, behind=("b0",))

    assert len(syncs(made, "bml:end", "b1:h")) == 7


def test_who_is_tied_to_that_waits_too_also_for_what_it_has_dropped_so_far() -> None:
    """The second block drops its words, which are to end before they begin: that it does is told as it begins."""
    made = two(timed(Gesture(id="x", lexeme="BEAT", mode="LEFT_HAND"), start="1", end="1.1"), behind=("b0",))
    assert made.plans["b1"].dropped == ("x",)
    made.blocks["b1"] = block((Gesture(id="x", lexeme="BEAT", mode="LEFT_HAND"),), id="b1")
    made.add(block((timed(OTHER_ARM, ready="b1:x:stroke"),), id="b2"))

    assert len(syncs(made, "bml:end", "b2:h")) == 7


def test_who_hands_a_part_over_goes_home_by_itself() -> None:
    later = Gesture(id="k", lexeme="BEAT", mode="RIGHT_HAND")
    made = two(timed(OTHER_ARM, start="0"), timed(later, start="b0:g:relax"))
    assert any(each.kind == "handover" for each in made.plans["b1"].net.places)

    assert syncs(made, "g:relax", "b1:h") == []
    assert len(syncs(made, "g:relax", "b1:k")) == 7


# -- what has to come before -----------------------------------------------------------------------------------------


def needed(world: World, *points: str) -> dict[str, set[str]]:
    named = []
    for each in points:
        of, _, sync = each.rpartition(":")
        named.append(Point(of, sync))
    waiting = {name: (plan, leaders) for plan, leaders in world.live.plans if (name := plan.block.id) and leaders}
    return {name: found for name, found in needed_by(named, waiting).items() if found - {""}}


def test_what_comes_before_a_point_of_a_block_that_waits_is_needed_and_nothing_else() -> None:
    made = two(OTHER_ARM, timed(WORDS, start="h:relax"), Head(id="n", lexeme="NOD"), behind=("b0",))

    assert needed(made, "b1:h:stroke") == {"b1": {"", "h"}}
    assert needed(made, "b1:s:m") == {"b1": {"", "h", "s"}}
    assert needed(made, "b1:bml:end") == {"b1": {"", "h", "s", "n"}}
    assert needed(made, "b0:g:end") == {}


def test_the_turn_of_a_block_waits_for_all_of_those_before_it() -> None:
    made = two(OTHER_ARM, behind=("b0",))
    made.add(block((WORDS,), id="b2"), ("b0", "b1"))

    assert needed(made, "b2:s:start") == {"b1": {"", "h"}, "b2": {"", "s"}}


def test_what_a_waiting_block_is_tied_to_in_another_is_needed() -> None:
    made = two(OTHER_ARM, behind=("b0",))
    made.add(block((timed(WORDS, start="b1:h:ready"), Wait(id="w", duration=1.0)), id="b2"), ("b0",))

    assert needed(made, "b2:s:m") == {"b1": {"", "h"}, "b2": {"", "s"}}
    assert needed(made, "b2:w:end") == {"b2": {"", "w"}}
