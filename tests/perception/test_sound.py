"""Sound as numbers: files, rates, and when samples of a device were captured."""

import io
import os
import random
import wave

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from engage_hri.schemas.faults import InputRefused
from engage_hri.services.perception.hearing.microphone import read_file
from engage_hri.services.perception.hearing.sound import FOR, SampleClock, read_wav, resampled
from engage_hri.services.perception.hearing.voice import RATE
from tests.perception.spoken import write_wav


def tone(hertz: float, rate: int) -> np.ndarray:
    return (8000 * np.sin(2 * np.pi * hertz * np.arange(rate) / rate)).astype(np.int16)


@pytest.mark.parametrize("rate", [8000, 11025, 22050, 44100, 48000])
def test_a_tone_of_any_rate_is_the_same_tone(rate: int):
    inner = slice(RATE // 10, -RATE // 10)
    assert np.abs(resampled(tone(440, rate), rate)[inner] - tone(440, RATE)[inner].astype(float)).max() < 80
    assert len(resampled(tone(440, rate), rate)) == RATE


def test_what_is_too_high_for_the_rate_is_gone():
    assert np.abs(resampled(tone(11000, 48000), 48000)[1000:-1000]).max() < 80


def test_channels_of_a_file_stay_apart(tmp_path):
    path = write_wav(tmp_path / "two.wav", tone(440, RATE), tone(700, RATE))

    with path.open("rb") as file:
        samples = read_wav(file, "two.wav")
    assert np.array_equal(samples, np.column_stack([tone(440, RATE), tone(700, RATE)]))


def test_what_is_no_wav_file_of_16_bits_is_refused_with_what_to_do():
    for content, reason in ((b"", "ends too early"), (b"RIFF0000WAVEfmt ", "chunk missing"), (b"ID3" * 99, "RIFF")):
        with pytest.raises(InputRefused, match=reason) as refused:
            read_wav(io.BytesIO(content), "a.wav")
        assert "ffmpeg" in refused.value.fault.advice
    with pytest.raises(InputRefused, match="8 bits, not 16"):
        read_wav(io.BytesIO(written(width=1)), "a.wav")
    whole = written()
    with pytest.raises(InputRefused, match="no WAV file that can be read"):
        read_wav(io.BytesIO(whole[:17] + b"r" + whole[18:]), "a.wav")  # its head is longer than the file
    with pytest.raises(InputRefused, match="there is no sound in it"):
        read_wav(io.BytesIO(whole[:40] + bytes(4)), "a.wav")


def test_a_pipe_is_refused_for_who_opens_it_may_wait_for_ever(tmp_path):
    os.mkfifo(tmp_path / "pipe.wav")
    with pytest.raises(InputRefused, match=r"pipe\.wav: it is no file"):
        read_file(tmp_path / "pipe.wav", 1)


def test_a_file_that_ends_before_its_end_is_refused_unless_nobody_knew_where_that_would_be():
    whole = written()
    with pytest.raises(InputRefused, match=r"it ends after .* s, and says that it has .* s of sound") as refused:
        read_wav(io.BytesIO(whole[:-20]), "a.wav")
    assert "ffmpeg" in refused.value.fault.advice
    for length in (2**32 - 1, 2**31, 2**31 - 1):
        piped = whole[:40] + length.to_bytes(4, "little") + whole[44:]
        assert np.array_equal(read_wav(io.BytesIO(piped), "a.wav"), read_wav(io.BytesIO(whole), "a.wav"))


@pytest.mark.parametrize("rate", [0, 1, 4_000_000_000])
def test_a_file_with_a_rate_that_no_sound_has_is_refused(rate: int):
    whole = written()
    damaged = whole[:24] + rate.to_bytes(4, "little") + whole[28:]
    with pytest.raises(InputRefused, match=f"says that it has {rate} samples per second: expected 4000 to 192000"):
        read_wav(io.BytesIO(damaged), "a.wav")


def written(width: int = 2) -> bytes:
    file = io.BytesIO()
    with wave.open(file, "wb") as written:
        written.setnchannels(1)
        written.setsampwidth(width)
        written.setframerate(8000)
        written.writeframes(bytes(100))
    return file.getvalue()


@given(st.integers(0, 999), st.floats(-1e-4, 1e-4))
def test_samples_were_captured_when_the_device_had_them_however_late_they_come(seed: int, drift: float):
    """Pieces of 20 ms are on their way for 5 ms and more, and once for 400."""
    chance, clock, count = random.Random(seed), SampleClock(), 320
    errors, arrived, still = [], 0.0, chance.randrange(300, 3000)
    for number in range(3000):
        captured = 100.0 + number * count / RATE * (1 + drift)
        way = 0.4 if number == still else min(0.09, chance.expovariate(50))
        arrived = max(arrived, captured + count / RATE + 0.005 + way)
        errors.append(clock.take(count, arrived) - captured)
    assert max(map(abs, errors[200:])) < 0.025


def test_where_samples_are_lost_those_after_them_are_later():
    clock = SampleClock()
    for number in range(50):
        assert clock.take(320, 10.02 + number * 0.02) == pytest.approx(10.0 + number * 0.02)
    lost = 0.3
    told = [clock.take(320, 10.02 + number * 0.02 + lost) - (10.0 + number * 0.02) for number in range(50, 100)]
    assert told[-1] == pytest.approx(lost)
    assert sum(late < lost / 2 for late in told) * 0.02 <= FOR + 0.04
