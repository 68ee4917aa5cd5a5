"""What a conversation promises in figures: how soon the first word comes, and that its history is what was heard."""

import asyncio
import random
from collections.abc import Sequence

import pytest

from engage_hri import embedded, perceive
from engage_hri.schemas import keys
from engage_hri.schemas.body import WordSpoken
from engage_hri.schemas.perception import ActionBegan, Utterance
from engage_hri.services.bus.interface import Bus
from engage_hri.services.client.conversation.history import Entry, PersonSaid
from engage_hri.services.client.conversation.talk import Conversation
from tests.client.conversation.servers import STREAMS, Script, Written
from tests.random_cases import share_of

TOKEN = 1 / 25
"""Seconds that a token takes of a model that writes 25 a second."""
SENTENCES = "Hello there, nice to meet you. I could use your help with a puzzle today. Do you have a moment for me?"


async def first_word(script: Script, form: str) -> float:
    """Seconds from the first token of the first words until the robot begins to speak."""
    async with embedded(human="none") as robot, perceive("ann", hub=robot.hub) as ann:
        await ann.look_at(robot.id)
        await asyncio.sleep(2.0)
        model = Written([script], form, TOKEN)
        async with Conversation(robot, model) as talk:
            with robot.actions() as actions:
                await ann.say("Good morning, robot.", delay=0.1)
                async for action in actions:
                    if isinstance(action, ActionBegan) and (action.actor, action.action) == (robot.id, "speak"):
                        break
            began = robot.local(action.at)
            await asyncio.sleep(12.0)
        assert talk.history[-1].said == SENTENCES  # type: ignore[union-attr]
        # Of a call the first token of its words is in the one behind `"say": "`.
        data = [b"".join(model.sent[: n + 1]) for n in range(len(model.sent))]
        word = next(n for n, it in enumerate(data) if b"He" in it or b'"say' in it.replace(b"\\", b""))
        return began - model.first_at - TOKEN * word


@pytest.mark.parametrize("form", ["openai", "anthropic"])
async def test_the_first_word_of_a_call_comes_as_soon_as_that_of_plain_text(form: str) -> None:
    parts = [{"say": sentence} for sentence in ("Hello there, nice to meet you.", SENTENCES[31:])]
    call = ("perform_turn_fragment", {"turn_status": "full", "parts": parts})
    text, said = await first_word((SENTENCES,), form), await first_word((call,), form)
    print(f"\n{form}: text {text:.2f} s, call {said:.2f} s")

    assert said <= 0.6
    assert abs(said - text) <= 0.2


class Listener:
    """Somebody who writes down what is said on the bus, and knows nothing of a conversation."""

    def __init__(self, bus: Bus) -> None:
        self._bus = bus
        self._inbox = bus.subscribe(keys.SYNC_POINT, keys.UTTERANCE)
        self._bodies: set[str] = set()

    def words(self) -> dict[str, list[tuple[float, str]]]:
        """The words of each, in order, with when they were over; a person's with when the utterance began."""
        said: dict[str, list[tuple[float, str]]] = {"robot": []}
        while (received := self._inbox.take()) is not None:
            match received.message:
                case WordSpoken(word=word, at=at):
                    said["robot"].append((self._bus.local(at), word))
                case Utterance(actor=actor, text=text, final=True, began=began):
                    said.setdefault(actor, []).extend((self._bus.local(began), word) for word in text.split())
        return {who: sorted(told, key=lambda each: each[0]) for who, told in said.items()}


def differences(history: Sequence[Entry], said: dict[str, list[tuple[float, str]]]) -> list[str]:
    """What a history has otherwise than a listener: words of anybody, or the order in which entries began."""
    found, begins = [], []
    left = {who: list(told) for who, told in said.items()}
    for entry in history:
        who, text = (entry.who, entry.text) if isinstance(entry, PersonSaid) else ("robot", entry.said)
        count = len(text.split())
        heard, left[who] = left[who][:count], left[who][count:]
        if [word for _, word in heard] != text.split():
            found.append(f"{who}: {text!r}, heard {' '.join(word for _, word in heard)!r}")
        begins += [at for at, _ in heard[:1]]
    found += [f"{who}: not in the history: {told}" for who, told in left.items() if told]
    return found if begins == sorted(begins) else [*found, f"order: {begins}"]


SAYS = (
    "Hello robot, how are you?", "Stop!", "Uh-huh.", "Tell me more about the pieces, please.", "I would like the",
    "Yes.", "Wait, that is not what I mean at all.", "What is it?", "And then",
)  # fmt: skip


def answers(chance: random.Random) -> list[Script]:
    def text() -> str:
        sentences = ("This is one sentence.", "Now look at [red-square], please.", "Do you see it?",
                     "It is 12 o'clock.", "One, two, three, four, five, and then some more of it.")  # fmt: skip
        return " ".join(chance.choice(sentences) for _ in range(chance.randint(1, 4)))

    made: list[Script] = []
    for _ in range(12):
        script: list[object] = [text()]
        if chance.random() < 0.4:
            parts = [{"say": text()}, {"refer": chance.choice(("red-square", "blue-square"))}, {"say": "here."}]
            script.append(("perform_turn_fragment", {"turn_status": "full", "parts": parts}))
        if chance.random() < 0.2:
            script.append(("take_time", {"seconds": chance.choice((0.1, 3.0))}))
        made.append(script)  # type: ignore[arg-type]
    return made


async def take_time(seconds: float) -> str:
    """Take so much time."""
    await asyncio.sleep(seconds)
    return "done"


async def converse(seed: int) -> tuple[list[str], int]:
    """A random conversation with interruptions: what its history has otherwise than a listener, and how often cut."""
    chance = random.Random(seed)
    async with embedded(human="none") as robot, perceive("ann", hub=robot.hub) as ann:
        await ann.look_at(robot.id)
        bus = robot.hub.join("listener")
        listener = Listener(bus)
        model = Written(answers(chance), chance.choice([*STREAMS]), chance.choice((0.01, 0.04)), chance)
        async with Conversation(robot, model, tools=[take_time]) as talk:
            for _ in range(chance.randint(3, 6)):
                await ann.say(chance.choice(SAYS), delay=chance.choice((0.05, 0.3, 0.8)))
                await asyncio.sleep(chance.choice((0.2, 1.0, 2.0, 4.0, 9.0)))
                if chance.random() < 0.2:
                    await ann.type(chance.choice(SAYS))
            await asyncio.sleep(30.0)
        found = differences(talk.history, listener.words())
        await bus.leave()
    cut = sum(not isinstance(each, PersonSaid) and each.is_cut for each in talk.history)
    return found, cut


@pytest.mark.parametrize("share", range(2))
async def test_the_history_of_random_conversations_is_what_a_listener_has_written_down(share: int) -> None:
    cuts = 0
    for seed in range(share, share_of(200, one_of=50), 2):
        found, cut = await converse(seed)
        cuts += cut
        assert found == [], seed
    assert cuts > 0
