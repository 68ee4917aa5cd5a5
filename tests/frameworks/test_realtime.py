"""A robot in the place of the loudspeaker of a realtime speech API, played by a stand-in."""

import asyncio
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from typing import Any, NamedTuple

import aiohttp
import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.perception import ActionBegan
from engage_hri.schemas.summary import Summary
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.robot import Robot
from engage_hri.services.frameworks.realtime import RealtimeSpeech
from tests.cancelling import whole_robot
from tests.frameworks.stand_in import MS_OF_A_LETTER, StandIn, over_a_socket

BLUE = ("Hello th", "ere. Please ta", "ke [blue-", "square] and put it", " down.")
WHOLE = "Hello there. Please take the blue square and put it down."
LONG = ("one two three four five six seven eight nine ten. And ", "so on.")


class Scene(NamedTuple):
    robot: Robot
    hub: MemoryHub
    api: StandIn
    speech: RealtimeSpeech
    told: list[Summary]
    has_told: asyncio.Event

    async def ask(self) -> None:
        await self.api.send({"type": "response.create"})

    async def over(self, number: int = 1) -> None:
        """Wait until so many turns are over, and what is told of them has been sent."""
        while len(self.told) < number:
            await self.has_told.wait()
            self.has_told.clear()
        await asyncio.sleep(0.5)


@asynccontextmanager
async def scene(*replies: Sequence[str], is_audio: bool = False, pause: float = 0.05) -> AsyncIterator[Scene]:
    async with MemoryHub() as hub, whole_robot(hub) as robot:
        api, told, has_told = StandIn(replies, is_audio=is_audio, pause=pause), list[Summary](), asyncio.Event()

        def tell(summary: Summary) -> None:
            told.append(summary)
            has_told.set()

        speech = RealtimeSpeech(robot, api.send, on_turn_over=tell)

        async def read() -> None:
            async for event in api.events():
                await speech.take(event)

        reading = asyncio.create_task(read(), name="client of the stand-in")
        try:
            yield Scene(robot, hub, api, speech, told, has_told)
        finally:
            await speech.aclose()
            await api.close()
            await reading


@pytest.mark.parametrize("is_audio", [False, True])
async def test_responses_are_said_in_order_and_the_conversation_stays_as_it_is(is_audio: bool) -> None:
    async with scene(BLUE, ("Thank you.",), is_audio=is_audio) as here:
        await here.ask()
        await asyncio.sleep(0.5)
        await here.ask()  # written while the first is said
        await here.over(2)
        before = [*here.api.items]

    assert [each.said for each in here.told] == [
        "Hello there. Please take the blue square and put it down.",
        "Thank you.",
    ]
    assert [(each.object, each.by) for each in here.told[0].references] == [("blue-square", "a look")]
    assert [each["type"] for each in here.api.got] == ["response.create"] * 2
    assert here.api.items == before


async def test_it_points_where_the_text_is_certain() -> None:
    async with scene(("Please take [blue-", "square!].")) as here:
        await here.ask()
        await here.over()

    assert [(each.object, each.by) for each in here.told[0].references] == [("blue-square", "pointing")]


@pytest.mark.parametrize("pause", [0.05, 5.0])
async def test_text_that_was_cut_is_put_anew_with_the_words_that_were_said(pause: float) -> None:
    async with scene(LONG, ("Sorry.",), pause=pause) as here:
        await here.ask()
        await asyncio.sleep(2.0)
        here.api.speech_started()
        await here.over()
        await here.ask()
        await here.over(2)

    said = here.told[0].said
    assert said.startswith("one two three")
    assert "ten" not in said
    assert here.api.kept == [said, "Sorry."]
    assert not [each for each in here.api.told if each["type"] == "error"]


@pytest.mark.parametrize("pause", [0.05, 5.0])
async def test_audio_that_was_cut_is_truncated_where_the_robot_stopped(pause: float) -> None:
    async with scene(LONG, is_audio=True, pause=pause) as here:
        await here.ask()
        await asyncio.sleep(2.0)
        here.api.speech_started()
        await here.over()

    said = here.told[0].said
    assert here.told[0].cut_short
    assert here.api.kept == [pytest.approx(len(said) * MS_OF_A_LETTER, abs=2)]
    assert here.api.items[0]["content"][0]["transcript"] == ""
    assert not [each for each in here.api.told if each["type"] == "error"]


async def test_a_person_who_takes_the_floor_cancels_the_response_and_what_was_to_come() -> None:
    async with scene((*LONG, " And", " more."), pause=2.0) as here:
        await here.ask()
        await asyncio.sleep(2.5)
        person = here.hub.join("perception-too")
        person.publish(keys.PERCEIVED_ACTION, ActionBegan(actor="human", action="speak", at=person.stamp()))
        await here.over()
        await person.leave()

    assert [each["type"] for each in here.api.got[1:]] == [
        "response.cancel", "conversation.item.create", "conversation.item.delete"
    ]  # fmt: skip
    assert here.api.kept == [here.told[0].said]
    assert "took the floor" in here.told[0].problems[0]


async def test_what_waits_behind_a_turn_that_is_cut_is_never_said() -> None:
    async with scene(LONG, ("never said",)) as here:
        await here.ask()
        await asyncio.sleep(0.5)
        await here.ask()
        await asyncio.sleep(1.5)
        here.speech.stop()
        await here.over()

    assert [each.said for each in here.told] == here.api.kept
    assert len(here.told) == 1


async def test_events_are_those_of_the_api_by_its_own_types() -> None:
    try:
        from openai.types.realtime import RealtimeClientEvent, RealtimeServerEvent
        from pydantic import TypeAdapter
    except ModuleNotFoundError:
        pytest.skip("needs the extra `livekit`")
    async with scene(LONG, BLUE, is_audio=True) as heard, scene(LONG) as read:
        for here in (heard, read):
            await here.ask()
            await asyncio.sleep(2.0)
            here.api.speech_started()
            await here.over()
    client, server = TypeAdapter(RealtimeClientEvent), TypeAdapter(RealtimeServerEvent)

    for event in (*heard.api.got, *read.api.got):
        assert type(client.validate_python(event)).__name__ != "dict"
    known = [each for each in (*heard.api.told, *read.api.told) if "output_item" not in each["type"]]
    for event in known:
        assert server.validate_python(event).type == event["type"]


@pytest.mark.real_time
async def test_it_works_over_a_socket_as_in_the_docs() -> None:
    async with MemoryHub() as hub, whole_robot(hub) as robot:
        api, told = StandIn([BLUE]), list[Summary]()
        async with over_a_socket(api) as url, aiohttp.ClientSession() as session, session.ws_connect(url) as socket:
            speech = RealtimeSpeech(robot, socket.send_json, on_turn_over=told.append)
            await socket.send_json({"type": "response.create"})
            done: Any = None
            while not told:
                try:
                    message = await socket.receive(timeout=0.2)
                except TimeoutError:
                    continue
                done = message.json()
                await speech.take(done)
            await speech.aclose()

    assert done["type"] == "response.done"
    assert told[0].said == WHOLE
