"""sherpa-onnx: models of several kinds by their folder; of these, streaming transducers and Whisper's in ONNX."""

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

ADVICE = (
    "hearing.model=FOLDER with encoder, decoder, joiner (.onnx) and tokens.txt, as k2-fsa.github.io/sherpa has them"
)
TAIL = RATE // 2
"""Samples of silence after a speech, so that a streaming model says its last words."""


class Sherpa(SpeechRecognizer):
    """A recognizer with a model for sherpa-onnx: with a joiner it understands while somebody speaks."""

    def __init__(self, settings: RecognizerSettings) -> None:
        try:
            import sherpa_onnx
        except ImportError as error:
            raise missing("sherpa-onnx", error) from error
        folder = Path(settings.model)
        parts = {name: _part(folder, f"*{name}*.onnx") for name in ("encoder", "decoder", "joiner")}
        tokens = _part(folder, "*tokens.txt")
        if not (settings.model and tokens and parts["encoder"] and parts["decoder"]):
            raise no_model(f"no model for sherpa-onnx in {settings.model!r}", ADVICE)
        self._is_streaming = bool(parts["joiner"])
        self._engine: Any
        if self._is_streaming:
            self._engine = sherpa_onnx.OnlineRecognizer.from_transducer(tokens=tokens, num_threads=1, **parts)
        else:
            del parts["joiner"]
            self._engine = sherpa_onnx.OfflineRecognizer.from_whisper(
                tokens=tokens, num_threads=1, language=settings.language.split("-")[0], **parts
            )

    def listen(self) -> Listening:
        return _SherpaListening(self._engine) if self._is_streaming else Whole(self._understand)

    def _understand(self, samples: Samples) -> SpeechWords:
        stream = self._engine.create_stream()
        stream.accept_waveform(RATE, _floats(samples))
        self._engine.decode_stream(stream)
        return SpeechWords(stream.result.text)


class _SherpaListening(Listening):
    def __init__(self, engine: Any) -> None:
        self._engine = engine
        self._stream = engine.create_stream()

    def hear(self, samples: Samples) -> str:
        self._stream.accept_waveform(RATE, _floats(samples))
        return self._known()

    def end(self) -> SpeechWords:
        self._stream.accept_waveform(RATE, np.zeros(TAIL, np.float32))
        self._stream.input_finished()
        return SpeechWords(self._known())

    def _known(self) -> str:
        while self._engine.is_ready(self._stream):
            self._engine.decode_stream(self._stream)
        return str(self._engine.get_result(self._stream))


def _part(folder: Path, pattern: str) -> str:
    """A file of a model: of several the smaller one, which is the one of whole numbers; empty: there is none."""
    found = sorted(folder.glob(pattern), key=lambda path: path.stat().st_size)
    return str(found[0]) if found else ""


def _floats(samples: Samples) -> Any:
    return samples.astype(np.float32) / 32768
