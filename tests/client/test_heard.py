"""Turns of people as objects: who, to whom, the words as they come, and when each is over."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

from engage_hri import InputRefused, PerceivedPerson, embedded, perceive
from engage_hri.services.client.heard import ADDRESSEES_PATIENCE, HeardTurn
from engage_hri.services.client.turn_ends import (
    COMPLETE,
    LONGEST,
    OPEN,
    UNSURE,
    EndOfTurn,
    PersonPauses,
    SoFar,
    leaves_open,
)
from engage_hri.services.commandline.embedding import EmbeddedRobot


@asynccontextmanager
async def with_ann() -> AsyncIterator[tuple[EmbeddedRobot, PerceivedPerson]]:
    async with embedded(human="none") as robot, perceive("ann", hub=robot.hub) as ann:
        await ann.look_at(robot.id)
        await asyncio.sleep(1.0)
        yield robot, ann


def so_far(text: str, **more: object) -> SoFar:
    return SoFar(who="ann", text=text, spoken=2.0, **more)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("text", "language", "is_open"),
    [
        ("Where is the blue square?", "en", False),
        ("Where is the", "en", True),
        ("I would like, um", "en", True),
        ("I would like to see, ", "", True),
        ("the blue square", "en", None),
        ("", "en", None),
        ("Ich möchte den", "de-AT", True),
        ("Ich möchte den", "", True),
        ("He is called Max die", "en", None),
        ("We meet at 9 a.m.", "en", False),
        ("青い四角はどこですか。", "ja", False),
        ("well...", "en", True),
    ],
)
def test_words_tell_whether_more_must_follow(text: str, language: str, is_open: bool | None) -> None:
    assert leaves_open(text, language.partition("-")[0]) is is_open


def test_the_silence_follows_words_language_gaze_and_the_person() -> None:
    ends = EndOfTurn()
    assert ends.silence(so_far("Where is it?")) == COMPLETE
    assert ends.silence(so_far("the blue square")) == UNSURE
    assert ends.silence(so_far("it is the")) == OPEN
    assert ends.silence(so_far("Where is it?", looks_at_robot=True)) < COMPLETE
    assert ends.silence(so_far("Where is it?", looks_at_robot=False)) > COMPLETE
    assert ends.silence(so_far("blue", language="da")) > UNSURE > ends.silence(so_far("blue", language="ja"))
    assert ends.silence(so_far("blue", pauses=(0.2, 1.1, 1.2, 1.0))) == pytest.approx(1.3)
    assert ends.silence(so_far("Where is it?", pauses=(1.1, 1.2))) == COMPLETE
    assert [ends.silence(so_far("blue", finished=sure)) for sure in (0.1, 0.9)] == [OPEN, COMPLETE]
    assert ends.silence(so_far("Where is it?", finished=0.1)) == COMPLETE
    assert ends.silence(so_far("it is the", finished=0.9)) == OPEN
    assert ends.silence(so_far("it is the", looks_at_robot=False, pauses=(9.0,))) == LONGEST


def test_the_pauses_of_each_person_are_their_own_and_old_ones_are_forgotten() -> None:
    habits = PersonPauses()
    for pause in range(20):
        habits.note("ann", pause)

    assert (habits.of("ann"), habits.of("ben")) == ((12, 13, 14, 15, 16, 17, 18, 19), ())


async def test_a_turn_is_told_with_its_words_as_they_come_and_its_end() -> None:
    async with with_ann() as (robot, ann):
        with robot.heard() as heard:
            saying = asyncio.create_task(ann.say("Where is the blue square?", to=[robot.id], delay=0.2))
            turn = await heard.next(5.0)
            assert turn is not None
            began = robot.now()
            words = [text async for text in turn]
            over = robot.now()
            await saying

    assert (turn.who, turn.to, turn.text, turn.is_over) == ("ann", (robot.id,), "Where is the blue square?", True)
    assert words[-1] == turn.text
    assert len(words) > 2
    assert all(turn.text.startswith(text.rstrip(".")[:5]) for text in words)
    assert began - turn.began < 0.6
    assert over - turn.ended == pytest.approx(COMPLETE * 0.7, abs=0.02)


async def test_a_pause_in_a_sentence_does_not_end_it_and_is_remembered() -> None:
    async with with_ann() as (robot, ann):
        with robot.heard() as heard:

            async def speak() -> None:
                for _ in range(2):
                    await ann.say("I would like to have the", delay=0.0)
                    await asyncio.sleep(0.6)
                    await ann.say("blue square.", delay=0.1)
                    await asyncio.sleep(3.0)

            speaking = asyncio.create_task(speak())
            turns = [turn for _ in range(2) if (turn := await heard.next(20.0))]
            texts = [await turn.over() for turn in turns]
            await speaking
            pauses = heard._habits.of("ann")

    assert texts == ["I would like to have the blue square."] * 2
    assert pauses == pytest.approx((0.6, 0.6), abs=0.01)


async def test_several_speak_at_once_and_each_has_a_turn_that_others_may_read_later() -> None:
    async with with_ann() as (robot, ann), perceive("ben", hub=robot.hub) as ben:
        with robot.heard() as heard:
            await asyncio.gather(ann.say("Hello robot."), ben.say("I say something much longer than she does."))
            await asyncio.sleep(5.0)
            turns = [turn for _ in range(2) if (turn := await heard.next(0.0))]
            texts = {turn.who: await turn.over() for turn in turns}
            nothing = await heard.next(1.0)

    assert texts == {"ann": "Hello robot.", "ben": "I say something much longer than she does."}
    assert nothing is None


async def test_a_typed_line_is_over_at_once_and_who_leaves_has_ended() -> None:
    async with with_ann() as (robot, ann):
        with robot.heard() as heard:
            await ann.type("stop")
            typed = await heard.next(1.0)
            assert typed is not None
            at = robot.now()
            text = await typed.over()
            took = robot.now() - at
            assert await heard.next(5.0) is None  # that it was speech, as recognition tells, is no turn of its own
            ann.begin("speak")
            voice = await heard.next(1.0)
            assert voice is not None
            await ann.leave()
            assert await voice.over() == ""

    assert (text, took) == ("stop", pytest.approx(0.0, abs=0.01))
    assert typed.to == (robot.id,)


@pytest.mark.parametrize("delay", [0.3, 0.8, 1.5])
@pytest.mark.parametrize("at_robot", [False, True])
async def test_a_turn_says_to_whom_it_was_however_late_its_words_come(delay: float, at_robot: bool) -> None:
    async with with_ann() as (robot, ann), perceive("ben", hub=robot.hub) as ben:
        with robot.heard() as heard:
            await asyncio.sleep(1.0)
            await ann.look_at(ann.robot if at_robot else ben.id)
            saying = asyncio.create_task(ann.say("It was colder than last year.", delay=delay))
            turn = await heard.next(2.0)
            assert turn is not None
            await turn.over()
            await saying

    assert turn.to == (ann.robot if at_robot else ben.id,)


async def test_a_turn_of_which_nobody_knows_to_whom_it_is_is_over_soon_after_its_words() -> None:
    async with with_ann() as (robot, ann), perceive("ben", hub=robot.hub):
        with robot.heard() as heard:
            await ann.look_away()
            await asyncio.sleep(1.0)
            await ann.say("It was colder than last year.", delay=0.8)
            at = robot.now()
            turn = await heard.next(0.0)
            assert turn is not None
            await turn.over()
            took = robot.now() - at

    assert turn.to == ()
    assert took == pytest.approx(ADDRESSEES_PATIENCE, abs=0.01)


async def test_what_is_said_into_a_turn_of_the_robot_says_what_it_is() -> None:
    async with with_ann() as (robot, ann):
        with robot.heard() as heard:
            async with robot.turn("ann") as turn:
                turn.say("One two three four five six seven eight nine ten eleven twelve thirteen.")
                await asyncio.sleep(1.0)
                await ann.say("Uh-huh.")
                await turn.spoken()
            sign = await heard.next(0.0)
            assert sign is not None
            await sign.over()

    assert (sign.text, sign.reading, turn.status) == ("Uh-huh.", "backchannel", "done")


async def test_two_who_read_one_feed_both_learn_all_and_the_end_of_it() -> None:
    async with with_ann() as (robot, ann):
        heard = robot.heard()
        told: list[str] = []

        async def read(turn: HeardTurn) -> None:
            told.append(await turn.over())

        async def follow() -> None:
            async for turn in heard:
                reading.append(asyncio.create_task(read(turn)))

        reading: list[asyncio.Task[None]] = []
        following = asyncio.create_task(follow())
        await ann.say("One.")
        await asyncio.sleep(2.0)
        await ann.say("Two.")
        await asyncio.sleep(2.0)
        heard.close()
        await following
        await asyncio.wait(reading)

    assert told == ["One.", "Two."]


async def test_a_rule_of_ones_own_decides_and_one_that_nobody_offers_is_refused() -> None:
    class Patient(EndOfTurn):
        def silence(self, turn: SoFar) -> float:
            return 4.0

    async with with_ann() as (robot, ann):
        with robot.heard(ends=Patient()) as heard:
            await ann.say("Yes.")
            turn = await heard.next(1.0)
            assert turn is not None
            await turn.over()
            took = robot.now() - turn.ended
        with pytest.raises(InputRefused, match="no package offers 'smart'"):
            robot.heard(ends="smart")

    assert took == pytest.approx(4.0, abs=0.02)
