"""What a block has to do with one that began after it: no more than what of that is in its way."""

import asyncio
import re

from engage_hri.schemas.behaviors import Gaze, Gesture, Speech, Wait
from tests.judge import playing
from tests.judge.story import Deed, Story
from tests.realizer.fake_body import FakeBody, Script
from tests.realizer.planning import timed
from tests.realizer.stage import after, block, stage
from tests.realizer.test_sharing import instants

RIGHT, LEFT = (Gesture(id=id, lexeme="BEAT", mode=mode) for id, mode in (("r", "RIGHT_HAND"), ("l", "LEFT_HAND")))  # type: ignore[arg-type]
"""2.25 s each; the stroke is over after 1.5."""


async def test_what_a_later_block_has_yet_to_begin_is_nobodys_loss() -> None:
    """The later one's right arm is slow, and in the way at 3 s. So its left arm would be in the way at 5 s, too; but
    it never begins, since the block is cancelled before that."""
    first = block((Wait(id="w", duration=3.0), RIGHT, timed(LEFT, start="5")), after("w:end", "r:start"), id="one")
    second = block((RIGHT, LEFT), after("r:end", "l:start"), id="two")
    async with stage(FakeBody({"r": Script(slow=2.4)})) as seen:
        earlier = seen.ask(first)
        await seen.seen("w:start", "one")
        seen.ask(second)
        await asyncio.sleep(3.25)
        seen.requests.cancel("r-two")
        await earlier.outcome

    times = instants(seen)
    assert times["two:r:start"] == 0.0
    assert times["one:l:start"] == 5.0
    assert [each.kind for each in seen.warnings() if each.block == "one"] == []


async def test_a_look_that_only_leaves_after_one_keeps_the_head_until_it_is_on_target() -> None:
    """The words of the first block are over long before they were to be, and its look comes while the other's is on
    its way. That one lasts until words that wait for the first block; but it is on target before these."""
    look, other = Gaze(id="g", target="a"), Gaze(id="h", target="b")
    first = block((Speech(id="a", text="one"), look, Wait(id="w", duration=3.0)), after("a:end", "g:start"), id="one")
    second = block((other, timed(Speech(id="t", text="two"), start="one:w:end")), id="two")
    body = FakeBody({"a": Script(durations=(1.25,))}, {"a": (4.0,)})
    async with stage(body) as seen:
        asked = [seen.ask(first)]
        await seen.seen("a:start", "one")
        await asyncio.sleep(1.0)
        asked.append(seen.ask(second))
        await asyncio.gather(*(each.outcome for each in asked))

    times = instants(seen)
    assert (times["two:h:start"], times["one:a:end"]) == (1.0, 1.25)
    assert times["one:g:start"] == times["two:h:stroke"] == 1.5
    assert [each.kind for each in seen.warnings() if each.kind != "LATE"] == []


WAITING = """<bml xmlns="http://www.bml-initiative.org/bml/bml-1.0" id="b2" composition="APPEND">
  <pointing id="p-0" target="lamp" mode="RIGHT_HAND"/>
  <gaze id="g1" target="cup"/>
  <face id="f2" start="p-0:end"><lexeme lexeme="LOWER_BROWS"/></face>
  <headDirectionShift id="h4" target="lamp" end="3.3"/>
  <constraint><synchronize><sync ref="g1:ready"/><sync ref="f2:attackPeak-1.0"/></synchronize></constraint>
</bml>"""
TIED = """<bml xmlns="http://www.bml-initiative.org/bml/bml-1.0" id="b3">
  <wait id="w0" start="3.0"/>
  <face id="f1" amount="0.8" attackPeak="b2:f2:attackPeak+0.3" required="true"><lexeme lexeme="OPEN_MOUTH"/></face>
  <constraint><synchronize ref="w0:start+1.0"><sync ref="f1:attackPeak"/></synchronize></constraint>
</bml>"""
MORE = """<bml xmlns="http://www.bml-initiative.org/bml/bml-1.0" id="b4">
  <gaze id="g0" target="lamp" ready="f2:attackPeak-0.5"/>
  <pointing id="p1" target="cup" mode="LEFT_HAND" relax="1.8"/>
  <faceFacs id="f2" au="12" amount="0.7"/>
  <constraint><after ref="g0:ready-0.2"><sync ref="p1:stroke-0.5"/><sync ref="f2:attackPeak"/></after></constraint>
</bml>"""
FIRST = """<bml xmlns="http://www.bml-initiative.org/bml/bml-1.0" id="b0">
  <postureShift id="p-0"><pose part="WHOLEBODY" lexeme="TURN_RIGHT"/></postureShift>
  <speech id="s1" start="p-0:end+0.3"><text>This one here.</text></speech>
  <faceLexeme id="f3" lexeme="RAISE_BROWS" start="s1:start"/>
</bml>"""


def test_a_tie_that_there_was_no_time_for_is_not_taken_up_when_the_other_waits_for_this_block() -> None:
    """The smile of b3 has a time, which comes before the point of b2 that it is tied to. So b2, whose turn comes, may
    wait for the face. Then b3 is planned again, since a slow face is in its way."""
    said = ((0.0, FIRST), (1.6, WAITING), (1.9, TIED), (3.4, MORE))
    deeds = tuple(Deed(at, "perform", re.findall(r'id="(b\d)"', xml)[0], xml) for at, xml in said)
    record = playing.play(Story(deeds, {"slow": [{"part": "face", "factor": 4.0}]}))

    assert record.errors == []
    assert {id: [each.status for each in ends] for id, ends in record.ends.items()} == {
        f"b{number}": ["done"] for number in (0, 2, 3, 4)
    }
