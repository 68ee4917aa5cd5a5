"""Words of the voice `espeak` are where an independent recogniser hears them: PocketSphinx, by forced alignment."""

import wave
from pathlib import Path

import numpy as np
import pytest

from engage_hri.schemas.behaviors import Mark, Speech
from engage_hri.schemas.text import tokens
from engage_hri.services.control.contract.body import MovementAuthority, Reached
from engage_hri.services.control.voice.espeak import EspeakSettings
from engage_hri.services.control.voice.sounding import EspeakVoice
from tests.recogniser import Recogniser

TEXTS = (
    "Could you hand me the blue square, please?",
    "Now move the yellow triangle so that it touches the top of the red piece.",
    "Please give me the big green square over there.",
)


async def test_words_are_where_a_recogniser_hears_them(tmp_path: Path):
    pytest.importorskip("espeakng_loader", reason="needs the extra `voice`")
    recogniser = Recogniser()
    voice = EspeakVoice(EspeakSettings(file=str(tmp_path / "said.wav")))
    begun: list[list[float]] = []
    async with voice.connected():
        for text in TEXTS:
            marks = tuple(Mark(f"m{n}", token.end - len(token.text)) for n, token in enumerate(tokens(text)))
            speech = Speech(id="s", text=text, marks=marks)
            told = [item async for item in voice.perform(speech, MovementAuthority(speech, "end"))]
            begun.append([item.at for item in told if isinstance(item, Reached)][1:])
    with wave.open(str(tmp_path / "said.wav")) as file:
        rate = file.getframerate()
        sound = np.frombuffer(file.readframes(file.getnframes()), "<i2").astype(float)
    errors = []
    for text, (*marks, end) in zip(TEXTS, begun, strict=True):
        words = [token.text.strip(",.?") for token in tokens(text)]
        heard = recogniser.aligned(sound, rate, marks[0] - 0.05, end + 0.05, words)
        assert len(heard) == len(marks)
        errors += [abs(begin - mark) for (begin, _), mark in zip(heard, marks, strict=True)]

    assert np.median(errors) < 0.03
    assert max(errors) < 0.1
