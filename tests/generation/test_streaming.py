"""Fragments of one turn that stream in, on a whole robot, in exact virtual time: words follow words without a gap."""

import asyncio
from collections.abc import AsyncIterator
from itertools import pairwise

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Gesture, Head, Speech, Timing
from engage_hri.schemas.body import AbortBehavior
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.turns.interjections import WORDLESS
from engage_hri.services.requests.ends import RequestRefused
from tests.commanding import command
from tests.generation.robots import Robot, robot, says, shows


@pytest.fixture
async def stage(hub: MemoryHub) -> AsyncIterator[Robot]:
    async with robot(hub) as it:
        yield it


def gaps(stage: Robot) -> list[float]:
    """Seconds of silence between utterances."""
    words = stage.words()
    return [round(later[1] - earlier[2], 6) for earlier, later in pairwise(words)]


# -- words follow words -------------------------------------------------------------------------------------------


async def test_words_follow_words_while_the_point_before_them_is_still_held(stage: Robot) -> None:
    stage.send(shows("a", "beginning"))
    stage.send(says("b", "end"))
    await stage.until("a:end")

    assert stage.words() == [("a:ref-phrase", 0.563333, 1.473333), ("b:s", 1.473333, 2.383333)]
    assert stage.reached["a:ref-event:end"] == stage.reached["a:ref-point:stroke_end"] == 3.363333
    # Until the words of a reference begin, it may be chosen again: what follows is sent then.
    assert stage.sent == {"a": 0.0, "b": 0.563333} | {id: at for id, at in stage.sent.items() if "-" in id}


async def test_a_model_that_is_faster_than_speech_is_spoken_in_order_without_a_gap(stage: Robot) -> None:
    stage.send(says("a", "beginning"))
    for number in range(10):
        stage.send(says(f"m{number}", "middle", "some words"))
    stage.send(says("z", "end"))
    await stage.until("z:end")

    assert [id for id, _, _ in stage.words()] == ["a:s", *(f"m{number}:s" for number in range(10)), "z:s"]
    assert gaps(stage) == [0.0] * 11
    assert stage.warnings == []


@pytest.mark.parametrize("pause", [0.3, 0.91, 2.0, 9.0])
async def test_a_model_that_is_slower_is_spoken_as_soon_as_it_can_be(stage: Robot, pause: float) -> None:
    stage.send(says("a", "beginning"))  # 0.91 s of words
    await asyncio.sleep(pause)
    stage.send(says("b", "end"))
    await stage.until("b:end")

    assert stage.words()[1][1] == max(0.91, pause)


async def test_after_ten_seconds_of_silence_the_turn_is_over(stage: Robot) -> None:
    stage.send(says("a", "beginning"))
    await asyncio.sleep(0.91 + 10.0)
    late = stage.send(says("b", "end"))
    with pytest.raises(RequestRefused, match="no turn open"):
        await late.outcome
    stage.send(says("c", "full"))
    await stage.until("c:end")

    assert [(each.signal.signal, each.signal.turn) for each in stage.signals] == [("aborted", "a"), ("ended", "c")]


async def test_silence_is_counted_from_where_the_last_block_has_ended(stage: Robot) -> None:
    stage.send(shows("a", "beginning"))
    await asyncio.sleep(15.0)

    assert stage.reached["a:end"] == 4.054904
    assert [(at, closed.reason) for at, closed in stage.closed] == [(14.054904, "silence for 10 s")]


async def test_a_turn_that_silence_has_ended_tells_that_its_pair_was_withdrawn(stage: Robot) -> None:
    stage.send(says("a", "beginning"))
    await asyncio.sleep(15.0)

    (closed,) = [closed for _, closed in stage.closed]
    assert [(event.kind, event.state) for event in closed.events] == [("adjacency_pair", "withdrawn")]


async def test_the_next_turn_waits_for_the_whole_turn_before(stage: Robot) -> None:
    stage.send(shows("a", "full"))
    for id, status in (("b", "beginning"), ("c", "end")):
        stage.send(says(id, status))
    await stage.until("c:end")

    assert stage.sent["b"] == stage.sent["c"] == stage.reached["a:end"] == 4.054904
    assert [id for id, _, _ in stage.words()] == ["a:ref-phrase", "b:s", "c:s"]
    assert gaps(stage)[1] == 0.0


# -- gazes and points across fragments ----------------------------------------------------------------------------


async def test_the_next_reference_waits_for_the_words_the_glance_and_the_arm_before_it(stage: Robot) -> None:
    stage.send(shows("a", "beginning"))
    stage.send(shows("b", "middle", "left"))
    await stage.until("b:ref-phrase:end")

    reached = stage.reached
    assert reached["a:ref-glance:start"] == reached["a:ref-phrase:end"] == 1.473333
    assert reached["b:ref-gaze:start"] == reached["a:ref-glance:stroke"] == 1.8355
    # b is planned while the arm of a is up, and so it points with the other one, as a's point is held still.
    assert reached["b:ref-point:start"] == reached["b:ref-gaze:start"]
    assert "a:ref-point:stroke_end" not in reached
    assert reached["b:ref-phrase:start"] == reached["b:ref-point:stroke_start"]


async def test_a_look_of_the_person_lets_go_of_the_point(stage: Robot) -> None:
    stage.send(shows("a", "beginning"))
    stage.send(shows("b", "middle", "left"))
    await asyncio.sleep(1.5)
    stage.does("look", "middle")
    await stage.until("a:ref-point:stroke_end")

    assert stage.reached["a:ref-point:stroke_end"] == 1.5


async def test_what_is_over_when_the_next_fragment_comes_is_not_waited_for(stage: Robot) -> None:
    stage.send(shows("a", "beginning"))
    await stage.until("a:ref-glance:stroke")
    stage.send(shows("b", "middle"))
    await stage.until("b:end")
    stage.send(says("c", "end"))
    await stage.until("c:end")

    assert [line for line in stage.constraints("b") if "a:" in line] == []  # it points with the arm that is free
    assert stage.constraints("c") == ["turn-gaze:stroke = s:end"]


async def test_the_last_glance_gives_way_to_the_look_that_ends_the_turn(stage: Robot) -> None:
    stage.send(shows("a", "beginning"))
    stage.send(says("b", "end"))
    await stage.until("a:end")

    reached = stage.reached
    assert reached["a:ref-glance:relax"] == reached["b:turn-gaze:start"]
    assert reached["b:turn-gaze:stroke"] == reached["b:s:end"] == 2.383333
    assert reached["b:turn-ended:start"] == 2.383333
    assert stage.signals[0].signal.signal == "ended"


async def test_an_end_without_words_ends_the_turn_once_the_glance_after_the_words_has_arrived(stage: Robot) -> None:
    stage.send(shows("a", "beginning"))
    await asyncio.sleep(1.0)
    stage.send(TurnFragment(id="z", turn_status="end"))
    await stage.until("z:end")

    ends = [stage.reached[point] for point in ("a:ref-phrase:end", "z:turn-gaze:start", "z:turn-ended:start")]
    assert ends == [1.473333, stage.reached["a:ref-glance:stroke"], stage.reached["a:ref-glance:stroke"]]


async def test_the_head_belongs_to_the_gaze_that_began_last_whichever_block_ends_first(stage: Robot) -> None:
    stage.send(shows("a", "beginning"))
    stage.send(shows("b", "middle", "left"))
    await stage.until("b:end")

    owners = [(at, each.owner.target) for at, each in stage.owners if each.owner.kind == "fragment" and at >= 0]
    targets = [target for number, (_, target) in enumerate(owners) if not number or owners[number - 1][1] != target]
    assert targets == ["middle", "human", "left", "human"]


async def test_profile_figure_looks_ahead_when_the_words_before_begin_or_as_soon_as_it_can(hub: MemoryHub) -> None:
    async with robot(hub, GenerationConfig(profile="figure-3.3")) as stage:
        stage.send(says("a", "beginning", "one two three four five six seven eight nine ten"))
        stage.send(shows("b", "middle", "middle"))
        stage.send(shows("c", "end", "left"))
        await stage.until("c:end")

        reached = stage.reached
        assert reached["b:ref-gaze:start"] == reached["a:s:start"]
        assert reached["c:ref-gaze:start"] == reached["b:ref-phrase:start"]  # till then b may be made otherwise
        assert reached["c:ref-point:start"] >= reached["c:ref-gaze:start"]
        assert reached["b:ref-phrase:start"] >= reached["a:s:end"]
        assert reached["c:ref-phrase:start"] >= reached["b:ref-phrase:end"]


# -- everything else of a fragment --------------------------------------------------------------------------------


async def test_nothing_of_a_fragment_begins_before_its_turn_to_speak(stage: Robot) -> None:
    beat, nod = Gesture(id="g", lexeme="BEAT"), Head(id="n", lexeme="NOD", timing=(Timing("start", "0.2"),))
    stage.send(says("a", "beginning"))
    stage.send(says("b", "middle", "some more words", beat, nod))
    await stage.until("b:end")

    begins = [stage.reached[f"b:{behavior}:start"] for behavior in ("s", "g", "n")]
    assert begins == [0.91, 0.91, 1.11]


async def test_a_stroke_waits_for_the_arm_that_an_earlier_fragment_still_moves(stage: Robot) -> None:
    beat = Gesture(id="g", lexeme="BEAT")
    for id, status in (("a", "beginning"), ("b", "middle"), ("c", "end")):
        stage.send(says(id, status, "go", beat))
    await stage.until("c:end")

    reached = stage.reached
    assert reached["b:g:start"] == reached["a:g:stroke_end"]
    assert reached["c:g:start"] == reached["b:g:stroke_end"]
    assert gaps(stage) == [0.0, 0.0]
    assert stage.warnings == []


async def test_a_fragment_without_words_does_not_delay_the_words_after_it(stage: Robot) -> None:
    stage.send(says("a", "beginning"))
    stage.send(TurnFragment(id="b", turn_status="middle", behaviors=(Gesture(id="g", lexeme="BEAT"),)))
    stage.send(says("c", "end"))
    await stage.until("c:end")

    assert stage.reached["b:g:start"] == stage.reached["c:s:start"] == stage.reached["a:s:end"] == 0.91


async def test_the_pair_is_announced_once_with_the_first_words_of_the_first_fragment(stage: Robot) -> None:
    for id, status in (("a", "beginning"), ("b", "middle"), ("c", "end")):
        stage.send(shows(id, status) if id == "a" else says(id, status))
    await stage.until("c:end")

    pairs = [event for event in stage.events if event.kind == "adjacency_pair" and event.state == "started"]
    assert [(event.block, event.turn) for event in pairs] == [("a", "a")]
    assert round(stage.bus.local(pairs[0].started) - stage.began, 6) == stage.reached["a:ref-phrase:start"]


async def test_a_first_fragment_without_words_announces_the_pair_with_its_block(stage: Robot) -> None:
    nod = Head(id="n", lexeme="NOD", timing=(Timing("start", "0.5"),))
    stage.send(TurnFragment(id="a", turn_status="beginning", behaviors=(nod,)))
    stage.send(says("b", "end"))
    await stage.until("b:end")

    pairs = [event for event in stage.events if event.kind == "adjacency_pair" and event.state == "started"]
    assert [round(stage.bus.local(event.started) - stage.began, 6) for event in pairs] == [0.0]


# -- what ends a turn of several live blocks ----------------------------------------------------------------------


async def test_cancelling_one_fragment_of_a_turn_ends_all_and_nobody_speaks_up(stage: Robot) -> None:
    for id, status in (("a", "beginning"), ("b", "middle"), ("c", "middle")):
        stage.send(shows(id, status))
    await asyncio.sleep(0.9)
    stage.cancel("b")
    await asyncio.sleep(20.0)

    assert {id: outcome.status for id, (_, outcome) in stage.outcomes.items()} == dict.fromkeys("cba", "interrupted")
    assert [id for id, _, _ in stage.words()] == ["a:ref-phrase"]
    assert [(each.signal.signal, each.signal.turn) for each in stage.signals] == [("aborted", "a")]
    assert [(closed.status, closed.reason) for _, closed in stage.closed] == [("aborted", "changed my mind")]


@pytest.mark.parametrize("at", [0.3, 0.8, 1.2, 2.0])
async def test_a_barge_in_ends_all_of_the_turn_at_whatever_moment(stage: Robot, at: float) -> None:
    stage.send(says("a", "beginning"))
    stage.send(says("b", "middle", "one two three four five six seven eight nine ten"))
    stage.send(says("c", "end"))
    await asyncio.sleep(at)
    stage.does("speak")
    await asyncio.sleep(5.0)

    assert stage.reached["b:end"] >= at + WORDLESS
    assert [(closed.status, closed.reason) for _, closed in stage.closed] == [("aborted", "human took the floor")]
    assert stage.outcomes["c"][1].status == "interrupted"
    assert stage.outcomes["c"][0] == round(at + WORDLESS, 6)
    assert "c:s:start" not in stage.reached


async def test_who_speaks_while_the_robot_pauses_takes_the_floor(stage: Robot) -> None:
    stage.send(says("a", "beginning"))
    await asyncio.sleep(1.5)
    stage.does("speak")
    await asyncio.sleep(3.0)

    assert [(round(at, 6), closed.reason) for at, closed in stage.closed] == [(3.0, "human took the floor")]


async def test_an_answer_that_goes_on_into_the_next_turn_is_no_barge_in(stage: Robot) -> None:
    stage.send(says("a", "full"))
    await asyncio.sleep(0.8)  # within the last word
    stage.does("speak")
    await asyncio.sleep(2.0)
    stage.send(says("b", "full", "four five six seven eight nine ten"))
    await stage.until("b:end")

    assert [outcome.status for _, outcome in stage.outcomes.values()] == ["done"]
    assert stage.reached["b:s:end"] - stage.reached["b:s:start"] > 2.0


async def test_a_fault_in_one_fragment_ends_all_of_the_turn_in_the_same_moment(stage: Robot) -> None:
    stage.send(shows("a", "beginning"))
    must = Speech(id="s", text="one two three four", required=True)
    stage.send(TurnFragment(id="b", turn_status="middle", behaviors=(must,)))
    stage.send(says("c", "end"))
    await stage.until("b:s:start")
    await asyncio.sleep(0.3)
    command(stage.bus, keys.BEHAVIOR, AbortBehavior(id="stop", block="b", behavior="s"))
    await asyncio.sleep(10.0)

    statuses = {id: outcome.status for id, (_, outcome) in stage.outcomes.items()}
    assert statuses == {"b": "failed", "a": "interrupted", "c": "interrupted"}
    assert len({at for at, _ in stage.outcomes.values()}) == 1
    assert [each.signal.signal for each in stage.signals] == ["aborted"]


async def test_required_words_that_are_broken_off_are_the_last_of_their_turn(stage: Robot) -> None:
    must = Speech(id="s", text="one two three four", required=True)
    stage.send(TurnFragment(id="a", turn_status="beginning", behaviors=(must,)))
    stage.send(shows("b", "middle"))
    stage.send(says("c", "end"))
    await asyncio.sleep(0.4)
    command(stage.bus, keys.BEHAVIOR, AbortBehavior(id="stop", block="a", behavior="s"))
    await asyncio.sleep(10.0)

    assert {id: outcome.status for id, (_, outcome) in stage.outcomes.items()} == {
        "a": "failed", "b": "interrupted", "c": "interrupted",
    }  # fmt: skip
    assert str(stage.outcomes["b"][1].fault) == "b: a, which it follows, failed: aborted on request"
    assert str(stage.outcomes["c"][1].fault) == "c: a failed"  # it had not been sent
    assert [(closed.status, closed.reason) for _, closed in stage.closed] == [("aborted", "a failed")]
    assert [id for id, _, _ in stage.words()] == ["a:s"]
    assert not [point for point in stage.reached if point.startswith(("b:", "c:")) and point.count(":") > 1]


async def test_words_that_fail_are_followed_by_the_next_ones(stage: Robot) -> None:
    stage.send(says("a", "beginning", "one two three four"))
    stage.send(says("b", "end"))
    await asyncio.sleep(0.6)
    command(stage.bus, keys.BEHAVIOR, AbortBehavior(id="stop", block="a", behavior="s"))
    await stage.until("b:end")

    assert stage.reached["b:s:start"] == stage.reached["a:end"] < 1.2
    assert stage.outcomes["a"][1].warnings == ("s was dropped: aborted on request",)


# -- thinking -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("target", "looks"), [("left", "left"), ("", "table")])
async def test_the_gaze_is_averted_from_the_last_word_until_the_next_fragment(
    stage: Robot, target: str, looks: str
) -> None:
    stage.send(says("a", "beginning", "Ummm", delay=True, delay_target=target))
    await asyncio.sleep(4.0)
    stage.send(says("b", "end"))
    await stage.until("b:end")

    thoughts = [(at, each.owner.target) for at, each in stage.owners if each.owner.reason == "thinks"]
    assert thoughts == [(stage.reached["a:s:end"], looks)]
    after = next((at, each.owner.target) for at, each in stage.owners if at > thoughts[0][0])
    assert after == (4.3, "human")  # a dwell after the next fragment came


async def test_thinking_does_not_keep_a_turn_open_for_longer(stage: Robot) -> None:
    stage.send(says("a", "beginning", "Ummm", delay=True))
    await asyncio.sleep(15.0)

    assert [(at, closed.reason) for at, closed in stage.closed] == [
        (round(stage.reached["a:end"] + 10.0, 6), "silence for 10 s")
    ]


async def test_nobody_thinks_while_the_next_words_are_there_already(stage: Robot) -> None:
    stage.send(says("a", "beginning", "Ummm", delay=True))
    stage.send(says("b", "end"))
    await stage.until("b:end")

    assert [each for _, each in stage.owners if each.owner.reason == "thinks"] == []
    assert gaps(stage) == [0.0]
