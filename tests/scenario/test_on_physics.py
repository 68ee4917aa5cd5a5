"""The tangram with the torso in MuJoCo and the voice of eSpeak NG: the same events, and words where they sound.

The film of it: `engage demo --virtual-time --body mujoco --voice espeak --set control.drivers.mujoco.film=FILE.png`.
"""

import wave
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

pytest.importorskip("mujoco", reason="needs the extra `mujoco`")
pytest.importorskip("espeakng_loader", reason="needs the extra `voice`")

from engage_hri.schemas.blocks import SyncPointProgress, WarningFeedback
from engage_hri.schemas.body import WordSpoken
from engage_hri.schemas.faults import Fault
from engage_hri.services.control.config import ControlConfig
from engage_hri.services.runtime.virtual_time import run_virtual
from tests.recogniser import Recogniser
from tests.scenario.playing import Record, play
from tests.scenario.test_appendix_b import EXPECTED, PERSON_LOOKS, ROBOT_LOOKS, by_step, looks, played

LATER = 0.5
"""Seconds by which a delay of a connection event may differ: people answer words, and these are others' words."""
PAUSE = 0.06
"""Seconds without sound inside of a word, as before a plosive."""
LOUD = 300
Words = dict[tuple[str, str], list[tuple[str, float]]]


@pytest.fixture(scope="module")
def heard(tmp_path_factory: pytest.TempPathFactory) -> tuple[Record, NDArray[np.float64], int]:
    """What happened, and the sound: samples, and how many of them a second has."""
    file = tmp_path_factory.mktemp("sound") / "said.wav"
    drivers = {"espeak": {"file": str(file)}}
    record = run_virtual(play(control=ControlConfig(body="mujoco", voice="espeak", drivers=drivers)))
    with wave.open(str(file)) as sound:
        return record, np.frombuffer(sound.readframes(sound.getnframes()), "<i2").astype(float), sound.getframerate()


def spoken(record: Record) -> Words:
    """The words of each speech, with the time at which each had been said."""
    found: Words = {}
    for each in record.messages(WordSpoken):
        found.setdefault((each.block, each.behavior), []).append((each.word, each.at.seconds))
    return found


def begun(record: Record) -> dict[tuple[str, str], float]:
    points = (each for each in record.messages(SyncPointProgress) if each.sync == "start")
    return {(each.block, each.behavior): getattr(each.at, "seconds", each.at) for each in points}


def test_the_events_are_those_of_the_transcript(heard: Any) -> None:
    record = heard[0]

    assert by_step(record) == EXPECTED["table"]
    assert (looks(record, "human"), looks(record, "robot")) == (PERSON_LOOKS, ROBOT_LOOKS)
    assert [*record.messages(WarningFeedback), *record.messages(Fault)] == []


def test_events_words_and_delays_are_as_with_the_torso_without_physics(heard: Any) -> None:
    record, plain = heard[0], played()
    here, there = record.robot_initiated(), plain.robot_initiated()

    assert [(it.kind, it.block, it.objects, it.state) for it in here] == [
        (it.kind, it.block, it.objects, it.state) for it in there
    ]
    assert len(here) == 62
    apart = [one.delay - other.delay for one, other in zip(here, there, strict=True) if one.delay and other.delay]
    assert max(map(abs, apart)) < LATER
    words = [[word for word, _ in said] for said in spoken(record).values()]
    assert words == [[word for word, _ in said] for said in spoken(plain).values()]


def test_each_word_sounds_before_it_is_told_and_nothing_sounds_between_speeches(heard: Any) -> None:
    record, sound, rate = heard
    loud = np.abs(sound) > LOUD
    starts, is_speech = begun(record), np.zeros(len(sound), dtype=bool)
    for key, said in spoken(record).items():
        since = starts[key]
        for word, at in said:
            share = loud[int(since * rate) : int(at * rate)].mean()
            assert share > 0.1, (key, word)
            since = at
        is_speech[max(0, int((starts[key] - PAUSE) * rate)) : int((said[-1][1] + PAUSE) * rate)] = True

    assert not loud[~is_speech].any()


def test_words_end_where_a_recogniser_hears_their_ends(heard: Any) -> None:
    """PocketSphinx, by forced alignment. It gives up on longer texts of this voice, and on words it does not know."""
    recogniser = Recogniser()
    record, sound, rate = heard
    starts, errors = begun(record), list[float]()
    for key, said in spoken(record).items():
        since, until = starts[key] - 0.03, said[-1][1] + 0.03
        found = recogniser.aligned(sound, rate, since, until, [word for word, _ in said])
        if len(found) == len(said):
            errors += [abs(at - end) for (_, at), (_, end) in zip(said, found, strict=True)]

    assert len(errors) > 80
    assert np.median(errors) < 0.03
    assert np.quantile(errors, 0.95) < 0.1
    assert max(errors) < 0.15
