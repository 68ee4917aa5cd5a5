"""A synthesizer of one's own joins by the file on the page; words are aligned with sound alone."""

import asyncio
import re
from pathlib import Path

import numpy as np
import pytest

from engage_hri.schemas.behaviors import Speech, Wait
from engage_hri.schemas.world import World
from engage_hri.services.control.bases.drivers import made
from engage_hri.services.control.config import ControlConfig
from engage_hri.services.control.contract.body import MovementAuthority, Reached, Spoke
from engage_hri.services.control.voice.clauses import FRAME, Loudness, laid_out
from engage_hri.services.control.voice.synthesis import Said, SynthesisFailed
from engage_hri.services.control.voice.timeline import pieces

PAGE = (Path(__file__).parents[2] / "docs" / "control.md").read_text(encoding="utf-8")
SENTENCES = (
    ("en-us", "Could you hand me the blue square, please, so that it touches the top of the rectangle?"),
    ("en-us", "Now move the yellow triangle. It belongs on the left side, next to the house."),
    ("de", "Bitte legen Sie das gelbe Dreieck auf die linke Seite, neben das Haus."),
    ("fr", "Bonjour, est-ce que vous pouvez me donner le petit carré bleu?"),
    ("ru", "Пожалуйста, передвиньте синий квадрат налево."),
    ("zh", "你好，请把蓝色的方块放在桌子的左边。"),
)


async def test_the_synthesizer_of_the_page_speaks_by_its_file_name(tmp_path: Path):
    code = next(block for block in re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL) if "class MyVoice" in block)
    (tmp_path / "my_voice.py").write_text(code, encoding="utf-8")
    body = made(ControlConfig(body="simulated", voice=f"{tmp_path}/my_voice.py:MyVoice"))
    speech = Speech(id="s", text="One two three four")
    async with body.connected():
        progress = [each async for each in body.perform(speech, MovementAuthority(speech, "end"))]

    assert [each.word for each in progress if isinstance(each, Spoke)] == ["One", "two", "three", "four"]
    assert isinstance(progress[-1], Reached)
    assert asyncio.get_running_loop().time() == pytest.approx(18 * 0.07, abs=0.02)


def test_words_are_aligned_with_sound_alone_within_the_stated_error():
    pytest.importorskip("espeakng_loader", reason="needs the extra `voice`")
    from engage_hri.services.control.voice.espeak import EspeakSettings, EspeakSynthesizer

    engine, errors = EspeakSynthesizer(EspeakSettings()), []
    for language, text in SENTENCES:
        phrase = pieces(Speech(id="s", text=text, language=language))[0].phrase
        said = engine.say(phrase)
        known = laid_out(phrase.text, said, engine.rate).words
        guessed = laid_out(phrase.text, Said(said.samples), engine.rate).words
        errors += [abs(one.start - other.start) for one, other in zip(known, guessed, strict=True)]

    assert np.median(errors) < 0.07
    assert np.quantile(errors, 0.9) < 0.22


@pytest.mark.parametrize("after", range(6))
def test_a_sound_ends_with_the_last_frame_that_is_heard(after: int):
    frame = round(16000 * FRAME)
    sound = np.concatenate([np.zeros(3 * frame), np.full(7 * frame, 8000.0), np.zeros(after * frame)])

    loudness = Loudness(sound.astype(np.int16), 16000)

    assert (loudness.begin, loudness.end) == pytest.approx((3 * FRAME, 10 * FRAME))


def test_a_sample_of_which_half_is_missing_is_refused_with_what_is_expected():
    with pytest.raises(SynthesisFailed) as refused:
        laid_out("one", Said(bytes(2001)), 16000)

    assert "an odd number of bytes" in refused.value.fault.reason
    assert "16-bit integers" in refused.value.fault.advice


WAITING = """
import os, time
from engage_hri.services.control.voice.synthesis import VoiceSettings
from engage_hri.services.control.voice.sounding import SoundingVoice
from engage_hri.services.control.voice.synthesis import Said, Synthesizer

class Waiting(Synthesizer):
    rate = 16000

    def say(self, phrase):
        while not os.path.exists({file!r}):
            time.sleep(0.01)
        return Said([0.5, -0.5] * (3 * 8000))

class Voice(SoundingVoice):
    name, synthesizer, Settings = "waiting", Waiting, VoiceSettings
"""


@pytest.mark.real_time
async def test_other_work_goes_on_while_an_estimate_waits_for_a_new_text(tmp_path: Path):
    """The synthesizer is done after that other work: if the loop stood still, how long the sound is were unknown."""
    file = tmp_path / "go_on"
    (tmp_path / "waiting.py").write_text(WAITING.format(file=str(file)), encoding="utf-8")
    drivers = {"Voice": {"device": "none", "patience": 5.0}}
    body = made(ControlConfig(body="simulated", voice=f"{tmp_path}/waiting.py:Voice", drivers=drivers))
    speech = Speech(id="s", text="One two three four")
    async with body.connected():
        preparing = body.prepare([speech])
        assert preparing is not None
        asyncio.get_running_loop().call_later(0.1, file.touch)
        await preparing
        estimate = body.estimate(speech, None, World(entities=()))

    assert body.prepare([Wait(id="w", duration=1.0)]) is None
    assert estimate.phases[-1].to == "end"
    assert sum(phase.natural for phase in estimate.phases) == pytest.approx(3.0, abs=0.01)
