"""Words of the voice `espeak` are where an independent recogniser hears them: PocketSphinx, by forced alignment."""

import wave
from pathlib import Path

import numpy as np
import pytest

from engage_hri.schemas.behaviors import Mark, Speech
from engage_hri.schemas.speakable import tokens
from engage_hri.services.control.body import MovementAuthority, Reached
from engage_hri.services.control.voice.espeak import EspeakSettings
from engage_hri.services.control.voice.sounding import EspeakVoice

TEXTS = (
    "Could you hand me the blue square, please?",
    "Now move the yellow triangle so that it touches the top of the red piece.",
    "Please give me the big green square over there.",
)


async def test_words_are_where_a_recogniser_hears_them(tmp_path: Path):
    pytest.importorskip("espeakng_loader", reason="eSpeak NG is not installed: pip install 'engage-hri[voice]'")
    sphinx = pytest.importorskip("pocketsphinx", reason="pip install pocketsphinx")
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
        since = marks[0] - 0.05
        piece = sound[max(0, int(since * rate)) : int((end + 0.05) * rate)]
        times = np.arange(0.0, len(piece) / rate, 1 / 16000)
        samples = np.interp(times, np.arange(len(piece)) / rate, piece).astype("<i2").tobytes()
        heard = _aligned(sphinx, samples, " ".join(token.text.strip(",.?").lower() for token in tokens(text)))
        assert len(heard) == len(marks)
        errors += [abs(at + max(0.0, since) - mark) for at, mark in zip(heard, marks, strict=True)]

    assert np.median(errors) < 0.03
    assert max(errors) < 0.1


def _aligned(sphinx, samples: bytes, words: str) -> list[float]:  # type: ignore[no-untyped-def]
    """Seconds at which words begin in a sound of 16000 samples per second."""
    quiet = bytes(2 * 4800)
    decoder = sphinx.Decoder(samprate=16000, loglevel="FATAL")
    decoder.set_align_text(words)
    decoder.start_utt()
    decoder.process_raw(quiet + samples + quiet, full_utt=True)
    decoder.end_utt()
    return [each.start_frame / 100 - 0.3 for each in decoder.seg() if each.word[0] not in "<(["]
