"""Blocks that share parts and are tied to each other: nobody waits for ever, and no stroke is lost on the way."""

import asyncio

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Gesture, Wait
from engage_hri.schemas.blocks import BlockOutcome, Held
from engage_hri.schemas.requests import Refused
from engage_hri.services.requests.ends import Pending, RequestRefused
from tests.realizer.puppet import bml, puppet
from tests.realizer.stage import after, block, stage
from tests.realizer.steering import interrupt, steer, steered

RIGHT = 'lexeme="BEAT" hand="RIGHT_HAND"'
"""Takes 2.25 s; the stroke is over after 1.5."""


async def all_ended(*asked: Pending, within: float = 60.0) -> None:
    async with asyncio.timeout(within):
        await asyncio.gather(*[each.outcome for each in asked])


@pytest.mark.parametrize("offset", ["", "+0.5"])
@pytest.mark.parametrize("point", ["stroke_end", "relax"])
@pytest.mark.parametrize(
    "content",
    [
        '<gaze id="h" type="AT" target="box" start="{tie}"/>',
        '<gaze id="h" type="AT" target="box" stroke="{tie}"/>',
        '<gaze id="h" type="AT" target="box"/>'
        '<constraint><after ref="{tie}"><sync ref="h:stroke"/></after></constraint>',
        '<gaze id="h" type="AT" target="box" start="n:start"/><head id="n" type="NOD" start="{tie}"/>',
    ],
)
async def test_who_takes_a_look_may_be_tied_to_its_end(content: str, point: str, offset: str) -> None:
    """A look lasts until something takes its place: by plan it ends with its block then, which it may outlast."""
    async with stage() as seen:
        one = seen.ask(bml('<gaze id="g" type="AT" target="cup"/><gesture id="a" lexeme="BEAT"/>', "one"))
        await asyncio.sleep(1.0)
        two = seen.ask(bml(content.format(tie=f"one:g:{point}{offset}"), "two"))
        await all_ended(one, two)


async def test_who_has_gone_home_does_not_wait_for_the_one_that_was_to_take_the_part() -> None:
    async with stage() as seen:
        one = seen.ask(bml(f'<gesture id="g" {RIGHT}/>', "one"))
        await asyncio.sleep(0.5)
        two = seen.ask(bml(f'<gesture id="h" {RIGHT} end="w:end"/><wait id="w" duration="3"/>', "two"))
        await asyncio.sleep(0.5)
        await steered(seen, "hold", "two")
        await all_ended(one)
        ended = seen.times("one")["g:end"], seen.hub.join("clock").now()
        await steered(seen, "continue", "two")
        await all_ended(two)

    assert ended == (2.25, 2.25)


async def test_the_end_of_a_block_does_not_wait_for_one_that_waits_for_it() -> None:
    """A new plan of b2 puts the gesture that takes the arm of b1 after the end of b1."""
    later = (
        f'<gesture id="g0" {RIGHT} start="s1:start"/><speech id="s1" start="b1:bml:end">one</speech>'
        f'<gesture id="g2" {RIGHT} start="b0:g0:start-0.5"/>'
    )
    async with stage() as seen:
        asked = []
        for at, id, content in (
            (0.0, "b0", '<gesture id="g0" lexeme="BEAT"/>'),
            (0.75, "b1", '<pointing id="p2" target="cup" hand="RIGHT_HAND"/>'),
            (1.75, "b2", later),
            (2.0, "b4", f'<gesture id="g1" {RIGHT} stroke="b1:bml:start"/>'),
        ):
            await asyncio.sleep(at - asyncio.get_running_loop().time())
            asked.append(seen.ask(bml(content, id)))
        await all_ended(*asked, within=30.0)


async def test_who_hands_a_look_over_keeps_it_if_another_block_is_tied_to_its_end() -> None:
    """The look of b1 was to end as b2 takes the head. b3 names its end: b2 waits for that from then on."""
    event = '<ebml:event xmlns:ebml="edu.wpi.ebml" id="v3" kind="mutual_facial_gaze" responder="human"/>'
    look = '<gaze id="g{}" type="AT" target="cup" {}/>'
    first = (
        look.format(0, 'start="v3:end-0.5"') + '<gazeShift id="g1" target="cup" end="1.25"/>'
        f'<wait id="w2" duration="1" end="g1:end+1.0"/>{event}<speech id="s4" start="b0:s0:start">one</speech>'
    )  # fmt: skip
    second = look.format(0, 'start="b1:v3:start" required="true"') + look.format(1, 'required="true"')
    third = (
        look.format(0, 'end="b1:g0:stroke_end+0.5"') + f'<gesture id="g1" {RIGHT} start="b1:v3:end+1.0"/>'
        '<pointing id="p2" target="cup" hand="LEFT_HAND" start="b1:g1:end-0.5"/>'
    )  # fmt: skip
    async with stage() as seen:
        asked = [seen.ask(bml('<speech id="s0" start="1.5">one<sync id="m0"/>two</speech>', "b0"))]
        await asyncio.sleep(0.75)
        asked.append(seen.ask(bml(first, "b1", composition="APPEND")))
        await asyncio.sleep(0.25)
        asked.append(seen.ask(bml(second + look.format(2, 'ready="b0:s0:m0"'), "b2"), "b1"))
        await asyncio.sleep(0.25)
        await interrupt(seen.requests, "b0", "s0").outcome
        await asyncio.sleep(0.25)
        asked.append(seen.ask(bml(third, "b3")))
        await all_ended(*asked, within=50.0)


async def test_a_held_stroke_is_not_lost_to_one_that_is_planned_again() -> None:
    right = Gesture(id="g", lexeme="BEAT", mode="RIGHT_HAND")
    other = Gesture(id="h", lexeme="BEAT", mode="RIGHT_HAND")
    waits = Wait(id="w", duration=5.0), Wait(id="v", duration=1.0)
    async with stage() as seen:
        one = seen.ask(block((right,), id="one"))
        await asyncio.sleep(0.5)
        two = seen.ask(block((other, *waits), after("v:start", "h:end"), id="two"))
        await asyncio.sleep(0.75)
        await steered(seen, "hold", "one", "g")  # it waits at the end of its stroke, at 1.5
        await asyncio.sleep(1.0)
        await interrupt(seen.requests, "two", "w").outcome  # that block is planned again
        await asyncio.sleep(1.0)
        await seen.requests.send(*steer("go", "continue")).outcome
        await all_ended(one, two)

    assert seen.times("one")["g:stroke_end"] == 3.25
    assert seen.times("two")["h:start"] + 0.5 == 3.25
    assert [(each.block, each.behavior, each.kind) for each in seen.warnings()] == [("two", "w", "INTERRUPTED")]


async def test_a_point_that_was_reached_counts_though_its_behavior_was_dropped() -> None:
    """So the nod is planned for the time when the other's nod is made, and waits for it."""
    async with stage() as seen:
        asked = [seen.ask(bml('<gaze id="g0" type="AT" target="cup"/><gesture id="g3" lexeme="BEAT"/>', "b0"))]
        await asyncio.sleep(0.25)
        asked.append(seen.ask(bml('<head id="h1" type="NOD" start="b0:g0:stroke_end-0.25"/>', "b1")))
        await asyncio.sleep(0.65)
        await interrupt(seen.requests, "b0", "g0").outcome
        await asyncio.sleep(0.05)
        asked.append(seen.ask(bml('<head id="h0" type="NOD" start="b0:g0:ready+1.0"/>', "b3")))
        await all_ended(*asked)

    assert seen.times("b1")["h1:stroke_end"] + 0.25 == pytest.approx(seen.times("b3")["h0:start"] + 0.95)
    assert [(each.block, each.kind) for each in seen.warnings()] == [("b0", "INTERRUPTED"), ("b3", "LATE")]


@pytest.mark.parametrize("required", ["true", "false"])
async def test_words_give_up_a_time_for_those_of_another_block_unless_they_are_required(required: str) -> None:
    async with stage() as seen:
        one = seen.ask(bml('<speech id="s">one two three</speech>', "one"))
        await asyncio.sleep(0.25)
        two = seen.ask(bml(f'<speech id="t" start="0.25" required="{required}">four</speech>', "two"))
        await all_ended(one)
        (outcome,) = await asyncio.gather(two.outcome, return_exceptions=True)

    if required == "true":
        assert isinstance(outcome, RequestRefused)
        assert str(outcome).startswith("two: t, line 1: cannot be on time: one:s has the voice until one:s:end")
    else:
        assert isinstance(outcome, BlockOutcome)
        assert [each.text for each in outcome.spoken] == ["four"]
    assert [(each.block, each.kind) for each in seen.warnings()] == [("two", "IMPOSSIBLE_TO_SCHEDULE")]


async def test_that_a_refused_block_is_no_longer_held_is_told_before_its_refusal() -> None:
    async with puppet(is_mute=True) as body:
        with body.client.subscribe(keys.HELD, keys.request_state("realizer")) as inbox:
            body.ask(bml('<gesture id="g" lexeme="BEAT"/>'))
            await asyncio.sleep(0.5)
            body.requests.send(*steer("s", "hold", "b"))
            await asyncio.sleep(5.0)
            told = [received.message for _ in range(len(inbox)) if (received := await inbox.next())]

    of_it = [each for each in told if isinstance(each, Held | Refused)]
    assert [type(each) for each in of_it[-2:]] == [Held, Refused]


REQUIRED = '<gaze id="g" type="AT" target="cup" end="one:s:end+1" required="true"/><wait id="w" duration="3"/>'


async def test_what_is_ended_on_request_fails_no_block_when_its_tie_vanishes() -> None:
    async with stage() as seen:
        one = seen.ask(bml('<speech id="s">one</speech><wait id="v" duration="3"/>', "one"))
        await asyncio.sleep(0.25)
        two = seen.ask(bml(REQUIRED, "two"))
        await asyncio.sleep(0.5)
        ended = [interrupt(seen.requests, *each).outcome for each in (("one", "s"), ("two", "g"))]
        await asyncio.gather(*ended)
        await all_ended(one, two)

    outcome = two.outcome.result()
    assert isinstance(outcome, BlockOutcome)
    assert (outcome.status, outcome.interrupted) == ("done", ("g",))
    assert [(each.block, each.behavior) for each in seen.warnings()] == [("one", "s"), ("two", "g")]


async def test_nor_while_a_slow_body_has_yet_to_end_it() -> None:
    async with puppet() as body:
        body.aborts = False
        body.ask(bml('<speech id="s">one</speech><wait id="v" duration="3"/>', "one"))
        await body.do("s", "start", block="one")
        two = body.ask(bml(REQUIRED, "two"))
        await body.do("g", "start", block="two")
        asked = [interrupt(body.requests, *each).outcome for each in (("two", "g"), ("one", "s"))]
        await asyncio.sleep(0.1)
        body.end("s", "aborted", block="one")
        await asyncio.sleep(0.5)
        body.end("g", "aborted", block="two")
        await all_ended(two)
        await asyncio.gather(*asked)

    assert (body.outcomes["two"].status, body.outcomes["two"].interrupted) == ("done", ("g",))
