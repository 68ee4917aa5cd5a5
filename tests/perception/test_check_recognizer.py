"""`engage check-recognizer`: what it prints of a recognizer that understands, of one that does not, and of none."""

import json
from pathlib import Path
from typing import Any

import pytest

from tests.cli.command import Engage
from tests.cli.command import engage as command
from tests.perception.spoken import PHRASES, spoken, voice, write_wav


@pytest.fixture
def engage(capsys: pytest.CaptureFixture[str]) -> Engage:
    return command(capsys)


@pytest.fixture
def files(tmp_path: Path) -> Path:
    """Two spoken files: their words are "Which one?" and "the red one", of which the second says another word."""
    for number, (said, written) in enumerate([("which one", "Which one?"), ("the blue one", "the red one")]):
        write_wav(tmp_path / f"{number}.wav", spoken(said).samples)
        (tmp_path / f"{number}.txt").write_text(written)
    return tmp_path


PARROT = """
from engage_hri.services.perception.hearing.recognizing import SpeechRecognizer, SpeechWords, Whole

class Parrot(SpeechRecognizer):
    def listen(self):
        print("engines print")
        return Whole(lambda samples: SpeechWords("which one"))

class Lame(SpeechRecognizer):
    def listen(self):
        return Whole(lambda samples: 1 / 0)
"""


def test_errors_are_counted_in_words_by_file_and_in_all(engage: Engage, files: Path, install: Any):
    install("acme-ears", "[engage.recognizers]\nparrot = acme_parrot:Parrot\nlame = acme_parrot:Lame\n",
            acme_parrot=PARROT)  # fmt: skip

    done = engage("check-recognizer", "parrot", files)
    assert done.code == 0
    lines = done.out.splitlines()
    assert lines[0].endswith("0.wav: 'which one' right")
    assert lines[1].endswith("1.wav: 'which one' 67% wrong")
    assert lines[2].startswith("40.0% of the words wrong, 1 of 2 files right; known 0.")

    told = json.loads(engage("check-recognizer", "parrot", files / "1.wav", "--json").out)
    assert (told["word_errors"], told["files_right"]) == (pytest.approx(2 / 3), 0)
    assert told["files"][0]["said"] == "the red one"
    assert 0.2 < told["delay"] < 1.5

    failed = engage("check-recognizer", "lame", files)
    assert (failed.code, "ZeroDivisionError" in failed.err) == (3, True)


def test_known_phrases_are_understood_by_the_one_that_needs_no_model(engage: Engage, files: Path):
    pytest.importorskip("pocketsphinx", reason="pip install pocketsphinx")

    done = engage("check-recognizer", "sphinx", files, "--set", f"hearing.phrases={json.dumps(PHRASES)}")
    assert "1.wav: 'the blue one' 33% wrong" in done.out


def test_a_file_that_begins_with_the_voice_is_heard_as_after_silence(engage: Engage, tmp_path: Path):
    pytest.importorskip("pocketsphinx", reason="pip install pocketsphinx")
    write_wav(tmp_path / "1.wav", voice("how old are you"))
    (tmp_path / "1.txt").write_text("How old are you?")

    phrases = json.dumps([*PHRASES, "how old are you", "where is the pink triangle"])
    done = engage("check-recognizer", "sphinx", tmp_path, "--set", f"hearing.phrases={phrases}")

    assert "1.wav: 'how old are you' right" in done.out


def test_what_is_missing_is_told(engage: Engage, files: Path):
    (files / "1.txt").unlink()
    assert "write what is said in 1.wav into 1.txt" in engage("check-recognizer", "endpoint", files).err
    assert "nowhere: No such file or directory" in engage("check-recognizer", "endpoint", files / "nowhere").err
    assert "no recognizer 'nobody'" in engage("check-recognizer", "nobody", files / "0.wav").err
    assert engage("check-recognizer", "whisper", files / "0.wav", "--model", files).code == 2
    (files / "empty").mkdir()
    assert "there is no FILE.wav in it" in engage("check-recognizer", "sphinx", files / "empty").err
    (files / "1.txt").write_text(" ?\n")
    assert "no words" in engage("check-recognizer", "sphinx", files).err
