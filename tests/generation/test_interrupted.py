"""People speak into the robot's turn at any instant: each outcome says who and what, and each word is said once."""

import asyncio
import random

import pytest

from engage_hri import perceive
from engage_hri.schemas import keys
from engage_hri.schemas.body import WordSpoken
from engage_hri.schemas.fragments import FragmentOutcome
from engage_hri.schemas.perception import Utterance
from engage_hri.schemas.summary import summary
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.generation.turns.interjections import WORDLESS
from tests.generation.test_talked_into import call, robot
from tests.random_cases import share_of
from tests.recognition.phrases import PHRASES

TEXT = "Number one two three four five six seven eight nine ten eleven twelve thirteen fourteen fifteen and sixteen."
WORD = 0.4
"""Longest time that the robot goes on after words that stop it: the word that it is saying."""
RECOGNIZING = 0.2
ROUND = 1e-6


async def interrupted(
    hub: MemoryHub, *, words: str, after: float, seconds: float, known: bool, limit: float
) -> tuple[FragmentOutcome, list[str], float]:
    """What became of a turn, the words that were said aloud, and how long it went on after the words were known.

    words: "": none come. known: a recognizer has told words of this person before.
    """
    said: list[str] = []
    last = 0.0
    async with (
        robot(hub, f"recognition.backchannel_limit={limit}") as client,
        perceive("ann", hub=hub) as ann,
    ):
        bus = hub.join("ear")
        bus.declare_alive()
        await ann.look_at(ann.robot)
        if known:
            await ann.say("good morning")
        await asyncio.sleep(6.0)

        async def listen() -> None:
            nonlocal last
            with bus.subscribe(keys.SYNC_POINT) as inbox:
                async for received in inbox:
                    if isinstance(received.message, WordSpoken):
                        said.append(received.message.word)
                        last = client.now()

        listening = asyncio.create_task(listen())
        performing = asyncio.create_task(client.perform(call(TEXT), await_answer=True))
        await asyncio.sleep(after)
        began = bus.stamp()
        ann.begin("speak")
        await asyncio.sleep(seconds)
        ann.end("speak")
        ended = bus.stamp()
        await asyncio.sleep(RECOGNIZING)
        decided = client.now()
        if words:
            uttered = Utterance(actor="ann", id="u", text=words, began=began, ended=ended, at=bus.stamp())
            bus.publish(keys.UTTERANCE, uttered)
        told = await performing
        listening.cancel()
    return told, said, last - decided


@pytest.mark.parametrize("seed", range(share_of(200, 25)))
async def test_each_outcome_says_who_and_what_and_each_word_is_said_once(hub: MemoryHub, seed: int) -> None:
    chance = random.Random(seed)
    phrase, known = chance.choice(PHRASES), chance.random() < 0.6
    after, seconds, limit = chance.uniform(0.6, 3.0), chance.uniform(0.2, 1.3), chance.uniform(0.3, 1.5)
    if seed % 2:  # what decides comes in the same instant: the end of the speech, its words, the limit
        after, seconds = round(after, 1), round(seconds, 1)
        limit = max(0.3, chance.choice((seconds, seconds + RECOGNIZING)))
    told, said, went_on_for = await interrupted(
        hub, words=phrase.words, after=after, seconds=seconds, known=known, limit=limit
    )

    all_words = TEXT.replace(".", "").split()
    spoken = [each.strip(".") for each in said]
    assert spoken == all_words[: len(spoken)], "each word once, and in order"
    assert " ".join(each.text for each in told.spoken).replace(".", "").split() == spoken
    [into] = told.interjections
    assert into.actor == "ann"
    is_noise = phrase.kind == "noise"
    readings = {"interruption"} if phrase.stops else {"noise"} if is_noise else {"backchannel"}
    if phrase.kind == "laughter":  # a recognizer may write it in words, or in brackets
        readings |= {"noise"}
    if not known and is_noise:
        readings |= {"backchannel"}
    if not known and seconds >= limit - ROUND:  # its length decides, before its words are known
        readings |= {"interruption"}
    assert into.reading in readings
    if known or not into.went_on:
        assert into.words in (phrase.words, "")
    if known and not is_noise:
        assert into.words == phrase.words
    if into.reading == "interruption" and not known and seconds + RECOGNIZING >= WORDLESS - ROUND:
        pass  # its words come in the instant in which the robot goes on without
    else:
        # A voice without words is too short to take the floor, whatever its length says of the event.
        assert into.went_on == (into.reading != "interruption" or not phrase.stops)
    assert told.status == ("done" if into.went_on else "interrupted")
    assert (spoken == all_words) == into.went_on
    if known and phrase.stops:
        assert went_on_for <= WORD + ROUND
    [brief] = summary(told).interjections
    assert (brief.who, brief.reading, brief.went_on) == ("ann", into.reading, into.went_on)
