"""Several live blocks: what ties them, who waits for whom, whose parts go home, and how any of them is stopped."""

import asyncio

import pytest

from engage_hri.schemas.behaviors import Event, Pointing, Speech, Wait
from engage_hri.services.realizer.points import Point
from engage_hri.services.realizer.together.live_blocks import LiveBlocks
from tests.realizer.fake_body import FakeBody, Script
from tests.realizer.puppet import BML_1_0, bml, puppet
from tests.realizer.stage import FakeRecognition, after, block, stage

SPEECH = '<speech id="s"><text>one two</text></speech>'
POINT = '<pointing id="p" target="x" mode="RIGHT_HAND"/>'


async def test_a_block_may_be_tied_to_one_that_was_sent_in_the_same_moment() -> None:
    tied = '<speech id="t" start="one:s:end+0.5"><text>so</text></speech>'
    async with puppet() as body:
        first, second = body.ask(bml(SPEECH, id="one")), body.ask(bml(tied, id="two"))
        await body.do("s", "start", "end", every=2.0, block="one")
        await body.do("t", "start", "end", every=1.0, block="two")
        await asyncio.gather(first.outcome, second.outcome)

    assert (body.time("s:end", "one"), body.time("t:start", "two")) == (2.0, 2.5)
    assert body.warnings() == []


async def test_a_block_may_be_tied_to_one_that_waits_for_its_turn() -> None:
    follower = block((Speech(id="t", text="so"),), after("two:bml:start+0.25", "t:start"), id="three")
    async with stage() as seen:
        first = seen.ask(block((Speech(id="s", text="one"),), id="one"))
        second = seen.ask(block((Wait(id="w", duration=1.0),), id="two", composition="APPEND"))
        third = seen.ask(follower)
        await asyncio.gather(first.outcome, second.outcome, third.outcome)

    assert [(end.block, end.at.seconds) for end in seen.ends()] == [("one", 1.0), ("two", 2.0), ("three", 2.25)]


async def test_points_of_other_blocks_are_spelled_in_ones_own_dialect() -> None:
    tied = '<speech id="t" start="one:p:strokeStart"><text>so</text></speech>'
    async with puppet() as body:
        first, second = body.ask(bml(POINT, id="one")), body.ask(bml(tied, id="two", dialect=BML_1_0))
        await body.do("p", "start", "ready", "stroke_start", every=1.0, block="one")
        await body.do("t", "start", "end", every=1.0, block="two")
        body.end("p", block="one")
        await asyncio.gather(first.outcome, second.outcome)

    assert body.time("t:start", "two") == 2.0


@pytest.mark.parametrize("ref", ["one:s:stroke", "one:nobody:start", "zero:s:start", "one:s:m"])
async def test_a_point_that_no_block_has_costs_the_tie_and_no_words(ref: str) -> None:
    async with puppet() as body:
        first = body.ask(bml(SPEECH, id="one"))
        second = body.ask(bml(f'<speech id="t" start="{ref}"><text>so</text></speech>', id="two"))
        await body.do("s", "start", "end", every=1.0, block="one")
        await body.do("t", "start", "end", every=1.0, block="two")
        await asyncio.gather(first.outcome, second.outcome)

    assert body.warnings() == [("two:t", "PARSING_FAILURE")]
    assert body.outcomes["two"].status == "done"


async def test_what_is_dropped_in_one_block_holds_nobody_in_another() -> None:
    async with stage(FakeBody({"p": Script(fail="ready")})) as seen:
        first = seen.ask(block((Pointing(id="p", target="a"), Wait(id="w", duration=20.0)), id="one"))
        second = seen.ask(block((Speech(id="s", text="so"),), after("one:p:end", "s:start"), id="two"))
        await asyncio.gather(first.outcome, second.outcome)

    assert seen.times("two")["s:start"] == 0.5
    assert seen.times("one")["w:end"] == 20.0


async def test_an_arm_that_another_block_moves_is_not_sent_home() -> None:
    async with puppet() as body:
        first = body.ask(bml(POINT, id="one"))
        await body.told("p", block="one")
        body.reach("p", "start", block="one")
        tied = (
            '<speech id="t"><text>so</text></speech><pointing id="p" target="x" mode="RIGHT_HAND" start="t:start"/>'
        )
        second = body.ask(bml(tied, id="two"))
        body.reach("p", "ready", "stroke_start", "stroke", "stroke_end", block="one")  # on its way home
        await body.told("p", block="two")
        body.refuse("p", block="two")
        await body.do("t", "start", "end", every=0.5, block="two")
        await second.outcome
        homes = list(body.homes)
        body.end("p", "failed", block="one")
        await first.outcome

    assert homes == []
    assert body.homes == [("right_arm",)]
    assert body.warnings() == [("two:p", "CANNOT_CREATE_BEHAVIOR"), ("one:p", "EXECUTION_FAILURE")]


async def test_a_block_is_stopped_at_once_while_it_waits_for_its_turn() -> None:
    async with puppet() as body:
        first, second = body.ask(bml(SPEECH, id="one")), body.ask(bml(SPEECH, id="two", composition="APPEND"))
        await body.told("s", block="one")
        body.reach("s", "start", block="one")
        await second.accepted
        await asyncio.sleep(0.25)
        body.requests.cancel("r-two")
        await second.outcome
        stopped = body.client.now()
        body.end("s", block="one")
        await first.outcome

    assert stopped == 0.25
    assert body.outcomes["two"].status == "interrupted"
    assert body.course() == [("one", "start", ""), ("one", "end", "done")]


async def test_a_block_is_stopped_at_once_while_the_body_estimates() -> None:
    async with puppet(is_mute=True) as body:
        pending = body.ask(bml(SPEECH))
        await asyncio.sleep(0.25)
        body.requests.cancel("r-b")
        await pending.outcome
        stopped = body.client.now()

    assert stopped == 0.25
    assert (body.outcomes["b"].status, body.course(), body.performs) == ("interrupted", [], {})


async def test_of_a_storm_of_replacing_blocks_only_the_last_begins_when_all_is_home() -> None:
    async with puppet() as body:
        body.goes_home = False
        pending = [body.ask(bml(POINT, id="b0"))]
        await body.told("p", block="b0")
        for number in range(1, 10):
            pending.append(body.ask(bml(SPEECH, id=f"b{number}", composition="REPLACE")))
            await asyncio.sleep(0.125)
        await body.do("s", "start", "end", every=1.0, block="b9")
        await asyncio.gather(*(each.outcome for each in pending))

    assert [body.outcomes[f"b{n}"].replaced_by for n in range(10)] == [*(f"b{n}" for n in range(1, 10)), ""]
    assert body.course() == [
        ("b0", "start", ""), ("b0", "end", "interrupted"), ("b9", "start", ""), ("b9", "end", "done")
    ]  # fmt: skip
    assert set(body.performs) == {"b0:p", "b9:s"}


async def test_fifty_blocks_at_once_lose_nothing_and_speak_in_turn() -> None:
    waiting = '<wait id="w" duration="1"/><speech id="s" start="w:end"><text>one two</text></speech>'
    async with puppet() as body:
        pending = [body.ask(bml(waiting, id=f"b{number}")) for number in range(50)]
        spoken = [body.do("s", "start", "end", every=1.0, block=f"b{number}") for number in range(50)]
        await asyncio.gather(*spoken, *(each.outcome for each in pending))

    assert {each.status for each in body.outcomes.values()} == {"done"}
    assert len(body.course()) == 100
    assert [body.time("s:end", f"b{number}") for number in range(50)] == [2.0 + number for number in range(50)]


@pytest.mark.parametrize(("limit", "gone_at"), [(0.8, 0.1), (0.8, 1.0), (5.0, 4.0)])
async def test_an_event_ends_half_a_second_after_its_limit_whenever_recognition_goes(
    limit: float, gone_at: float
) -> None:
    event = Event(id="e", kind="backchannel", responder="human", limit=limit)
    async with stage(recognition=FakeRecognition({"e": None})) as seen:
        pending = seen.ask(block((event, Speech(id="s", text="so")), after("e:end", "s:start")))
        await seen.seen("e:start")
        await asyncio.sleep(gone_at)
        seen.hub.kill("recognition")
        await pending.outcome

    assert seen.times()["e:end"] == seen.times()["s:start"] == limit + 0.5


def test_a_block_that_is_over_is_past() -> None:
    class Ears:
        def __init__(self) -> None:
            self.heard: list[object] = []

        def hear(self, point: Point, at: float) -> None:
            self.heard.append((point, at))

        def miss(self, behaviors: object) -> None:
            self.heard.append(sorted(behaviors))  # type: ignore[call-overload]

    live_blocks, early, late = LiveBlocks(lambda: 0.0), Ears(), Ears()
    end, start = Point("one:s", "end"), Point("one:s", "start")
    one = block((Speech(id="s", text="so"),), id="one")
    with live_blocks.followed(late, [end]):
        pass
    with live_blocks.opened(one):
        live_blocks.reach("one", Point("s", "start"), 1.0)
        follows = live_blocks.followed(early, [start, end])
        follows.__enter__()
    follows.__exit__(None, None, None)

    assert late.heard == [["one:s"]]
    assert early.heard == [(start, 1.0), ["one:bml", "one:s"]]
    with live_blocks.opened(block((), id="two")):
        # It is past: what was reached can be named, and who would follow it hears of the rest that it never comes.
        assert live_blocks.named_by("two") == {"one": one}
        assert (live_blocks.is_lost(start), live_blocks.is_lost(end)) == (False, True)
        with live_blocks.followed(late, [end, start]):
            assert late.heard[1:] == [["one:s"], (start, 1.0)]
