"""What becomes of a speech whose sound is lost: on a device that stops, in a file without room, at an abort."""

import asyncio
import os
from pathlib import Path

import pytest

from engage_hri.schemas.behaviors import Speech
from engage_hri.schemas.faults import Fault
from engage_hri.services.control.body import BodyFailed, MovementAuthority, Spoke
from engage_hri.services.control.voice.outlets import Nowhere, Several
from engage_hri.services.control.voice.settings import VoiceSettings
from engage_hri.services.control.voice.sounding import SoundingVoice
from engage_hri.services.control.voice.synthesis import Phrase, Said, Synthesizer

FULL = pytest.mark.skipif(not os.path.exists("/dev/full"), reason="there is no /dev/full here")


class Tones(Synthesizer):
    """Each letter of a word is a tone of 50 ms, each space silence as long."""

    rate = 16000

    def say(self, phrase: Phrase) -> Said:
        letter, space = [0.5, -0.5] * 400, [0.0] * 800
        return Said([level for each in phrase.text for level in (space if each == " " else letter)])


class Voice(SoundingVoice):
    name, synthesizer, Settings = "tones", Tones, VoiceSettings


def listening(voice: Voice) -> list[Fault]:
    faults: list[Fault] = []
    voice.on_fault = faults.append
    return faults


async def said(voice: Voice, text: str) -> list[str]:
    speech = Speech(id="s", text=text)
    progress = [each async for each in voice.perform(speech, MovementAuthority(speech, "end"))]
    return [each.word for each in progress if isinstance(each, Spoke)]


@FULL
async def test_a_file_without_room_is_told_once_and_the_loudspeaker_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    voice = Voice(VoiceSettings(file="/dev/full"))
    faults = listening(voice)
    async with voice.connected():
        assert voice._wav is not None
        loudspeaker = Nowhere(asyncio.get_running_loop().time)
        monkeypatch.setattr(voice, "_outlet", Several([loudspeaker, voice._wav]))
        for _ in range(2):
            assert await said(voice, "one two") == ["one", "two"]

    assert [(each.where, each.reason) for each in faults] == [
        ("/dev/full", "the sound file /dev/full: No space left on device")
    ]


@FULL
async def test_a_speech_that_only_a_file_without_room_takes_fails() -> None:
    voice = Voice(VoiceSettings(file="/dev/full"))
    faults = listening(voice)
    async with voice.connected():
        for _ in range(2):
            with pytest.raises(BodyFailed, match="s: the sound file /dev/full: No space left"):
                await said(voice, "one two")

    assert [each.where for each in faults] == ["/dev/full"]


async def test_a_file_that_has_room_again_takes_sound_again(tmp_path: Path) -> None:
    voice = Voice(VoiceSettings(file=str(tmp_path / "said.wav")))
    faults = listening(voice)
    async with voice.connected():
        assert voice._wav is not None
        for _ in range(2):
            voice._wav._fail("No space left on device", "is the disk full?")
            assert await said(voice, "one two") == ["one", "two"]

    assert len(faults) == 2
    assert (tmp_path / "said.wav").stat().st_size > 2 * 0.6 * 16000
