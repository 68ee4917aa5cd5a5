"""A turn of the robot as an object, on a whole robot, before people who listen, answer, interrupt and say nothing."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

from engage_hri import PerceivedPerson, embedded, perceive
from engage_hri.schemas.faults import InputRefused
from engage_hri.schemas.tool import Gesture
from engage_hri.services.client.turn import RobotTurn, TurnAnswer
from engage_hri.services.commandline.embedding import EmbeddedRobot

LONG = "One two three four five six seven eight nine ten eleven twelve thirteen fourteen fifteen sixteen."


@asynccontextmanager
async def with_ann() -> AsyncIterator[tuple[EmbeddedRobot, PerceivedPerson]]:
    async with embedded(human="none") as robot, perceive("ann", hub=robot.hub) as ann:
        await ann.look_at(robot.id)
        await asyncio.sleep(1.0)
        yield robot, ann


async def test_what_is_said_shown_and_asked_is_one_turn_and_its_answer_is_known() -> None:
    async with embedded() as robot:
        with robot.turns() as turns:
            async with robot.turn(id="t") as turn:
                said = await turn.say("Hello. I am looking for")
                seen = await turn.refer("red-square", certainty="high")
                answer = await turn.ask("Do you see it?", within=6)
            closed = await turns.next()

    assert (said, seen, turn.status, turn.unsaid) == ("Hello. I am looking for", True, "done", "")
    assert turn.said == "Hello. I am looking for that Do you see it?"
    assert answer is not None
    assert answer == turn.answer
    assert answer.by == "human"
    assert [(each.object, each.by, each.looked) for each in turn.references] == [("red-square", "pointing", True)]
    assert {"directed_gaze", "adjacency_pair"} <= {each.kind for each in turn.events}
    assert closed is not None
    assert (closed.status, closed.fragments) == ("done", ("t-1", "t-2", "t-3"))


@pytest.mark.parametrize(("takes", "expected"), [(4.5, "speak"), (7.0, None)])
async def test_a_question_behind_other_words_has_as_much_time_as_it_says(takes: float, expected: str | None) -> None:
    async with with_ann() as (robot, ann):

        async def answers() -> None:
            with robot.turns() as turns, robot.floor():
                await asyncio.sleep(takes)
                await ann.say("The blue one.")
                await turns.next(5.0)

        async with robot.turn("ann") as turn:
            await turn.say("I have a question.")
            asked = turn.ask("Which one?", within=5)
            answering = asyncio.create_task(answers())
            answer = await asked
        await answering

    assert (answer and answer.action, answer and answer.text) == (expected, expected and "The blue one.")
    assert turn.summary.answer == (expected or "none")


async def test_words_are_told_as_they_are_spoken() -> None:
    async with with_ann() as (robot, _):
        times: list[tuple[str, float]] = []

        async def follow(turn: RobotTurn) -> None:
            async for word in turn.words():
                times.append((word, robot.now()))

        async with robot.turn() as turn:
            following = asyncio.create_task(follow(turn))
            turn.say("One two", Gesture(gesture="nod"))
            await turn.say("three.")
            halfway = len(times)
            turn.say("Four.")
        await following

    assert [word for word, _ in times] == turn.said.split() == ["One", "two", "three.", "Four."]
    assert halfway == 3
    assert [at for _, at in times] == sorted({at for _, at in times})


async def test_who_takes_the_floor_ends_the_body_where_it_waits() -> None:
    async with with_ann() as (robot, ann):
        reached: list[str] = []

        async def interrupt() -> None:
            await asyncio.sleep(1.5)
            await ann.say("Stop, please. I want to say something.")

        interrupting = asyncio.create_task(interrupt())
        async with robot.turn("ann") as turn:
            await turn.say(LONG)
            reached.append("after it")
        await interrupting

    assert reached == []
    assert turn.status == "interrupted"
    assert 2 < len(turn.said.split()) < 12
    assert f"{turn.said} {turn.unsaid}" == LONG


@pytest.mark.parametrize("way", ["cancelled", "timeout", "error"])
@pytest.mark.parametrize("after", [0.0, 0.3, 1.234, 2.0])
async def test_a_body_that_is_left_stops_the_robot_at_a_word_and_said_is_true(way: str, after: float) -> None:
    turns: list[RobotTurn] = []

    async def speak(robot: EmbeddedRobot) -> None:
        async with robot.turn(id="t") as turn:
            turns.append(turn)
            turn.say(LONG)
            on = turn.say("And so on.")
            if way == "error":
                await asyncio.sleep(after)
                raise OSError("the model is gone")
            await on

    async with with_ann() as (robot, _):
        with robot.turns() as closed:
            speaking = asyncio.create_task(
                speak(robot) if way != "timeout" else asyncio.wait_for(speak(robot), after)
            )
            await asyncio.sleep(after)
            if way == "cancelled":
                speaking.cancel()
            kinds = {"cancelled": asyncio.CancelledError, "timeout": TimeoutError, "error": OSError}
            with pytest.raises(kinds[way]):
                await speaking
            left = robot.now()
            told = await closed.next(5.0)
        async with robot.turn() as other:
            await other.say("Hello again.")

    if turns:
        (turn,) = turns
        spoken = "" if told is None else " ".join(each.text for each in told.spoken)
        assert turn.said == spoken
        assert " ".join(f"{turn.said} {turn.unsaid}".split()) == f"{LONG} And so on."
        assert left < after + 1.0 + 1.7
    assert (other.status, other.said) == ("done", "Hello again.")


async def test_a_turn_that_is_held_waits_between_two_words_and_goes_on() -> None:
    async with with_ann() as (robot, _), robot.turn() as turn:
        saying = turn.say(LONG)
        await asyncio.sleep(1.0)
        await turn.hold()
        await asyncio.sleep(0.5)
        before = turn.said
        turn.say("The end.")
        await asyncio.sleep(2.0)
        after = turn.said
        await turn.resume()
        await saying

    assert before == after
    assert 0 < len(before.split()) < 8
    assert turn.said == f"{LONG} The end."


async def stop_later(turn: RobotTurn) -> None:
    await asyncio.sleep(1.0)
    await turn.stop()


async def test_a_turn_may_be_stopped_by_itself_and_from_outside() -> None:
    async with with_ann() as (robot, _):
        async with robot.turn() as turn:
            turn.say(LONG)
            await asyncio.sleep(1.0)
            await turn.stop()
            said = turn.said
        reached: list[str] = []
        async with robot.turn() as other:
            saying = other.say(LONG)
            stopping = asyncio.create_task(stop_later(other))
            await saying
            reached.append("after it")
        await stopping

    assert said == turn.said != ""
    assert f"{turn.said} {turn.unsaid}" == LONG
    assert (turn.status, other.status, reached) == ("interrupted", "interrupted", [])


async def test_a_turn_of_no_words_is_none_and_one_that_has_asked_says_no_more() -> None:
    async with with_ann() as (robot, ann):
        async with robot.turn() as nothing:
            pass
        with pytest.raises(InputRefused, match="not under way"):
            nothing.say("Hello.")
        async with robot.turn() as turn:
            asked = turn.ask("Yes?", within=2)
            with pytest.raises(InputRefused, match="the turn has ended"):
                turn.say("More.")
            with pytest.raises(InputRefused, match="neither text nor a `Part`"):
                turn.say(42)  # type: ignore[arg-type]
            await asyncio.sleep(1.5)
            await ann.nod()
            answer = await asked

    assert answer == TurnAnswer(action="nod", by="ann", delay=answer.delay if answer else 0.0)
    assert (nothing.said, nothing.outcomes, nothing.status) == ("", (), "done")
