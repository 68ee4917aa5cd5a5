"""Vosk: small models for many languages, by their folder. Words come while somebody speaks."""

import json
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

from engage_hri.services.perception.hearing.recognizing import (
    Listening,
    RecognizerSettings,
    SpeechRecognizer,
    SpeechWords,
    missing,
    no_model,
)
from engage_hri.services.perception.hearing.voice import RATE, Samples


class Vosk(SpeechRecognizer):
    """A recognizer with a Vosk model. With phrases it understands nothing else."""

    def __init__(self, settings: RecognizerSettings) -> None:
        try:
            vosk: Any = import_module("vosk")
        except ImportError as error:
            raise missing("vosk", error) from error
        if not Path(settings.model).is_dir() or not settings.model:
            advice = "hearing.model=FOLDER of one of alphacephei.com/vosk/models"
            raise no_model(f"no Vosk model in {settings.model!r}", advice)
        vosk.SetLogLevel(-1)
        model: Any = vosk.Model(settings.model)
        phrases = [json.dumps([*settings.phrases, "[unk]"])] if settings.phrases else []
        self._make: Callable[[], Any] = lambda: vosk.KaldiRecognizer(model, RATE, *phrases)

    def listen(self) -> Listening:
        return _VoskListening(self._make())


class _VoskListening(Listening):
    def __init__(self, decoder: Any) -> None:
        self._decoder = decoder
        self._decoder.SetWords(True)
        self._said: list[str] = []
        """What it has finished: it takes a pause for the end."""
        self._sure: list[float] = []

    def hear(self, samples: Samples) -> str:
        if self._decoder.AcceptWaveform(samples.tobytes()):
            self._finished(self._decoder.Result())
            return " ".join(self._said)
        return " ".join([*self._said, json.loads(self._decoder.PartialResult())["partial"]])

    def end(self) -> SpeechWords:
        self._finished(self._decoder.FinalResult())
        return SpeechWords(" ".join(self._said), min(self._sure, default=1.0))

    def _finished(self, told: str) -> None:
        result = json.loads(told)
        self._said += [word for word in result.get("text", "").split() if word != "[unk]"]
        self._sure += [min(1.0, max(0.0, word["conf"])) for word in result.get("result", ())]
