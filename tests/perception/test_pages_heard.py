"""Hearing from the microphones of pages: whose voice it is, who comes and goes, and what is told of what is lost."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import partial
from typing import Any

import numpy as np
import pytest

pytest.importorskip("starlette", reason="needs the extra `console`")

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.perception import ActionBegan, ActorFound, ActorLost, SoundFrame, Utterance
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.people.perceive import perceive
from engage_hri.services.console.web.sounds import unheard
from engage_hri.services.perception.hearing.config import HearingConfig
from engage_hri.services.perception.hearing.intake import LOOK_AROUND
from engage_hri.services.perception.hearing.microphone import SILENT
from engage_hri.services.perception.hearing.pages import MOST_PAGES
from engage_hri.services.perception.hearing.service import hear
from engage_hri.services.perception.hearing.voice import RATE, Samples
from engage_hri.services.runtime.service import Ready, Service, running
from tests.perception.spoken import placed, spoken, voice
from tests.perception.test_hearing import Heard, hearing, idle, sphinx

FRAME = 512
LONG = "move the purple triangle to the top"


@asynccontextmanager
async def pages(hub: MemoryHub, **settings: Any) -> AsyncIterator[tuple[Heard, Bus]]:
    """Hearing of pages, and the window that sends their sound."""
    async with hearing(hub, source="page", **settings) as heard:
        await asyncio.sleep(1.0)
        yield heard, hub.join("console", role="wizard")


async def send(
    window: Bus,
    person: str,
    samples: Samples,
    *,
    lost: range = range(0),
    jumps: int | None = None,
    ends: bool = True,
    late: float = 0.05,
) -> float:
    """Send sound as a page does. Returns the loop time of its second 0.

    lost: numbers of frames that do not come. jumps: number of the frame from which on its clock is 0.3 s behind.
    """
    begin = window.now()
    for number in range(len(samples) // FRAME):
        at = begin + number * FRAME / RATE
        await asyncio.sleep(at + FRAME / RATE + late - window.now())
        content = samples[number * FRAME : (number + 1) * FRAME].astype("<i2").tobytes()
        behind = 0.0 if jumps is None or number < jumps else 0.3
        if number not in lost:
            window.publish(
                keys.sound(person),
                SoundFrame(at=window.stamp(at - behind), rate=RATE, samples=content, number=number + 1),
            )
    if ends:
        window.publish(keys.sound(person), SoundFrame(at=window.stamp(), rate=RATE, number=len(samples) // FRAME + 1))
    return begin


async def test_the_voice_is_that_of_the_person_at_the_page_with_its_instants_and_words(hub: MemoryHub):
    said = spoken("the blue one")

    async with pages(hub, **sphinx()) as (heard, window), perceive("ann", hub=hub), perceive("ben", hub=hub):
        begin = await send(window, "ben", said.samples)
        await asyncio.sleep(1.0)

    [(who, since, until)] = heard.speeches
    assert who == "ben"
    assert since + heard.begin - begin == pytest.approx(said.since, abs=0.05)
    assert until + heard.begin - begin == pytest.approx(said.until, abs=0.08)
    assert heard.of(Utterance, final=True)[0].text == "the blue one"
    assert heard.of(Fault) == []
    assert not heard.of(ActorLost, actor="visitor")


async def test_pages_are_heard_from_the_instant_on_at_which_hearing_listens_and_know_it(hub: MemoryHub):
    """What is said to one that restarts slowly is told to be lost: the window asks whether anybody hears it."""
    window = hub.join("console", role="wizard")
    own: dict[str, Service] = {"hearing": partial(hear, config=HearingConfig(source="page"))}
    async with running(hub, own):
        await asyncio.sleep(10.0)
        assert "not ready yet" in unheard(window, keys.sound("ann"))
        async with running(hub, {"recognition": idle}):
            await asyncio.sleep(LOOK_AROUND + 0.1)
            assert not unheard(window, keys.sound("ann"))


async def test_the_robots_voice_is_known_that_began_before_hearing_listened(hub: MemoryHub):
    """It does not tell what it plays: nobody is heard then, and that is told."""

    async def speaks(bus: Bus, ready: Ready) -> None:
        ready()
        await asyncio.sleep(0.2)
        bus.publish(keys.ROBOT_ACTION, ActionBegan(actor=bus.robot, action="speak", at=bus.stamp()))
        await asyncio.get_running_loop().create_future()

    async with hearing(hub, speaks, source="page") as heard:
        await send(hub.join("console", role="wizard"), "ann", np.zeros(2 * RATE, np.int16))

    assert ["nobody is heard while the robot speaks" in fault.reason for fault in heard.of(Fault)] == [True]


async def test_people_at_several_pages_are_heard_at_once(hub: MemoryHub):
    async with pages(hub, **sphinx()) as (heard, window), perceive("ann", hub=hub), perceive("ben", hub=hub):
        await asyncio.gather(
            send(window, "ann", placed([(1.0, voice("which one"))], 4.0)),
            send(window, "ben", placed([(1.2, voice("this one here", "f3"))], 4.0)),
        )
        await asyncio.sleep(1.0)

    assert {each.actor: each.text for each in heard.of(Utterance, final=True)} == {
        "ann": "which one", "ben": "this one here"
    }  # fmt: skip


async def test_a_source_that_nobody_tells_of_is_a_person_as_long_as_it_sounds(hub: MemoryHub):
    async with pages(hub) as (heard, window):
        await send(window, "ann", spoken("yes").samples)
        await asyncio.sleep(0.1)
        assert [each.actor for each in heard.of(ActorFound)] == ["ann"]
        assert [each.actor for each in heard.of(ActorLost)] == ["ann"]


async def test_a_microphone_that_is_switched_off_ends_the_speech_at_once(hub: MemoryHub):
    said = spoken(LONG)
    samples = said.samples[: round((said.since + 1.0) * RATE)]

    async with pages(hub) as (heard, window), perceive("ann", hub=hub):
        begin = await send(window, "ann", samples)
        await asyncio.sleep(0.05)
        [(_, _, until)] = heard.speeches
        assert until + heard.begin - begin == pytest.approx(said.since + 1.0, abs=0.15)
        assert heard.of(Fault) == []

        await send(window, "ann", spoken("yes").samples)
        assert len(heard.speeches) == 2


async def test_a_page_that_gives_nothing_any_more_is_told_within_two_seconds_and_its_speech_ends(hub: MemoryHub):
    said = spoken(LONG)

    async with pages(hub) as (heard, window), perceive("ann", hub=hub):
        await send(window, "ann", said.samples[: round((said.since + 1.0) * RATE)], ends=False)
        await asyncio.sleep(SILENT + 0.1)
        assert len(heard.speeches) == 1
        [fault] = heard.of(Fault)
        assert fault.reason == "no sound comes any more from the microphone of ann"

        await send(window, "ann", spoken("yes").samples)
        assert len(heard.speeches) == 2
        assert len(heard.of(Fault)) == 1


async def test_sound_that_is_lost_is_told_once_and_a_gap_ends_the_speech(hub: MemoryHub):
    said = spoken(LONG)
    middle = round((said.since + said.until) / 2 * RATE / FRAME)

    async with pages(hub) as (heard, window), perceive("ann", hub=hub):
        await send(window, "ann", said.samples, lost=range(middle, middle + 1))
        assert len(heard.speeches) == 1
        assert [fault.reason for fault in heard.of(Fault)] == ["sound from the microphone of ann is lost on its way"]
        await send(window, "ann", said.samples, lost=range(middle, middle + 10))
        assert len(heard.speeches) == 3


async def test_a_clock_that_jumps_ends_the_speech_and_that_is_told(hub: MemoryHub):
    said = spoken(LONG)
    middle = round((said.since + said.until) / 2 * RATE / FRAME)

    async with pages(hub) as (heard, window), perceive("ann", hub=hub):
        await send(window, "ann", said.samples, jumps=middle)
        assert len(heard.speeches) == 2
        [fault] = heard.of(Fault)
        assert fault.reason == "a speech of ann has ended where some of its sound is missing"


async def test_a_flood_of_microphones_is_bounded_and_what_is_no_sound_of_ours_is_told(hub: MemoryHub):
    second = np.zeros(RATE, np.int16)

    async with pages(hub) as (heard, window):
        await asyncio.gather(*(send(window, f"p{number}", second, ends=False) for number in range(MOST_PAGES + 1)))
        window.publish(keys.sound("odd"), SoundFrame(at=window.stamp(), rate=44100, samples=bytes(64)))
        await asyncio.sleep(0.1)
        reasons = [fault.reason for fault in heard.of(Fault)]
        assert f"{MOST_PAGES} microphones are heard already, and that of p{MOST_PAGES} is not" in reasons
        assert "the sound of odd has 44100 samples per second: expected 16000" in reasons


async def test_old_sound_and_that_of_the_future_do_no_harm(hub: MemoryHub):
    async with pages(hub) as (heard, window), perceive("ann", hub=hub):
        for at in (window.now() - 60.0, window.now() + 60.0):
            frame = SoundFrame(at=window.stamp(at), rate=RATE, samples=bytes(2 * FRAME), number=1)
            window.publish(keys.sound("ann"), frame)
        begin = await send(window, "ann", spoken("yes").samples)
        assert [who for who, _, _ in heard.speeches] == ["ann"]
        assert heard.speeches[0][1] + heard.begin > begin
