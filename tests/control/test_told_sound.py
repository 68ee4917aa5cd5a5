"""What a voice tells of its sound, for others to play: the same as in its file, before it is heard, cut at a word."""

import asyncio
import wave
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace
from numpy.typing import NDArray

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Speech
from engage_hri.schemas.body import WordSpoken
from engage_hri.schemas.perception import SoundFrame
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.control.bases.composed import Member, composed
from engage_hri.services.control.bases.driver_guard import GuardedBody
from engage_hri.services.control.contract.body import MovementAuthority, Spoke, SpokenSound
from engage_hri.services.control.torso.body import SimulatedBody
from engage_hri.services.control.voice.outlets import AHEAD, PIECE, SOON
from engage_hri.services.control.voice.sounding import SoundingVoice
from engage_hri.services.control.voice.synthesis import VoiceSettings
from tests.control.directing import robot
from tests.control.test_voice_outlets import Tones

Samples = NDArray[np.int16]
TEXT = "apples oranges bananas lemons"


class Voice(SoundingVoice):
    name, synthesizer, Settings = "tones", Tones, VoiceSettings


class Listener:
    """One who plays what a body tells of its voice. is_there: it listens. told: with the loop time of each."""

    def __init__(self, body: SoundingVoice | GuardedBody, *, is_there: bool = True) -> None:
        self.is_there = is_there
        self.told: list[tuple[float, SpokenSound]] = []
        self._now = asyncio.get_running_loop().time
        body.on_sound = lambda sound: self.told.append((self._now(), sound))
        body.wants_sound = lambda: self.is_there

    def heard(self, seconds: float) -> Samples:
        """All samples from the loop time 0 on, as they are heard by what was known then."""
        found = np.zeros(round(seconds * Tones.rate), np.int16)
        for _, sound in self.told:
            samples, begin = np.frombuffer(sound.samples, "<i2"), round(sound.at * Tones.rate)
            if len(samples):
                found[begin : begin + len(samples)] = samples
            else:
                found[begin:] = 0
        return found


async def say(voice: SoundingVoice | GuardedBody, **at: float) -> list[float]:
    """Say the text; returns when its words were told. at: seconds from now for `hold`, `go_on` or `revoke`."""
    authority, loop = MovementAuthority(Speech(id="s", text=TEXT), "end"), asyncio.get_running_loop()
    for name, seconds in at.items():
        loop.call_later(seconds, getattr(authority, name))
    return [each.at async for each in voice.perform(Speech(id="s", text=TEXT), authority) if isinstance(each, Spoke)]


def in_file(path: Path) -> Samples:
    with wave.open(str(path)) as sound:
        return np.frombuffer(sound.readframes(sound.getnframes()), "<i2")


@pytest.mark.parametrize(
    "at", [{}, {"hold": 0.5, "go_on": 2.0}, *({"revoke": at} for at in (0.1, 0.34, 0.36, 0.4, 0.45, 0.8, 1.3, 1.45))]
)
async def test_what_is_told_is_what_the_file_has(at: dict[str, float], tmp_path: Path) -> None:
    file = tmp_path / "said.wav"
    voice = Voice(VoiceSettings(file=str(file)))
    listener = Listener(voice)
    async with voice.connected():
        await asyncio.sleep(1.0)
        await say(voice, **at)
        await say(voice)
    expected = in_file(file).astype(int)
    heard = listener.heard(len(expected) / Tones.rate).astype(int)

    faded = (
        np.flatnonzero(np.abs(heard - expected) > 1) / Tones.rate
    )  # before a cut the file has the end of a word softly
    assert faded.size == 0 or ("revoke" in at and np.ptp(faded) < 0.005)
    assert np.abs(heard).max() > 10_000


async def test_it_is_told_in_time_to_be_sent_and_in_pieces() -> None:
    voice = Voice()
    listener = Listener(voice)
    async with voice.connected():
        ends = await say(voice)

    ahead = [sound.at - came for came, sound in listener.told]
    assert ahead[0] == pytest.approx(SOON)
    assert min(ahead) >= SOON - 1e-6
    assert min(ahead[len(ahead) // 2 :]) >= AHEAD - 0.005  # the last samples of a word come with the next
    assert max(len(sound.samples) for _, sound in listener.told) <= 2 * PIECE * Tones.rate
    loud = np.flatnonzero(np.abs(listener.heard(ends[-1] + 1.0).astype(int)) > 1000) / Tones.rate
    assert loud[-1] == pytest.approx(ends[-1], abs=0.01)


@pytest.mark.parametrize("at", [0.1, 0.4, 0.8])
async def test_where_it_is_cut_is_told_before_the_word_has_ended(at: float) -> None:
    voice = Voice()
    listener = Listener(voice)
    async with voice.connected():
        ends = await say(voice, revoke=at + SOON)
    cuts = [(came, sound.at) for came, sound in listener.told if not sound.samples]

    assert len(cuts) <= 1
    for came, silent in cuts:
        assert came == pytest.approx(at + SOON)
        assert silent == pytest.approx(ends[-1])
    after = np.abs(listener.heard(ends[-1] + 1.0).astype(int))[round((ends[-1] + 0.01) * Tones.rate) :]
    assert not after.any()


async def test_a_voice_to_which_nobody_listens_is_as_quick_as_ever() -> None:
    voice = Voice()
    listener = Listener(voice, is_there=False)
    loop = asyncio.get_running_loop()
    async with voice.connected():
        begin = loop.time()
        alone = await say(voice)
        listener.is_there = True
        again, begun = loop.time(), begin
        heard = await say(voice)

    assert listener.told[0][0] >= again
    assert heard[0] - again == pytest.approx(alone[0] - begun + SOON)


async def test_control_tells_it_on_the_bus_while_somebody_listens(hub: MemoryHub) -> None:
    speech = Speech(id="s", text=TEXT)
    async with robot(hub, body=Voice(), hears=()) as client:
        silent = await client.outcome(client.perform(speech))
        with client.bus.subscribe(keys.ROBOT_SOUND) as inbox, client.bus.subscribe(keys.EVERYTHING) as everything:
            spoken = await client.outcome(client.perform(replace(speech, id="t")))
            frames = [(await inbox.next()).message for _ in range(len(inbox))]  # type: ignore[union-attr]
            others = [(await everything.next()).message for _ in range(len(everything))]  # type: ignore[union-attr]
        words = [each for each in client.of(WordSpoken) if each.behavior == "t"]  # type: ignore[attr-defined]

    assert silent.spoken == spoken.spoken == TEXT
    assert all(isinstance(each, SoundFrame) for each in frames)
    numbers = [each.number for each in frames]  # type: ignore[union-attr]
    assert numbers == list(range(len(frames)))
    seconds = sum(len(each.samples) for each in frames) / 2 / Tones.rate  # type: ignore[union-attr]
    end = words[-1].at.seconds  # type: ignore[attr-defined]
    assert frames[0].at.seconds + seconds == pytest.approx(end, abs=0.01)  # type: ignore[union-attr]
    assert others
    assert not [each for each in others if isinstance(each, SoundFrame)]


async def test_the_sound_of_a_driver_of_others_among_several_is_told() -> None:
    torso, voice = SimulatedBody(), GuardedBody("mine", Voice())
    parts = tuple(part for part in torso.capabilities.parts if part != "voice")
    body = composed([Member("simulated", torso, parts), Member("mine", voice, ("voice",))])
    listener = Listener(body)  # type: ignore[arg-type]
    async with body.connected():
        await say(body)  # type: ignore[arg-type]

    assert np.abs(listener.heard(5.0).astype(int)).max() > 10_000
