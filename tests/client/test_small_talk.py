"""The manager of a few rules: whom it greets, what it answers, and what becomes of who says nothing or goes."""

import asyncio
import re
from collections.abc import AsyncIterator, Callable, Coroutine
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

from engage_hri import Robot, embedded, perceive
from engage_hri.schemas import keys
from engage_hri.schemas.perception import ActionBegan
from engage_hri.services.commandline.embedding import EmbeddedRobot
from engage_hri.services.commandline.look import small_talk_de as german
from engage_hri.services.commandline.look.small_talk import (
    EXAMPLES,
    OTHERWISE,
    PHRASES,
    PIECES,
    RULES,
    SEVERAL,
    SILENCE,
    STILL,
    SmallTalk,
    talk,
)
from engage_hri.services.commandline.look.talk import RULES as RULES_FILES
from engage_hri.services.tangram.table import tangram_table

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "talk.md").read_text(encoding="utf-8")


answer = SmallTalk().answer


def spoken(text: str) -> str:
    """The words of an answer, without what the head does meanwhile."""
    return re.sub(r"\[(nod|shake|look \w+)\] ?", "", text)


class Talk:
    """A talk that goes on. turns: what the robot has said, each turn as one line."""

    def __init__(self, robot: EmbeddedRobot) -> None:
        self.robot = robot
        self.turns: list[str] = []

    async def note(self) -> None:
        with self.robot.turns() as turns:
            async for turn in turns:
                self.turns.append(" ".join(each.text for each in turn.spoken))


@asynccontextmanager
async def talking(manager: Callable[[Robot], Coroutine[Any, Any, None]] = talk) -> AsyncIterator[Talk]:
    async with embedded(human="none") as robot:
        going = Talk(robot)
        tasks = [asyncio.create_task(going.note()), asyncio.create_task(manager(robot))]
        try:
            yield going
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.wait(tasks)


async def test_who_comes_is_greeted_answered_and_told_goodbye() -> None:
    async with talking() as going, perceive("ann", hub=going.robot.hub) as ann:
        await ann.look_at(ann.robot)
        await asyncio.sleep(6)
        for words in ("Good morning!", "I am fine.", "Where is the blue square?", "Goodbye."):
            await ann.say(words)
            await asyncio.sleep(6)
        await asyncio.sleep(60)

    greeting = spoken(SILENCE[0][1])
    assert going.turns == [
        greeting.removesuffix(" How are you?"), "How are you?", "Hello!", "How are you?", "I am glad to hear that.",
        "Look at the blue square", "Goodbye! It was nice to talk with you.",
    ]  # fmt: skip


async def test_who_speaks_first_is_answered_and_not_greeted() -> None:
    async with talking() as going, perceive("ann", hub=going.robot.hub) as ann:
        await ann.look_at(ann.robot)
        await ann.say("How old are you, and who made you, and when, and where was that?")
        await asyncio.sleep(5)

    assert going.turns == ["I began a few minutes ago."]


async def test_its_head_says_that_it_listens_looks_at_what_it_speaks_of_and_back_at_the_end() -> None:
    async with talking() as going, perceive("ann", hub=going.robot.hub) as ann:
        bus = going.robot.hub.join("watch")
        with bus.subscribe(keys.ROBOT_ACTION) as actions:
            await ann.look_at(ann.robot)
            await asyncio.sleep(6)
            asked = asyncio.get_running_loop().time()
            await ann.say("I have come from far away, and I would like to know: what is on the table?")
            answered = asyncio.get_running_loop().time()
            await asyncio.sleep(6)
            began = [
                (bus.local(told.message.at), told.message.action, *told.message.targets)
                for told in [await anext(actions) for _ in range(actions.waiting)]
                if isinstance(told.message, ActionBegan) and told.message.action != "speak"
            ]
        await bus.leave()

    looks = [each for each in began if each[1] == "look"]  # it may have looked away to the table already
    assert [each[2] for each in looks][-2:] == ["table", "ann"]
    assert looks[-1][0] > answered
    assert [at < answered for at, action, *_ in began if at > asked and action == "nod"] == [True]


async def test_who_says_nothing_is_offered_help_and_then_left_in_peace() -> None:
    async with talking() as going, perceive("ann", hub=going.robot.hub) as ann:
        await ann.look_at(ann.robot)
        await asyncio.sleep(200)

    assert [turn for turn in going.turns if turn in [line for _, line in SILENCE]] == [
        line for _, line in SILENCE[1:]
    ]


async def test_two_who_say_nothing_are_both_greeted_and_hear_all_else_once() -> None:
    async with talking() as going, perceive("ann", hub=going.robot.hub) as ann:
        await ann.look_at(ann.robot)
        await asyncio.sleep(4)
        async with perceive("ben", hub=going.robot.hub) as ben:
            await ben.look_at(ben.robot)
            await asyncio.sleep(200)

    greeting, *others = [spoken(line) for _, line in SILENCE]
    told = " ".join(going.turns)
    assert told.count(greeting.removesuffix(" How are you?")) == 2
    assert [told.count(line) for line in others] == [1] * len(others)


async def test_each_of_two_is_answered_and_who_has_gone_is_not() -> None:
    async with talking() as going, perceive("ann", hub=going.robot.hub) as ann:
        async with perceive("ben", hub=going.robot.hub) as ben:
            await asyncio.gather(ann.look_at(ann.robot), ben.look_at(ben.robot))
            await asyncio.sleep(12)
            await asyncio.gather(ann.say("Tell me a joke."), ben.say("I like you."))
            await asyncio.sleep(12)
        await asyncio.sleep(5)

    assert going.turns[-2:] == [spoken(answer("i like you")), spoken(answer("tell me a joke"))]


async def test_who_wants_help_hears_each_time_other_examples_and_may_ask_for_any_piece() -> None:
    async with talking() as going, perceive("ann", hub=going.robot.hub) as ann:
        await ann.look_at(ann.robot)
        await asyncio.sleep(6)
        for words in ("Yes.", "What can you do?", "Where's the pink triangle?", "The squares.", "No."):
            await ann.say(words)
            await asyncio.sleep(12)
        things = (await going.robot.world()).objects

    one, other, *rest = going.turns[2:]
    assert one.startswith("Then say, for example: ")
    told = [{each for each in EXAMPLES if each in line} for line in (one, other)]
    assert ([len(each) for each in told], told[0] & told[1]) == ([3, 3], set())
    assert rest[0] == "Look at the pink triangle"
    assert rest[-1] == "As you like."
    assert {answer(f"show me the {piece}", things) for piece in PIECES} == {
        f"Look at [{each.id}]." for each in things
    }
    assert answer("Where is the square?", things) == SEVERAL
    assert [answer(each, things) for each in EXAMPLES if answer(each, things) == OTHERWISE] == []


@pytest.mark.parametrize("phrase", [phrase for phrases in RULES for phrase in phrases])
def test_each_phrase_has_its_own_answer_also_among_other_words(phrase: str) -> None:
    [own] = [text for phrases, text in RULES.items() if phrase in phrases]
    assert answer(f"{phrase.capitalize()}!") == own


async def test_what_it_does_not_know_it_says_and_names_another_example_each_time() -> None:
    async with talking() as going, perceive("ann", hub=going.robot.hub) as ann:
        await ann.look_at(ann.robot)
        await asyncio.sleep(6)
        for words in ("Do you like the sea?", "Do you like the wind?"):
            await ann.say(words)
            await asyncio.sleep(12)

    before, after = spoken(OTHERWISE).split("{example}")
    named = [turn.removeprefix(before).removesuffix(after) for turn in going.turns[2:]]
    assert (len({*named}), {*named} - {*EXAMPLES}) == (2, set())


async def test_who_says_stop_into_its_words_is_answered_by_a_nod_and_the_rest_is_left() -> None:
    async with talking() as going, perceive("ann", hub=going.robot.hub) as ann:
        await ann.look_at(ann.robot)
        await asyncio.sleep(6)
        await ann.say("What can you do?")
        await asyncio.sleep(2.5)
        await ann.say("Stop!")
        await asyncio.sleep(6)

    assert going.turns[2].startswith("I listen, I look, and I point")
    assert "or: " not in going.turns[2]
    assert going.turns[3:] == [""]
    assert {answer(each) for each in STILL} == {"[nod]"}
    assert {*STILL} <= {*PHRASES}


async def test_in_german_it_greets_answers_shows_pieces_by_their_names_and_says_goodbye() -> None:
    async with talking(german.talk) as going, perceive("ann", hub=going.robot.hub) as ann:
        await ann.look_at(ann.robot)
        await asyncio.sleep(6)
        for words in (
            "Mir geht es gut.",
            "Wo ist das rosa Dreieck?",
            "Zeig mir die Dreiecke!",
            "Wie heisst du?",
            "Magst du das Meer?",
        ):
            await ann.say(words)
            await asyncio.sleep(9)
        await ann.say("Tschüss!")
        await asyncio.sleep(90)

    *told, unknown, last = going.turns
    assert told == [
        "Hallo! Schön, dass du da bist.", "Wie geht es dir?", "Das freut mich.", "Da ist das rosa Dreieck",
        "Davon gibt es mehrere. Sag Farbe und Form, so wie: wo ist das blaue Quadrat.",
        "Ich bin ein Roboter, und einen Namen habe ich noch nicht.",
    ]  # fmt: skip
    assert unknown.startswith("Das habe ich nicht verstanden. Sag zum Beispiel: ")
    assert last == "Auf Wiedersehen! Es war schön, mit dir zu reden."


def test_the_german_rules_know_what_they_name_and_as_much_as_the_english_ones() -> None:
    talks = SmallTalk(german.RULES, german.EXAMPLES, german.STILL, otherwise="?", shows="{thing}", names=german.NAMES)
    things = tangram_table().figure()

    assert {*german.NAMES} == {each.id for each in things}
    assert {talks.answer(f"Zeig mir {name}, bitte!", things) for name in german.NAMES.values()} >= {
        each.id for each in things if each.id not in ("blue-square", "red-square")
    }
    assert [each for each in german.EXAMPLES if talks.answer(each, things) == "?"] == []
    assert {talks.answer(each) for each in german.STILL} == {"[nod]"}
    assert len(german.RULES) == len(RULES)
    for phrases, text in german.RULES.items():
        assert [each for each in phrases if talks.answer(each.upper()) != text] == []


def test_a_rule_is_written_as_people_write_and_its_answer_as_well() -> None:
    own = SmallTalk(
        {("What's up? :)",): "Say {example}, or {examples}.", ("!",): "Hm.", ("C++",): "I am C."}, ("a", "b")
    )
    assert own.answer("what’s up") == own.answer("Well, what's up?") == "Say {example}, or {examples}."
    assert (own.answer("C++"), own.answer("Hm!")) == ("I am C.", OTHERWISE)


def test_it_understands_what_most_answer_to_its_greeting() -> None:
    assert {answer(words) for words in ("Fine, thanks! And you?", "I am good.", "Fine, thank you.")} == {
        answer("I am fine.")
    }


async def test_the_manager_that_the_page_shows_asks_and_hears(capsys: pytest.CaptureFixture[str]) -> None:
    [code] = re.findall(r"^```python\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
    names: dict[str, Any] = {}
    exec(code, names)
    async with embedded(human="none") as robot, perceive("ann", hub=robot.hub) as ann:
        await ann.look_at(ann.robot)
        talking = asyncio.create_task(names["talk"](robot))
        await asyncio.sleep(4)
        await ann.say(names["PHRASES"][0])
        await talking

    assert capsys.readouterr().out == "ann has said: tell me more\n"


def test_the_table_that_the_page_shows_is_that_of_the_file() -> None:
    [table] = re.findall(r"^```text\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
    lines = RULES_FILES["en"].read_text(encoding="utf-8").splitlines()
    assert [line for line in table.splitlines() if line not in lines] == []
