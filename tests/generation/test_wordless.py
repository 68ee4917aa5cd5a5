"""A voice without words takes the floor if it lasts; a laugh does not. Of a robot with a voice detector alone."""

import asyncio

import pytest

from engage_hri import perceive
from engage_hri.schemas.perception import Utterance
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.language_models import perform_call
from tests.generation.test_talked_into import LONG, call, robot


@pytest.mark.parametrize(
    ("lasts", "floor"), [(0.4, False), (0.9, False), (1.2, False), (1.45, False), (1.6, True), (3.0, True)]
)
async def test_a_voice_takes_the_floor_after_a_second_and_a_half(hub: MemoryHub, lasts: float, floor: bool) -> None:
    async with robot(hub) as client, perceive("ann", hub=hub) as ann:
        await ann.look_at(ann.robot)
        speaking = asyncio.create_task(perform_call(client, call(LONG), await_answer=True))
        await asyncio.sleep(2.0)
        ann.begin("speak")
        await asyncio.sleep(lasts)
        ann.end("speak")
        told = await speaking

    assert (told.status == "interrupted") == floor
    [into] = told.interjections
    assert into.went_on != floor
    assert (told.said == LONG) != floor, "each word once"


@pytest.mark.parametrize(("words", "stops"), [("no, not that one", True), ("ach echt", False)])
async def test_the_first_words_that_anybody_tells_decide_at_once(hub: MemoryHub, words: str, stops: bool) -> None:
    async with robot(hub) as client, perceive("ann", hub=hub) as ann:
        await ann.look_at(ann.robot)
        speaking = asyncio.create_task(perform_call(client, call(LONG), await_answer=True))
        await asyncio.sleep(2.0)
        ann.begin("speak")
        await asyncio.sleep(1.0)
        ann.end("speak")
        ann.tell(Utterance(actor="ann", id="u", text=words, began=ann.stamp(1.0), at=ann.stamp()))
        told = await speaking

    assert (told.status == "interrupted") == stops


async def test_a_laugh_of_whom_no_words_have_come_is_noise_where_a_recognizer_listens(hub: MemoryHub) -> None:
    async with robot(hub) as client, perceive("ann", hub=hub) as ann, perceive("bob", hub=hub) as bob:
        await bob.say("good morning", to=("ann",))
        await ann.look_at(ann.robot)
        speaking = asyncio.create_task(perform_call(client, call(LONG, addressee="ann"), await_answer=True))
        await asyncio.sleep(2.0)
        ann.begin("speak")
        await asyncio.sleep(1.2)
        ann.end("speak")
        told = await speaking

    assert told.status == "done"
    assert [(each.who, each.reading, each.went_on) for each in told.interjections] == [("ann", "noise", True)]
    assert told.answer == "none"
