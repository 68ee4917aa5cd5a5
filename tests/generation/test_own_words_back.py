"""A whole robot whose words come back to it as a person's: a microphone hears its loudspeaker, 0.2 s late."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest
from msgspec.structs import replace

from engage_hri import perceive
from engage_hri.schemas import keys
from engage_hri.schemas.body import WordSpoken
from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import ActionBegan, ActionEnded, Utterance
from engage_hri.schemas.recognition import ConnectionEvent, Interjection
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.language_models import perform_call
from engage_hri.services.client.people.perceived_person import PerceivedPerson
from tests.generation.test_talked_into import ASKED, LONG, call, robot

LAG: Seconds = 0.2
HANGOVER: Seconds = 0.3
"""Time after the end of a voice until its detector says so."""
KNOWN: Seconds = 0.4
"""Time after that until its words are known for good."""


class Microphone:
    """A microphone beside the loudspeaker: all that it hears is a person's. It notes what recognition tells."""

    def __init__(self, person: PerceivedPerson) -> None:
        self._person = person
        self._said: Utterance | None = None
        self.count = 0
        self.pairs: list[str] = []
        self.readings: list[str] = []

    def take(self, message: Message) -> None:
        match message:
            case ConnectionEvent(kind="adjacency_pair", initiator="ann", id=id):
                self.pairs.append(id)
            case ConnectionEvent(kind="backchannel", id=id):
                self.pairs.append(id)
            case Interjection(reading=reading):
                self.readings.append(reading)
            case ActionBegan(action="speak") | ActionEnded(action="speak") | WordSpoken():
                asyncio.get_running_loop().call_later(LAG, self._hear, message)

    def _hear(self, message: Message) -> None:
        person, now = self._person, self._person.stamp()
        match message:
            case ActionBegan():
                person.begin("speak")
                self.count += 1
                self._said = Utterance(actor="ann", id=f"e{self.count}", text="", began=now, at=now, final=False)
            case WordSpoken(word=word) if self._said is not None:
                self._said = replace(self._said, text=f"{self._said.text} {word.strip(',.?')}".strip(), at=now)
                person.tell(self._said)
            case ActionEnded() if self._said is not None:
                said, self._said = replace(self._said, ended=now, final=True), None
                loop = asyncio.get_running_loop()
                loop.call_later(HANGOVER, person.end, "speak")
                loop.call_later(HANGOVER + KNOWN, lambda: person.tell(replace(said, at=person.stamp())))


@asynccontextmanager
async def echoing(hub: MemoryHub) -> AsyncIterator[tuple[PerceivedPerson, Microphone]]:
    """Ann, whose microphone hears the robot."""
    async with perceive("ann", hub=hub) as ann:
        bus, microphone = hub.join("ear"), Microphone(ann)
        bus.declare_alive()
        with bus.subscribe(
            keys.SYNC_POINT, keys.ROBOT_ACTION, keys.ANY_CONNECTION_EVENT, keys.ANY_INTERJECTION
        ) as inbox:

            async def listen() -> None:
                async for received in inbox:
                    microphone.take(received.message)

            listening = asyncio.create_task(listen())
            await ann.look_at(ann.robot)
            await asyncio.sleep(1.0)
            yield ann, microphone
            listening.cancel()


@pytest.mark.parametrize("text", [LONG, ASKED, "Stop, now listen.", f"{LONG} {ASKED}"])
async def test_the_robot_is_not_stopped_or_answered_by_its_own_words(hub: MemoryHub, text: str) -> None:
    async with robot(hub) as client, echoing(hub) as (_, microphone):
        told = await perform_call(client, call(text), await_answer=True)
        await asyncio.sleep(5.0)

    assert (told.status, told.said, told.answer, told.heard) == ("done", text, "none", ())
    assert microphone.count >= 1
    assert not microphone.pairs
    assert {*microphone.readings} <= {"open", "noise"}


@pytest.mark.parametrize("who", ["ann", "bob"])
async def test_a_stop_between_its_own_words_is_heeded(hub: MemoryHub, who: str) -> None:
    async with robot(hub) as client, echoing(hub) as (ann, microphone), perceive("bob", hub=hub) as bob:
        await bob.look_at(bob.robot)
        performing = asyncio.create_task(perform_call(client, call(LONG, addressee=who), await_answer=True))
        await asyncio.sleep(2.5)
        if who == "ann":  # her voice has been heard all the time: this is in the same speech
            ann.tell(Utterance(actor="ann", id="stop", text="stop", began=ann.stamp(0.6), at=ann.stamp()))
        else:
            await bob.say("stop", seconds=0.35)
        told = await performing

    assert told.status == "interrupted"
    assert "interruption" in microphone.readings


async def test_who_repeats_what_the_robot_has_asked_has_answered(hub: MemoryHub) -> None:
    async with robot(hub) as client, echoing(hub) as (ann, _):
        performing = asyncio.create_task(perform_call(client, call("The red one?"), await_answer=True))
        with hub.join("watch").subscribe(keys.ROBOT_ACTION) as inbox:
            async for received in inbox:
                if isinstance(received.message, ActionEnded) and received.message.action == "speak":
                    break
        await asyncio.sleep(1.2)
        await ann.say("the red one")
        told = await performing

    assert (told.status, told.answer) == ("done", "speak")
