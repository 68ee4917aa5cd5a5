"""faster-whisper: Whisper models in the form of CTranslate2, by their folder. Words come once a speech is over."""

import re
from math import exp
from pathlib import Path
from typing import Any

import numpy as np

from engage_hri.services.perception.hearing.recognizing import (
    Listening,
    RecognizerSettings,
    SpeechRecognizer,
    SpeechWords,
    Whole,
    missing,
    no_model,
)
from engage_hri.services.perception.hearing.voice import RATE, Samples

NO_SPEECH = 0.6
"""Likelihood from which on there was no speech in a sound, whatever words it makes up: Whisper's own limit."""


class Whisper(SpeechRecognizer):
    """A recognizer with a Whisper model."""

    def __init__(self, settings: RecognizerSettings) -> None:
        try:
            from faster_whisper import WhisperModel
        except ImportError as error:
            raise missing("faster-whisper", error) from error
        if not (Path(settings.model) / "model.bin").is_file():  # else it would fetch one by this name
            advice = "hearing.model=FOLDER, with model.bin, config.json, tokenizer.json and vocabulary of CTranslate2"
            raise no_model(f"no Whisper model in {settings.model!r}", advice)
        self._model: Any = WhisperModel(settings.model, device="auto", compute_type="int8", local_files_only=True)
        self._language = re.split("[-_]", settings.language)[0].lower()
        self._expected = ". ".join(settings.phrases) or None

    def listen(self) -> Listening:
        return Whole(self._understand)

    def _understand(self, samples: Samples) -> SpeechWords:
        if len(samples) < RATE // 10:
            return SpeechWords("")
        found, _ = self._model.transcribe(
            samples.astype(np.float32) / 32768, language=self._language, beam_size=1, without_timestamps=True,
            condition_on_previous_text=False, initial_prompt=self._expected,
        )  # fmt: skip
        parts = [each for each in found if each.no_speech_prob < NO_SPEECH or each.avg_logprob > -1.0]
        sure = min((exp(min(0.0, each.avg_logprob)) for each in parts), default=1.0)
        return SpeechWords(" ".join(each.text.strip() for each in parts), sure)
