"""Adaptors whose models are not here: what they ask of engines, and make of the answers. These are stand-ins.

`whisper` was tried with a real model by hand, as docs/hearing.md tells; `vosk` and `sherpa` never were.
"""

import json
import sys
from math import exp, log
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from engage_hri.services.perception.hearing import microphone
from engage_hri.services.perception.hearing.listening import Order
from engage_hri.services.perception.hearing.recognizing import RecognizerSettings, SpeechRecognizer, SpeechWords
from engage_hri.services.perception.hearing.voice import RATE

SECOND = np.full(RATE, 16384, np.int16)


def made(name: str, module: str, monkeypatch: pytest.MonkeyPatch, engine: Any, **settings: Any) -> SpeechRecognizer:
    monkeypatch.setitem(sys.modules, module, engine)
    return Order(name, RecognizerSettings(**settings)).made()


def test_vosk_tells_words_as_they_come_and_leaves_out_what_it_does_not_know(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):
    asked: list[Any] = []

    class Decoder:
        def __init__(self, *given: Any) -> None:
            asked.extend(given[1:])
            self.heard = 0

        def SetWords(self, wanted: bool) -> None:
            assert wanted

        def AcceptWaveform(self, samples: bytes) -> bool:
            self.heard += len(samples) // 2
            return self.heard == 2 * RATE

        def PartialResult(self) -> str:
            return json.dumps({"partial": "the blue" if self.heard == RATE else "one"})

        def Result(self) -> str:
            return json.dumps({"text": "the blue [unk]", "result": [{"conf": 0.9}, {"conf": 0.7}]})

        def FinalResult(self) -> str:
            return json.dumps({"text": "one", "result": [{"conf": 0.8}]})

    engine = SimpleNamespace(Model=str, KaldiRecognizer=Decoder, SetLogLevel=lambda level: None)
    settings = {"model": str(tmp_path), "phrases": ("the blue one",)}
    speech = made("vosk", "vosk", monkeypatch, engine, **settings).listen()

    assert [speech.hear(SECOND).strip() for _ in range(3)] == ["the blue", "the blue", "the blue one"]
    assert speech.end() == SpeechWords("the blue one", 0.7)
    assert asked == [RATE, '["the blue one", "[unk]"]']
    assert made("vosk", "vosk", monkeypatch, engine, model=str(tmp_path)).listen().end().text == "one"
    assert asked[2:] == [RATE]


class Stream:
    """A stream of sherpa-onnx: a word for each second. result: as of one that is understood whole."""

    def __init__(self) -> None:
        self.samples = 0
        self.is_over = False

    def accept_waveform(self, rate: int, samples: Any) -> None:
        assert rate == RATE
        assert samples.dtype == np.float32
        assert np.abs(samples).max() in (0.0, 0.5)
        self.samples += len(samples)

    def input_finished(self) -> None:
        self.is_over = True

    @property
    def result(self) -> SimpleNamespace:
        return SimpleNamespace(text=f" {self.samples // RATE} seconds")


class Engine:
    def __init__(self, **files: Any) -> None:
        self.files = files
        self.decoded = 0

    def create_stream(self) -> Stream:
        return Stream()

    def is_ready(self, stream: Stream) -> bool:
        return self.decoded < stream.samples

    def decode_stream(self, stream: Stream) -> None:
        self.decoded = stream.samples

    def get_result(self, stream: Stream) -> str:
        return " ".join(["word"] * (stream.samples // RATE)) + "." * stream.is_over


@pytest.mark.parametrize("is_streaming", [True, False])
def test_sherpa_takes_a_model_by_its_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, is_streaming: bool):
    engines: list[Engine] = []

    def make(**files: Any) -> Engine:
        engines.append(Engine(**files))
        return engines[0]

    kind = SimpleNamespace(from_transducer=make, from_whisper=make)
    engine = SimpleNamespace(OnlineRecognizer=kind, OfflineRecognizer=kind)
    for name, size in (("encoder.onnx", 9), ("encoder.int8.onnx", 3), ("decoder.onnx", 1), ("base-tokens.txt", 1)):
        (tmp_path / name).write_bytes(bytes(size))
    if is_streaming:
        (tmp_path / "joiner.onnx").write_bytes(b"0")

    speech = made("sherpa", "sherpa_onnx", monkeypatch, engine, model=str(tmp_path), language="de-AT").listen()
    assert [speech.hear(SECOND), speech.hear(SECOND)] == (["word", "word word"] if is_streaming else ["", ""])
    assert speech.end().text.strip() == ("word word." if is_streaming else "2 seconds")
    [made_engine] = engines
    assert Path(made_engine.files["encoder"]).name == "encoder.int8.onnx"
    assert made_engine.files.get("language") == (None if is_streaming else "de")


def test_whisper_leaves_out_what_it_makes_up_of_silence(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    asked: dict[str, Any] = {}

    class Model:
        def __init__(self, folder: str, **options: Any) -> None:
            assert options["local_files_only"]

        def transcribe(self, samples: Any, **options: Any) -> tuple[list[SimpleNamespace], None]:
            asked.update(options)
            return [
                SimpleNamespace(text=" The blue one.", no_speech_prob=0.1, avg_logprob=log(0.8)),
                SimpleNamespace(text=" Thanks for watching!", no_speech_prob=0.9, avg_logprob=-2.0),
            ], None

    (tmp_path / "model.bin").write_bytes(b"0")
    settings = {"model": str(tmp_path), "language": "en-GB", "phrases": ("yes", "no")}
    recognizer = made("whisper", "faster_whisper", monkeypatch, SimpleNamespace(WhisperModel=Model), **settings)

    speech = recognizer.listen()
    speech.hear(SECOND)
    assert speech.end() == SpeechWords("The blue one.", pytest.approx(exp(log(0.8))))
    assert (asked["language"], asked["initial_prompt"]) == ("en", "yes. no")
    assert recognizer.listen().end() == SpeechWords("")


@pytest.mark.parametrize(("name", "module", "package"), [
    ("vosk", "vosk", "vosk"), ("sherpa", "sherpa_onnx", "sherpa-onnx"),
    ("whisper", "faster_whisper", "faster-whisper"), ("sphinx", "pocketsphinx", "pocketsphinx"),
])  # fmt: skip
def test_an_engine_that_is_not_installed_is_named_with_the_command(
    monkeypatch: pytest.MonkeyPatch, name: str, module: str, package: str
):
    with pytest.raises(Exception, match=module) as refused:
        made(name, module, monkeypatch, None, phrases=("yes",))
    assert f"pip install {package}" in str(refused.value)


def test_where_no_program_records_sounddevice_does(monkeypatch: pytest.MonkeyPatch, capfdbinary: Any):
    """It writes what its stream gives, until nobody reads any more."""
    given = iter([(b"ab" * 320, False), (b"cd" * 320, False)])

    class Recording:
        def __init__(self, **options: Any) -> None:
            assert (options["samplerate"], options["channels"], options["dtype"]) == (RATE, 2, "int16")

        def __enter__(self) -> "Recording":
            return self

        def __exit__(self, *error: object) -> None: ...

        def read(self, count: int) -> tuple[bytes, bool]:
            return next(given)

    monkeypatch.setitem(sys.modules, "sounddevice", SimpleNamespace(RawInputStream=Recording))
    monkeypatch.setattr(sys, "argv", ["microphone", "2"])
    with pytest.raises(StopIteration):
        microphone.main()
    assert capfdbinary.readouterr().out == b"ab" * 320 + b"cd" * 320
