"""Blocks beside each other: whose part is taken when, who waits, who does without, and what of it was foreseen."""

import asyncio
from collections.abc import Callable

import pytest
from msgspec.structs import replace

from engage_hri.schemas.behaviors import FaceLexeme, Gaze, GazeShift, Gesture, Head, Mark, Pointing, Posture, Speech
from engage_hri.schemas.blocks import Block, BlockOutcome, SyncPointProgress
from engage_hri.services.realizer.plan.assembly import Assembler
from engage_hri.services.realizer.plan.handover import Arrangement
from engage_hri.services.realizer.plan.known import Holder, Known, holders_of, needless_turns, qualified
from engage_hri.services.realizer.plan.planner import plan_block
from engage_hri.services.realizer.points import Point
from engage_hri.services.requests.ends import RequestRefused
from tests.realizer.fake_body import FakeBody, Script
from tests.realizer.planning import timed
from tests.realizer.stage import Stage, after, block, stage, together

WORDS = Speech(id="s", text="one two three four", marks=(Mark("m1", 3), Mark("m2", 7), Mark("m3", 13)))
"""Four seconds, told of each second."""
MORE = Speech(id="t", text="five")
LONG = timed(Pointing(id="p", target="x", mode="RIGHT_HAND"), start="0", end="6")
RIGHT = Gesture(id="q", lexeme="BEAT", mode="RIGHT_HAND")
"""2.25 s; its stroke is over after 1.5."""
LOOK = Gaze(id="g", target="x")
OTHER = Gaze(id="h", target="y")


async def told(
    *sent: tuple[float, Block],
    body: FakeBody | None = None,
    deed: tuple[float, Callable[[Stage], object]] | None = None,
) -> tuple[Stage, list[BlockOutcome]]:
    """All that is seen of blocks that are sent at these times, and their outcomes."""
    async with stage(body) as seen:
        now, pending = 0.0, []
        deeds: list[tuple[float, Callable[[Stage], object]]] = [
            (at, lambda seen, each=each: pending.append(seen.ask(each).outcome))  # type: ignore[misc]
            for at, each in sent
        ]
        for at, do in sorted([*deeds, *([deed] if deed else [])], key=lambda each: each[0]):
            await asyncio.sleep(at - now)
            now = at
            do(seen)
        outcomes = await asyncio.gather(*pending)
    return seen, outcomes


def instants(seen: Stage) -> dict[str, float]:
    """Each point, `block:behavior:sync`, by the clock of the bus."""
    return {
        f"{each.block}:{each.behavior}:{each.sync}": each.at.seconds
        for each in seen.feedback
        if isinstance(each, SyncPointProgress)
    }


def mispredicted(seen: Stage) -> list[str]:
    """Points that came at another time than feedback had said."""
    said = [each for each in seen.feedback if isinstance(each, SyncPointProgress)]
    return [
        f"{each.block}:{each.behavior}:{each.sync}"
        for each in said
        if abs(each.time - (each.predicted or 0.0)) > 1e-6
    ]


def warned(seen: Stage) -> list[tuple[str | None, str, str]]:
    return [(each.block, each.behavior, each.kind) for each in seen.warnings()]


# -- one part, two blocks -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("earlier", "later", "begins"),
    [
        (WORDS, MORE, 4.0),  # words are never cut short
        (RIGHT, Gesture(id="o", lexeme="WAVE", mode="RIGHT_HAND"), 2.25),  # nobody asks for it now
        (RIGHT, Gesture(id="o", lexeme="WAVE", mode="LEFT_HAND"), 0.5),
        (RIGHT, Gesture(id="o", lexeme="WAVE"), 0.5),  # the fake body prefers the right one
        (RIGHT, Gesture(id="o", lexeme="WAVE", mode="BOTH_HANDS"), 2.25),
        (LONG, Pointing(id="o", target="y", mode="RIGHT_HAND"), 6.0),
        (Head(id="n", lexeme="NOD"), Head(id="o", lexeme="SHAKE"), 1.0),
        (LOOK, Head(id="o", lexeme="NOD"), 0.5),
        (LOOK, FaceLexeme(id="o", lexeme="SMILE"), 0.5),
    ],
)
async def test_who_comes_takes_a_part_that_is_free_or_waits(earlier: Speech, later: Gesture, begins: float) -> None:
    seen, outcomes = await told((0.0, block((earlier,), id="one")), (0.5, block((later,), id="two")))

    assert instants(seen)[f"two:{later.id}:start"] == begins
    assert [each.status for each in outcomes] == ["done", "done"]
    assert (seen.warnings(), mispredicted(seen)) == ([], [])


@pytest.mark.parametrize(
    ("earlier", "later"),
    [
        (LOOK, OTHER),
        (FaceLexeme(id="g", lexeme="SMILE"), FaceLexeme(id="h", lexeme="FROWN")),
        (Posture(id="g", stance="STANDING"), Posture(id="h", stance="SITTING")),
    ],
)
@pytest.mark.parametrize("at", [0.25, 2.0])
async def test_a_look_that_lasts_is_handed_over_once_it_is_on_target(earlier: Gaze, later: Gaze, at: float) -> None:
    seen, _ = await told((0.0, block((earlier, WORDS), id="one")), (at, block((later,), id="two")))

    times = instants(seen)
    taken = max(at, 0.5 if earlier.id == "g" and not isinstance(earlier, FaceLexeme) else 0.25)
    assert times["one:g:stroke"] <= taken == times["two:h:start"] == times["one:g:relax"] == times["one:g:end"]
    assert (seen.warnings(), mispredicted(seen)) == ([], [])


@pytest.mark.parametrize("awaits", ["two", "three"])
async def test_a_look_that_lasts_leaves_by_itself_if_others_wait_for_that(awaits: str) -> None:
    """It would leave for who takes its place; but that one waits until it has left, as does who is tied to that."""
    first = block((Posture(id="p", stance="SITTING"), Speech(id="t", text="five")), id="one")
    leaves = after("one:p:relax", "e:relax")
    smile, taker = FaceLexeme(id="e", lexeme="SMILE"), Posture(id="p", stance="STANDING")
    second = block((taker,), id="two") if awaits == "three" else block((taker, smile), leaves, id="two")
    third = block((smile,), leaves, id="three")
    sent = [(0.0, first), (0.125, third), (0.25, second)] if awaits == "three" else [(0.0, first), (0.25, second)]
    seen, outcomes = await told(*sent)

    assert [each.status for each in outcomes] == ["done"] * len(sent)
    times = instants(seen)
    assert times["one:p:relax"] == times["one:t:end"] == 1.0
    assert times[f"{awaits}:e:relax"] == times["two:p:start"] == 1.0


async def test_a_gesture_that_has_made_its_stroke_loses_its_way_home_and_no_more() -> None:
    asked = block((timed(RIGHT, start="t:start"), MORE), id="two")
    seen, _ = await told((0.0, block((RIGHT,), id="one")), (0.5, asked))

    times = instants(seen)
    assert times["one:q:stroke_end"] == times["one:q:end"] == times["two:q:start"] == times["two:t:start"] == 1.5
    assert (seen.warnings(), mispredicted(seen)) == ([], [])


async def test_what_others_wait_for_is_not_taken() -> None:
    """The words come after the way home, which is otherwise the first to be given up."""
    tied = block((RIGHT, MORE), after("q:end", "t:start"), id="one")
    seen, _ = await told((0.0, tied), (0.5, block((timed(RIGHT, start="u:start"), replaced("u")), id="two")))

    times = instants(seen)
    assert times["one:q:end"] == times["one:t:start"] == times["two:q:start"] - 1.0 == 2.25
    assert (seen.warnings(), mispredicted(seen)) == ([], [])


def replaced(id: str) -> Speech:
    return Speech(id=id, text="six")


async def test_who_has_a_fixed_time_for_a_part_that_is_taken_is_dropped_and_told_who_has_it() -> None:
    seen, outcomes = await told((0.0, block((LONG,), id="one")), (0.5, block((timed(RIGHT, start="0"),), id="two")))

    (warning,) = seen.warnings()
    assert (warning.block, warning.behavior, warning.kind) == ("two", "q", "IMPOSSIBLE_TO_SCHEDULE")
    assert "one:p has the right arm until one:p:end, 5.50 s after" in warning.message
    assert [each.dropped for each in outcomes] == [(), ("q",)]
    assert seen.progress("one")[-1].time == 6.0


async def test_who_must_not_be_dropped_takes_nothing_either_his_block_is_refused() -> None:
    async with stage() as seen:
        first = seen.ask(block((LONG,), id="one"))
        await asyncio.sleep(0.5)
        required = Gesture(id="q", lexeme="BEAT", mode="RIGHT_HAND", required=True)
        with pytest.raises(RequestRefused, match="one:p has the right arm"):
            await seen.ask(block((timed(required, start="0"),), id="two")).outcome
        await first.outcome

    assert seen.times("one")["p:end"] == 6.0
    assert warned(seen) == [("two", "", "IMPOSSIBLE_TO_SCHEDULE")]


async def test_words_that_are_to_begin_while_another_block_speaks_are_dropped_with_a_reason() -> None:
    seen, _ = await told((0.0, block((WORDS,), id="one")), (0.5, block((timed(MORE, start="0"),), id="two")))

    assert warned(seen) == [("two", "t", "IMPOSSIBLE_TO_SCHEDULE")]
    assert "one:s has the voice until one:s:end" in seen.warnings()[0].message


async def test_who_comes_finds_a_gap_before_what_is_to_come_and_otherwise_waits() -> None:
    later = block((timed(RIGHT, start="3"),), id="one")
    quick, slow = Gesture(id="o", lexeme="BEAT", mode="RIGHT_HAND"), Gesture(id="r", lexeme="BEAT", mode="RIGHT_HAND")
    seen, _ = await told((0.0, later), (0.5, block((quick,), id="two")), (0.75, block((slow,), id="three")))

    times = instants(seen)
    assert (times["two:o:start"], times["one:q:start"], times["three:r:start"]) == (0.5, 3.0, 5.25)
    assert (seen.warnings(), mispredicted(seen)) == ([], [])


async def test_many_wait_in_the_order_in_which_they_came() -> None:
    said = [block((Speech(id="s", text="so"),), id=f"b{number}") for number in range(5)]
    seen, _ = await told(*[(0.0, each) for each in said])

    assert [instants(seen)[f"b{number}:s:start"] for number in range(5)] == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert (seen.warnings(), mispredicted(seen)) == ([], [])


async def test_a_shift_takes_nothing_from_the_look_of_another_block() -> None:
    seen, _ = await told(
        (0.0, block((LOOK, WORDS), id="one")), (1.0, block((GazeShift(id="h", target="y"),), id="two"))
    )

    assert instants(seen)["one:g:relax"] == 4.0
    assert seen.warnings() == []


async def test_who_waits_for_a_part_goes_on_when_the_other_is_dropped() -> None:
    failing = FakeBody({"p": Script(fail="stroke")})
    seen, _ = await told((0.0, block((LONG, WORDS), id="one")), (0.5, block((RIGHT,), id="two")), body=failing)

    assert instants(seen)["two:q:start"] == 1.25
    assert warned(seen) == [("one", "p", "EXECUTION_FAILURE")]


async def test_who_waits_for_a_part_goes_on_when_the_other_block_is_cancelled() -> None:
    deed = (1.0, lambda seen: seen.requests.cancel("r-one"))
    seen, _ = await told((0.0, block((LONG,), id="one")), (0.5, block((RIGHT,), id="two")), deed=deed)

    assert instants(seen)["two:q:start"] == 1.0
    assert seen.warnings() == []


# -- points of other blocks -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("slow", [1.0, 1.5])
async def test_a_stroke_meets_the_end_of_another_block(slow: float) -> None:
    tied = block((timed(RIGHT, stroke="one:bml:end+0.25"),), id="two")
    seen, _ = await told((0.0, block((WORDS,), id="one")), (0.5, tied), body=FakeBody({"s": Script(slow=slow)}))

    assert instants(seen)["two:q:stroke"] == 4.0 * slow + 0.25
    assert seen.warnings() == []


async def test_a_stroke_that_has_been_made_too_early_is_told() -> None:
    tied = block((timed(RIGHT, stroke="one:bml:end+0.25"),), id="two")
    body = FakeBody({"s": Script(durations=(1.0, 1.0, 1.0, 1.75))})
    seen, _ = await told((0.0, block((WORDS,), id="one")), (0.5, tied), body=body)

    assert instants(seen)["two:q:stroke"] < 5.0 - 0.1
    assert warned(seen) == [("two", "q", "LATE")]
    assert "earlier than it should be: q:stroke = one:bml:end+0.25" in seen.warnings()[0].message


async def test_the_first_prediction_knows_what_another_block_expects() -> None:
    tied = block((timed(MORE, start="one:s:end+0.5"),), id="two")
    seen, _ = await told((0.0, block((WORDS,), id="one")), (1.0, tied))

    assert seen.times("two") == {"t:start": 3.5, "t:end": 4.5}
    assert mispredicted(seen) == []


async def test_a_point_that_has_been_is_an_instant_in_the_past() -> None:
    tied = block((timed(RIGHT, start="one:s:m1+1"),), id="two")
    seen, _ = await told((0.0, block((WORDS,), id="one")), (1.5, tied))

    assert instants(seen)["two:q:start"] == 2.0
    assert (seen.warnings(), mispredicted(seen)) == ([], [])


async def test_a_block_that_waited_for_its_turn_still_knows_the_one_before() -> None:
    tied = block((timed(RIGHT, start="one:s:end+2"),), id="two", composition="APPEND")
    seen, _ = await told((0.0, block((WORDS,), id="one")), (1.0, tied))

    assert instants(seen)["two:q:start"] == 6.0
    assert (seen.warnings(), mispredicted(seen)) == ([], [])


async def test_a_point_that_is_expected_after_a_fixed_time_is_not_waited_for() -> None:
    short = FaceLexeme(id="f", lexeme="SMILE")
    tied = block((timed(short, start="1", relax="1.5", stroke="one:s:end"),), id="two")
    seen, outcomes = await told((0.0, block((WORDS,), id="one")), (0.0, tied))

    planned = seen.warnings()[0]
    assert (planned.block, planned.kind) == ("two", "LATE")
    assert "earlier than it should be: f:stroke = one:s:end" in planned.message
    assert outcomes[1].dropped == ()
    times = instants(seen)
    assert (times["two:f:start"], times["two:f:relax"]) == (1.0, 1.5)


async def test_who_cannot_set_out_for_a_point_that_comes_too_late_keeps_its_own_time() -> None:
    tied = block((timed(LOOK, stroke="1"),), together("one:s:end", "g:stroke"), id="two")
    seen, _ = await told((0.0, block((WORDS,), id="one")), (0.0, tied))

    assert instants(seen)["two:g:stroke"] == 1.0
    assert [each.kind for each in seen.warnings()] == ["LATE"]


@pytest.mark.parametrize("is_required", [True, False])
async def test_a_tie_that_is_required_fails_the_block_when_the_other_vanishes(is_required: bool) -> None:
    tied = block((timed(Speech(id="t", text="five", required=is_required), start="one:s:end"),), id="two")
    deed = (1.5, lambda seen: seen.requests.cancel("r-one"))
    seen, (_, outcome) = await told((0.0, block((WORDS,), id="one")), (0.5, tied), deed=deed)

    if is_required:
        assert outcome.status == "failed"
        assert "one:s:end" in str(outcome.fault)
        assert warned(seen) == [("two", "t", "EXECUTION_FAILURE")]
        assert "two:t:start" not in instants(seen)
    else:
        assert (outcome.status, instants(seen)["two:t:start"], warned(seen)) == ("done", 1.5, [])


async def test_what_has_ended_needs_its_tie_no_more() -> None:
    """Two points of the other block are named; the first has come, and the required behavior is over."""
    required = timed(Speech(id="t", text="five", required=True), start="one:p:stroke")
    tied = block((required, RIGHT), after("one:p:end", "q:start"), id="two")
    deed = (4.0, lambda seen: seen.requests.cancel("r-one"))
    seen, (_, outcome) = await told((0.0, block((LONG,), id="one")), (0.5, tied), deed=deed)

    assert (outcome.status, seen.warnings()) == ("done", [])


async def test_to_follow_what_one_replaces_is_refused() -> None:
    async with stage() as seen:
        first = seen.ask(block((WORDS,), id="one"))
        await asyncio.sleep(0.5)
        with pytest.raises(RequestRefused, match="follows blocks that it replaces"):
            await seen.ask(block((MORE,), id="two", composition="REPLACE"), "one").outcome
        await first.outcome

    assert seen.times("one")["s:end"] == 4.0


async def test_blocks_that_queue_for_the_voice_are_planned_in_few_rounds(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Who comes waits for the last in the queue, and does not find out about each of the others one by one."""
    rounds = 0
    assemble = Assembler.assemble

    def counted(assembler: Assembler, arrangement: Arrangement) -> object:
        nonlocal rounds
        rounds += 1
        return assemble(assembler, arrangement)

    monkeypatch.setattr(Assembler, "assemble", counted)
    speeches = tuple(Speech(id=f"s{number}", text="one two") for number in range(3))
    _, outcomes = await told(*((0.0, block(speeches, id=f"b{number}")) for number in range(12)))

    assert [each.status for each in outcomes] == ["done"] * 12
    assert rounds < 12 * 12


def test_who_takes_a_part_after_a_stroke_by_plan_waits_for_that_stroke() -> None:
    """The stroke may turn out slow: the earlier block is late then, and the later one is not to take its arm."""
    body = FakeBody()
    other = plan_block(block((RIGHT,), id="a"), [body.estimate(RIGHT)])
    kept = frozenset(other.constrained)
    holders = holders_of("a", other.chains, other.estimates, other.natural, kept, (), lambda id: 1, {})
    times = {qualified("a", point): other.predicted(point) - 1.0 for point in other.chains["q"].points}
    known = Known(blocks={"a": other.block}, points=times, holders=dict(holders))
    later = timed(Gesture(id="r", lexeme="BEAT", mode="RIGHT_HAND"), start="0.75")

    plan = plan_block(block((later,), id="b"), [body.estimate(later)], known=known)

    assert times[Point("a:q", "stroke_end")] < 0.75 < times[Point("a:q", "end")]
    assert [str(point) for point in plan.foreign] == ["a:q:stroke_end"]


@pytest.mark.parametrize(("sync", "is_needless"), [("stroke_end", False), ("relax", True), ("end", True)])
def test_nobody_waits_for_a_way_home_that_another_saves(sync: str, is_needless: bool) -> None:
    """The way home begins with the first point after the stroke: who comes third waits for the second alone."""
    body = FakeBody()
    ours, second, third = (Gesture(id=id, lexeme="BEAT", mode="RIGHT_HAND") for id in ("first", "second", "third"))
    chain = {each.id: plan_block(block((each,)), [body.estimate(each)]).chains[each.id] for each in (second, third)}
    holder = plan_block(block((ours,)), [body.estimate(ours)]).chains["first"]
    holder = replace(holder, points=tuple(Point("x:first", each.sync) for each in holder.points))
    turn = ("third", Point("x:first", sync))
    found = needless_turns(
        {turn, ("third", Point("second", "end"))},
        {"x:first": "second"},
        Known(holders={"x:first": Holder(holder, is_natural=True, kept=frozenset())}),
        chain,
    )

    assert found == ({turn} if is_needless else set())
