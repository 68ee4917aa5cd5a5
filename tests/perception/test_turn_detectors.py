"""Detectors of turns: what they hear, what is told of it, and Smart Turn with its model, where that lies."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from engage_hri.schemas.faults import InputRefused
from engage_hri.schemas.perception import Utterance
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.perception.hearing.config import HearingConfig
from engage_hri.services.perception.hearing.listening import DetectorOrder
from engage_hri.services.perception.hearing.smart_turn import BANDS, HOP, WINDOW, spectra
from engage_hri.services.perception.hearing.turn_detectors import (
    HEARD,
    WITHIN_TURN,
    TurnDetector,
    TurnDetectorSettings,
    TurnSound,
)
from engage_hri.services.perception.hearing.voice import RATE, Samples
from engage_hri.services.runtime.parcels import TURN_MODEL
from tests.perception.eyes.fetched import MISSING, TURNS
from tests.perception.spoken import placed, voice, write_wav
from tests.perception.test_hearing import hearing, sphinx

SETTINGS = TurnDetectorSettings(language="en", model="", folder="nowhere")


class ByLength(TurnDetector):
    """Takes what is longer than two seconds for finished."""

    def finished(self, samples: Samples) -> float:
        return 0.9 if len(samples) > 2.0 * RATE else 0.1


class Failing(TurnDetector):
    def finished(self, samples: Samples) -> float:
        raise ValueError("no turn like any")


@pytest.fixture
def offered(install) -> None:  # type: ignore[no-untyped-def]
    text = "from tests.perception.test_turn_detectors import ByLength, Failing\n"
    entries = "[engage.turn_detectors]\nacme = acme_turns:ByLength\nfailing = acme_turns:Failing\n"
    install("acme-turns", entries, acme_turns=text)


def said(parts: Sequence[tuple[float, str]], length: float) -> Samples:
    return placed([(at, voice(text)) for at, text in parts], length)


async def test_it_is_told_with_the_words_how_sure_it_is_that_the_person_has_finished(
    hub: MemoryHub,
    tmp_path: Path,
    offered: None,
):
    path = write_wav(tmp_path / "said.wav", said([(1.0, "yes"), (5.0, "move the purple triangle to the top")], 9.0))

    async with hearing(hub, source=str(path), turn_detector="acme", **sphinx()) as heard:
        await heard.over.wait()

    last = {each.id: each for each in heard.of(Utterance)}.values()
    assert [(each.text, each.final, each.finished) for each in last] == [
        ("yes", True, 0.1), ("move the purple triangle to the top", True, 0.9)
    ]  # fmt: skip
    before = [each for each in heard.of(Utterance) if each.finished is None]
    assert {each.id for each in before} == {each.id for each in last}


async def test_a_pause_is_part_of_the_turn_of_which_it_gets_the_sound(
    hub: MemoryHub,
    tmp_path: Path,
    offered: None,
):
    path = write_wav(tmp_path / "said.wav", said([(1.0, "the blue one"), (2.6, "is this right")], 6.0))

    async with hearing(hub, source=str(path), turn_detector="acme", **sphinx()) as heard:
        await heard.over.wait()

    last = {each.id: each for each in heard.of(Utterance)}.values()
    assert [(each.text, each.finished) for each in last] == [("the blue one", 0.1), ("is this right", 0.9)]


async def test_one_that_fails_is_told_and_words_come_as_without_it(
    hub: MemoryHub,
    tmp_path: Path,
    offered: None,
):
    path = write_wav(tmp_path / "said.wav", said([(1.0, "yes")], 3.0))

    async with hearing(hub, source=str(path), turn_detector="failing", **sphinx()) as heard:
        await heard.over.wait()

    *_, last = heard.of(Utterance)
    assert (last.text, last.final, last.finished) == ("yes", True, None)
    assert any("the turn detector fails: ValueError: no turn like any" in str(each) for each in heard.told)


def test_the_sound_of_a_turn_is_bounded_and_ends_with_the_turn():
    turn = TurnSound()
    pieces = [np.full(RATE, number, np.int16) for number in range(12)]
    turn.begin(0.0)
    for piece in pieces:
        turn.hear(piece)
    whole = turn.end(12.0)
    assert np.array_equal(whole, np.concatenate(pieces[-round(HEARD) :]))

    turn.begin(12.0 + WITHIN_TURN)
    turn.hear(pieces[1])
    assert np.array_equal(turn.end(15.0), np.concatenate([*pieces[5:], pieces[1]]))
    turn.begin(15.1 + WITHIN_TURN)
    assert len(turn.end(18.0)) == 0


def test_a_detector_wants_a_recognizer():
    with pytest.raises(ValueError, match="wants a `recognizer`"):
        HearingConfig(turn_detector="smart-turn")


def test_what_is_missing_is_told_with_what_to_do():
    with pytest.raises(InputRefused) as refused:
        DetectorOrder("smart-turn", SETTINGS).made()
    assert refused.value.fault.advice
    with pytest.raises(InputRefused, match=r"no turn detector 'smart'"):
        DetectorOrder("smart", SETTINGS).made()


def _spectra_by_definition(samples: Samples) -> np.ndarray:
    """The same from the definition, one frame and one band after the other."""
    sound = np.concatenate([np.zeros(max(0, 8 * RATE - len(samples))), samples[-8 * RATE :] / 32768.0])
    sound = (sound - np.mean(sound)) / np.sqrt(np.mean((sound - np.mean(sound)) ** 2) + 1e-7)
    mirrored = np.concatenate([sound[200:0:-1], sound, sound[-2:-202:-1]])

    def hertz(mel: float) -> float:
        return mel * 200.0 / 3.0 if mel < 15.0 else 1000.0 * 6.4 ** ((mel - 15.0) / 27.0)

    top = 15.0 + 27.0 * np.log(8.0) / np.log(6.4)
    edges = [hertz(top * number / 81) for number in range(82)]
    found = np.zeros((BANDS, 800))
    for frame in range(0, 800, 53):
        cut = mirrored[frame * HOP : frame * HOP + WINDOW]
        turned = [cut[n] * (0.5 - 0.5 * np.cos(2 * np.pi * n / WINDOW)) for n in range(WINDOW)]
        power = np.abs(np.fft.fft(turned)) ** 2
        for band in range(BANDS):
            low, middle, high = edges[band : band + 3]
            total = 0.0
            for k in range(WINDOW // 2 + 1):
                at = k * RATE / WINDOW
                rises, falls = (at - low) / (middle - low), (high - at) / (high - middle)
                total += power[k] * max(0.0, min(rises, falls)) * 2.0 / (high - low)
            found[band, frame] = np.log10(max(total, 1e-10))
    return found


@pytest.mark.parametrize("length", [300, 40_000, 150_000])
def test_spectra_are_those_of_the_definition(length: int):
    samples = (np.random.default_rng(length).standard_normal(length) * 3000).astype(np.int16)

    fast, slow = spectra(samples), _spectra_by_definition(samples)

    assert (fast.shape, fast.dtype) == ((80, 800), np.float32)
    frames = range(0, 800, 53)
    # The floor is that of the loudest of all frames, of which only some are computed: those below it tell nothing.
    floor = fast.min()
    for frame in frames:
        above = fast[:, frame] > floor + 1e-4
        assert fast[above, frame] == pytest.approx((slow[above, frame] + 4.0) / 4.0, abs=1e-4)
        assert above.any() or length < 8 * RATE


def test_smart_turn_hears_who_searches_for_a_word():
    pytest.importorskip("onnxruntime", reason="needs the extra `smart-turn`")
    if not (TURNS / TURN_MODEL.names()[0]).is_file():
        pytest.skip(MISSING)
    detector = DetectorOrder("smart-turn", replace(SETTINGS, folder=str(TURNS))).made()

    def finished(text: str) -> float:
        listening = detector.listen()
        listening.hear(np.concatenate([voice(text), np.zeros(round(0.3 * RATE), np.int16)]))
        return listening.end().confidence

    # eSpeak NG ends whatever it says as if it were done, so it tells no more than this. The model computes in 8 bits,
    # and its answer to shorter questions is 0.06 on one processor and above 0.5 on another.
    assert finished("well, um") < 0.5 < finished("Where is the cup?")
