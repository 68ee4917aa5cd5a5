"""A synthesizer that freezes, dies or says nothing: what is heard of it, and that the next speech is said."""

import asyncio
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace

import pytest

from engage_hri.schemas.behaviors import Speech
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.world import World
from engage_hri.services.control.bases.driver_guard import GuardedBody
from engage_hri.services.control.bases.drivers import made
from engage_hri.services.control.config import ControlConfig
from engage_hri.services.control.contract.body import BehaviorRefused, Body, BodyFailed, MovementAuthority, Spoke
from engage_hri.services.control.voice import studio
from engage_hri.services.control.voice.sounding import SoundingVoice
from engage_hri.services.control.voice.synthesis import Phrase
from engage_hri.services.control.voice.worker import Order, packed

ILL = """
import os, time
import numpy as np
from engage_hri.services.control.voice.synthesis import VoiceSettings
from engage_hri.services.control.voice.sounding import SoundingVoice
from engage_hri.services.control.voice.synthesis import Said, Synthesizer

def first_time(name):
    try:
        os.close(os.open({folder!r} + "/" + name, os.O_CREAT | os.O_EXCL))
    except FileExistsError:
        return False
    return True

class Ill(Synthesizer):
    rate = 16000

    def say(self, phrase):
        if "freezes" in phrase.text or ("stumbles" in phrase.text and first_time("stumbled")):
            time.sleep(1000)
        if "dies" in phrase.text or ("trips" in phrase.text and first_time("tripped")):
            os._exit(7)
        if "nothing" in phrase.text:
            return Said(b"")
        samples = np.arange(16000) / 16000
        loudness = 0.0005 if "silence" in phrase.text else 0.3
        return Said(loudness * np.sin(2 * np.pi * 120 * samples))

class Voice(SoundingVoice):
    name, synthesizer, Settings = "ill", Ill, VoiceSettings
"""


def ill(tmp_path: Path) -> Body:
    (tmp_path / "ill.py").write_text(ILL.format(folder=str(tmp_path)), encoding="utf-8")
    drivers = {"Voice": {"device": "none", "phrase_limit": 0.5}}
    return made(ControlConfig(body=f"{tmp_path}/ill.py:Voice", drivers=drivers))


async def said(voice: Body, text: str) -> list[str]:
    speech = Speech(id="s", text=text)
    return [
        each.word async for each in voice.perform(speech, MovementAuthority(speech, "end")) if isinstance(each, Spoke)
    ]


def listening(voice: Body) -> Sequence[Fault]:
    faults: list[Fault] = []
    voice.on_fault = faults.append
    return faults


LONG = "freezes" + 100_000 * "x"
"""A phrase of one word that does not fit into a pipe."""


@pytest.mark.real_time
async def test_a_long_text_does_not_make_the_loop_wait_for_a_synthesizer_that_is_frozen(tmp_path: Path) -> None:
    voice = ill(tmp_path)
    async with voice.connected():
        assert isinstance(voice, GuardedBody)
        assert isinstance(voice.body, SoundingVoice)
        assert voice.body._studio._process is not None
        voice.body._studio._process.send_signal(signal.SIGSTOP)
        with pytest.raises(BodyFailed, match=r"does not answer for 0\.\d s, at 'freezesxxx"):
            await said(voice, LONG)
        assert await said(voice, "x" * 100_000) == ["x" * 100_000]


@pytest.mark.real_time
async def test_a_speech_whose_synthesizer_freezes_fails_and_the_loop_goes_on(tmp_path: Path) -> None:
    voice = ill(tmp_path)
    faults = listening(voice)
    async with voice.connected():
        speaking = asyncio.create_task(said(voice, "this freezes"))
        done, _ = await asyncio.wait([speaking], timeout=0.2)
        assert not done
        with pytest.raises(BodyFailed, match=r"does not answer for 0\.5 s, at 'this freezes'"):
            await asyncio.wait_for(speaking, 20.0)
        assert await said(voice, "all is well") == ["all", "is", "well"]

    assert [each.where for each in faults] == ["synthesizer"]


@pytest.mark.parametrize("text", ["it trips once", "it stumbles once"])
async def test_a_text_at_which_the_synthesizer_failed_once_is_said(
    text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(studio, "NEWS", 0.0)
    voice = ill(tmp_path)
    faults = listening(voice)
    async with voice.connected():
        if "stumbles" in text:
            with pytest.raises((BodyFailed, BehaviorRefused), match="does not answer"):
                await said(voice, text)
        assert await said(voice, text) == text.split()

    assert len(faults) == 1


async def test_a_text_that_kills_it_twice_in_a_row_is_refused_for_a_while(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    voice = ill(tmp_path)
    faults = listening(voice)
    async with voice.connected():
        for _ in range(2):
            with pytest.raises(BehaviorRefused, match=r"ended.*, at 'it dies', for the second time"):
                await said(voice, "it dies")
        assert len(faults) == 2
        assert await said(voice, "all is well") == ["all", "is", "well"]
        later = SimpleNamespace(monotonic=lambda: time.monotonic() + studio.AGAIN)
        monkeypatch.setattr(studio, "time", later)
        with pytest.raises(BehaviorRefused, match="for the second time"):
            await said(voice, "it dies")

    assert len(faults) == 3


@pytest.mark.parametrize("text", ["there is nothing", "all silence"])
async def test_words_of_which_nothing_is_heard_are_not_told_as_spoken(text: str, tmp_path: Path) -> None:
    voice = ill(tmp_path)
    async with voice.connected():
        estimate = voice.estimate(Speech(id="s", text=text), None, World(entities=()))
        with pytest.raises(BehaviorRefused, match=f"Ill makes no sound of '{text}'"):
            await said(voice, text)
        assert await said(voice, "… 😊 …") == []  # nothing that could be heard

    assert not estimate.feasible


def test_a_synthesizer_whose_voice_is_gone_ends_without_a_word(tmp_path: Path) -> None:
    (tmp_path / "slow.py").write_text(
        "import time\n"
        "from engage_hri.services.control.voice.synthesis import Said, Synthesizer\n"
        "class Slow(Synthesizer):\n"
        "    def say(self, phrase):\n"
        "        time.sleep(0.2)\n"
        "        return Said([0.5, -0.5] * 4000)\n"
    )
    process = subprocess.Popen(
        [sys.executable, "-m", "engage_hri.services.control.voice.worker"],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip
    assert process.stdin is not None
    assert process.stdout is not None
    assert process.stderr is not None
    process.stdin.write(packed(Order("slow", "Slow", str(tmp_path / "slow.py"))) + packed(Phrase("one two")))
    process.stdin.flush()
    process.stdout.close()
    process.stdin.close()

    assert (process.wait(30), process.stderr.read()) == (0, b"")
    process.stderr.close()
