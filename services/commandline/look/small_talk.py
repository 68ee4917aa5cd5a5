"""A small manager made of rules: it greets who comes, answers what it knows, helps who is idle, says goodbye.

`engage talk` runs it. `engage talk --manager mine.py` writes a copy for you to change, if there is no mine.py, and
runs that one. It also runs by itself, beside a robot that runs already: `python mine.py`.
"""

import asyncio
import re
from collections.abc import Iterable, Mapping
from itertools import cycle, islice
from typing import Any, Literal

from engage_hri import EngageError, Entity, Robot, connect

RULES = {
    # what somebody says, in any of these forms, and what the robot answers. In brackets: a thing that it shows, a
    # thing that it looks at, or what its head does meanwhile
    ("hello robot", "hello", "good morning"): "[nod] Hello! How are you?",
    (
        "i am fine",
        "i am good",
        "fine thank you",
        "fine thanks",
        "very well thank you",
    ): "[nod] I am glad to hear that.",
    ("i am tired", "not so good"): "I am sorry. Stay with me for a while.",
    ("how are you", "are you well"): "I am well, thank you.",
    ("what is your name", "who are you"): "I am a robot, and I have no name yet.",
    ("how old are you",): "I began a few minutes ago.",
    (
        "what can you do",
        "what can i say",
        "please help me",
    ): "I listen, I look, and I point. You can say: {examples}.",
    ("yes", "yes please"): "[nod] Then say, for example: {examples}.",
    ("no", "no thank you"): "[nod] As you like.",
    ("can you hear me", "do you hear me"): "[nod] I hear you well.",
    (
        "what is on the table",
        "what are these",
    ): "[look table] These are the pieces of a puzzle. Which one do you like?",
    ("the blue one", "where is the blue square"): "Look at [blue-square].",
    ("the red one", "show me the red square"): "Look at [red-square].",
    ("tell me a joke", "make me laugh"): "What does a robot do at lunch? It has a megabyte.",
    ("i like you",): "[nod] That is kind of you. I like to look at you, too.",
    ("thank you", "thank you very much"): "[nod] You are welcome.",
    ("goodbye", "i have to go now"): "Goodbye! [nod] It was nice to talk with you.",
}
EXAMPLES = (
    "where is the pink triangle", "can you hear me", "how old are you", "show me the red square",
    "what is on the table", "where is the white piece", "what is your name",
)  # fmt: skip
"""What somebody may say. The robot names one of them as {example}, three as {examples}, and others next time."""
PIECES = (
    "orange rectangle", "white piece", "blue square", "green square", "purple square", "red square",
    "pink square", "yellow triangle", "pink triangle", "purple triangle",
)  # fmt: skip
"""What lies on the table of the simulated robot: it shows what is asked for, by colour and shape.

The white one is a trapezoid: the dictionary of `sphinx` has no such word."""
SEVERAL = "There are several of these. Say colour and shape, as in: where is the blue square."
STILL = ("stop", "please stop", "stop please", "wait", "please wait", "be quiet", "please be quiet")
"""What somebody says for the robot to be still. A nod answers it, as it does laughter."""
OTHERWISE = "[shake] I did not understand that. Say, for example: {example}."
SILENCE = (
    # seconds in which somebody has said nothing, and what the robot says then; the first one greets
    (1.0, "[nod] Hello! I am glad that you are here. How are you?"),
    (15.0, "You can say: what can you do, or: where is the blue square."),
    (25.0, "Do you need help?"),
    (40.0, "I see that you are busy. Goodbye!"),
)
WORDS = 10.0
"""Seconds for which the robot waits for words of somebody whose voice it hears."""
PHRASES = (
    *STILL,
    *(phrase for phrases in RULES for phrase in phrases),
    *(f"where is the {piece}" for piece in PIECES if piece != "blue square"),
)
"""What somebody may say: `engage talk` tells it to a recognizer that knows phrases alone."""


class SmallTalk:
    """The talk by such tables.

    shows: what the robot says of {thing}. names: words for each thing, by id, with an article; the robot finds its
    own, in English, for those without. parting: says goodbye. last: words before the last of several.
    """

    def __init__(
        self,
        rules: Mapping[tuple[str, ...], str] = RULES,
        examples: tuple[str, ...] = EXAMPLES,
        still: tuple[str, ...] = STILL,
        otherwise: str = OTHERWISE,
        several: str = SEVERAL,
        silence: tuple[tuple[float, str], ...] = SILENCE,
        shows: str = "Look at [{thing}].",
        names: Mapping[str, str] | None = None,
        parting: str = "Goodbye!",
        last: str = "or: ",
    ) -> None:
        self._texts = {
            plain: text for phrases, text in rules.items() for phrase in phrases if (plain := plain_words(phrase))
        }
        self._next = cycle(examples)
        self._wordless = "|".join(("(ha ?h?)+", *map(plain_words, still)))
        self._otherwise, self._several, self._silence = otherwise, several, silence
        self._shows, self._names, self._parting, self._last = shows, names or {}, parting, last

    async def talk(self, robot: Robot) -> None:
        """Talk with all who are there, until cancelled."""
        here: dict[str, asyncio.Task[None]] = {}
        silences: dict[str, list[tuple[float, str]]] = {}
        floor = asyncio.Lock()
        async with asyncio.TaskGroup() as group:
            with robot.worlds() as worlds:
                async for world in worlds:
                    for person in {each.id for each in world.people} ^ here.keys():
                        if person in here:
                            here.pop(person).cancel()
                            silences.pop(person, None)
                        else:
                            here[person] = group.create_task(self._talk_with(robot, person, floor, silences))

    async def _talk_with(
        self, robot: Robot, person: str, floor: asyncio.Lock, silences: dict[str, list[tuple[float, str]]]
    ) -> None:
        """Greet a person, if they do not speak first, and answer them.

        floor: of the robot, which says one thing at a time. silences: what is left of `SILENCE` for each who is here:
        all hear what the robot says to one of them.
        """
        greeting, *later = self._silence
        silences[person], heard_id, speaks = [greeting, *later], "", False
        with robot.utterances() as utterances:
            while True:
                next_one = silences[person][0] if silences[person] else (None, "")
                said = await utterances.next(WORDS if speaks else next_one[0])
                if said is None and not speaks and next_one in silences[person]:
                    for each in [person] if next_one == greeting else silences:
                        silences[each] = [one for one in silences[each] if one != next_one]
                    async with floor:
                        await self._say(robot, person, next_one[1], 3)
                speaks = said is not None and said.actor == person and not said.final
                if said is not None and said.actor == person and said.final and said.id != heard_id:
                    heard_id, text = said.id, self.answer(said.text, (await robot.world()).objects)
                    silences[person] = [] if self._parting in text else later
                    async with floor:
                        await self._say(robot, person, text, 2)

    def answer(self, words: str, things: Iterable[Entity] = ()) -> str:
        """Find what the robot says to words: by the longest phrase in them, or else by a thing that they name.

        words: as they were understood, or typed. things: on the table.
        """
        plain = plain_words(words)
        if re.fullmatch(self._wordless, plain):
            return "[nod]"
        found = max((each for each in self._texts if re.search(rf"\b{each}\b", plain)), key=len, default="")
        if " " not in found and (text := self._shown({*plain.split()}, things)):
            return text
        return self._texts.get(found, self._otherwise)

    def _shown(self, words: set[str], things: Iterable[Entity]) -> str:
        """Find what the robot says to words for colour and shape. Empty: no thing has these."""
        fits = {
            thing.id: sum(any(is_form_of(word, own) for word in words) for own in self._words(thing))
            for thing in things
        }
        best = [id for id, fit in fits.items() if fit == max(fits.values()) > 0]
        return (self._several if len(best) > 1 else self._shows.format(thing=best[0])) if best else ""

    def _words(self, thing: Entity) -> list[str]:
        """Words for colour and shape of a thing."""
        return self._names[thing.id].casefold().split()[1:] if thing.id in self._names else [thing.color, thing.shape]

    async def _say(self, robot: Robot, person: str, text: str, turn_index: Literal[2, 3]) -> None:
        """Say a text to a person. What it asks at its end opens an exchange.

        turn_index: 2: it answers; 3: it comes by itself.
        """
        if "{examples}" in text:
            *some, last = islice(self._next, 3)
            text = text.replace("{examples}", f"{', '.join(some)}, {self._last}{last}")
        if "{example}" in text:
            text = text.replace("{example}", next(self._next))
        match = re.fullmatch(r"(.*?[.!]?)\s*([^.!?]*\?)?", text)
        told, asked = match.groups() if match else (text, None)
        for words, index in ((told, turn_index), (asked, 1)):
            if words:
                await perform(robot, person, "full", self._parts_of(words), turn_index=index)

    def _parts_of(self, text: str) -> list[dict[str, Any]]:
        """Make the parts of a turn: words, and what stands in brackets."""
        parts = [
            self._part_of(each) if number % 2 else {"say": each}
            for number, each in enumerate(re.split(r"\[(.*?)\]", text))
        ]
        return [each for each in parts if each.get("say", "words").strip(" .")]

    def _part_of(self, bracket: str) -> dict[str, Any]:
        """Make the part that a bracket means: `nod`, `shake`, `look` and a thing, or a thing to be shown."""
        if bracket in ("nod", "shake"):
            return {"gesture": bracket}
        word, _, thing = bracket.partition(" ")
        if word == "look":
            return {"look": thing}
        return {"refer": bracket, **({"phrases": (self._names[bracket],)} if bracket in self._names else {})}


def plain_words(text: str) -> str:
    """The words of a text alone, of what is said as of what a rule awaits: phones write `wie geht’s?`."""
    return " ".join(re.findall(r"[\w']+", text.casefold().replace("’", "'")))


def is_form_of(word: str, own: str) -> bool:
    """True if a word is this one, with any ending, as `squares` and `blaues` have them. Both without capitals."""
    return bool(own) and re.fullmatch(rf"{re.escape(own.removesuffix('e'))}e?[mnrs]?", word) is not None


async def perform(robot: Robot, person: str, status: str, parts: list[dict[str, Any]], **more: int) -> None:
    """Perform a turn for a person. One that cannot be performed is told, and the talk goes on."""
    try:
        await robot.perform({"turn_status": status, "parts": parts, **more}, addressee=person)
    except EngageError as error:  # they have gone, or somebody stops the robot
        print(error)


async def talk(robot: Robot) -> None:
    """Talk with all who are there, until cancelled."""
    await SmallTalk().talk(robot)


async def main() -> None:
    async with connect() as robot:
        await talk(robot)


if __name__ == "__main__":
    asyncio.run(main())
