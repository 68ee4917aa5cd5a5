"""What becomes of a speech whose sound is lost: on a device that stops, in a file without room, at an abort."""

import asyncio
import os
import wave
from collections.abc import Callable, Sequence
from itertools import pairwise
from math import inf
from pathlib import Path
from typing import ClassVar, NamedTuple

import numpy as np
import pytest

from engage_hri.schemas.behaviors import Speech
from engage_hri.schemas.body_faults import BodyFault
from engage_hri.schemas.faults import Fault, InputRefused, RunFailed
from engage_hri.schemas.world import World
from engage_hri.services.control.bases.composed import Member, composed
from engage_hri.services.control.contract.body import (
    BehaviorRefused,
    BodyFailed,
    MouthShape,
    MovementAuthority,
    Progress,
    Reached,
    Spoke,
)
from engage_hri.services.control.testing import Stage
from engage_hri.services.control.torso.body import SimulatedBody
from engage_hri.services.control.voice import player
from engage_hri.services.control.voice.clauses import clause
from engage_hri.services.control.voice.outlets import STUCK, Outlet, Several, WavFile
from engage_hri.services.control.voice.silent import SilentVoice
from engage_hri.services.control.voice.sounding import SoundingVoice
from engage_hri.services.control.voice.speaking import CHECK, sounding, utter_parts
from engage_hri.services.control.voice.synthesis import Heard, Phrase, Said, Synthesizer, VoiceSettings
from engage_hri.services.control.voice.timeline import pieces

FULL = pytest.mark.skipif(not os.path.exists("/dev/full"), reason="there is no /dev/full here")


class Tones(Synthesizer):
    """Each letter of a word is a tone of 50 ms, each space silence as long."""

    rate = 16000

    def say(self, phrase: Phrase) -> Said:
        letter, space = [0.5, -0.5] * 400, [0.0] * 800
        begins = [at for at, each in enumerate(phrase.text) if each != " " and phrase.text[at - 1 : at] in ("", " ")]
        samples = [level for each in phrase.text for level in (space if each == " " else letter)]
        return Said(samples, [Heard(at, 0.05 * at) for at in begins])


class Voice(SoundingVoice):
    name, synthesizer, Settings = "tones", Tones, VoiceSettings


def listening(voice: Voice) -> list[Fault]:
    faults: list[Fault] = []
    voice.on_fault = faults.append
    return faults


def file_of(voice: Voice) -> WavFile:
    return next(each for each in voice._outlet.outlets if isinstance(each, WavFile))


async def said(voice: Voice, text: str) -> list[str]:
    speech = Speech(id="s", text=text)
    progress = [each async for each in voice.perform(speech, MovementAuthority(speech, "end"))]
    return [each.word for each in progress if isinstance(each, Spoke)]


@FULL
async def test_a_file_without_room_is_told_once_and_the_loudspeaker_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    voice = Voice(VoiceSettings(file="/dev/full"))
    faults = listening(voice)
    async with voice.connected():
        now = asyncio.get_running_loop().time
        monkeypatch.setattr(voice, "_outlet", Several(now, Outlet(now), file_of(voice)))
        for _ in range(2):
            assert await said(voice, "one two") == ["one", "two"]

    assert [(each.where, each.reason) for each in faults] == [
        ("/dev/full", "the sound file /dev/full: No space left on device")
    ]


@FULL
async def test_a_speech_that_only_a_file_without_room_takes_fails() -> None:
    voice = Voice(VoiceSettings(file="/dev/full"))
    faults = listening(voice)
    async with voice.connected():
        for _ in range(2):
            with pytest.raises(BodyFailed, match="s: the sound file /dev/full: No space left"):
                await said(voice, "one two")

    assert [each.where for each in faults] == ["/dev/full"]


async def test_a_file_that_has_room_again_takes_sound_again(tmp_path: Path) -> None:
    voice = Voice(VoiceSettings(file=str(tmp_path / "said.wav")))
    faults = listening(voice)
    async with voice.connected():
        for _ in range(2):
            file_of(voice)._fail("No space left on device", "is the disk full?")
            assert await said(voice, "one two") == ["one", "two"]

    assert len(faults) == 2
    assert (tmp_path / "said.wav").stat().st_size > 2 * 0.6 * 16000


class Taker:
    """A player program in virtual time: takes sound as it plays it, with a little in its own buffer."""

    made: ClassVar[list["Taker"]] = []
    stops: ClassVar[tuple[float, float]] = (inf, inf)
    """From when until when it takes and plays nothing."""
    KEPT = 1600
    """Bytes in its buffer: 50 ms."""

    def __init__(self, command: Sequence[str], pipe: int, on_end: Callable[[], None]) -> None:
        self._loop = asyncio.get_running_loop()
        self._queue = self._kept = self.played = 0
        self._at = self._loop.time()
        self.killed_at: float | None = None
        self.is_dead = False
        self.made.append(self)

    def _go_on(self) -> None:
        now, (stops, goes_on) = self._loop.time(), self.stops
        seconds = max(0.0, min(now, stops) - self._at) + max(0.0, now - max(self._at, goes_on))
        self._at = now
        played = min(self._queue + self._kept, 2 * round(16000 * seconds))
        self.played += played
        whole = self._queue + self._kept - played
        if not stops <= now < goes_on:
            self._kept = min(self.KEPT, whole)
        else:
            self._kept = min(self._kept, whole)
        self._queue = whole - self._kept

    @property
    def untaken(self) -> int:
        self._go_on()
        return self._queue

    def write(self, content: bytes) -> None:
        self._go_on()
        self._queue += len(content)

    def kill(self) -> None:
        self._go_on()
        self.killed_at, self.is_dead = self._loop.time(), True


@pytest.fixture
def takers(monkeypatch: pytest.MonkeyPatch) -> list[Taker]:
    made: list[Taker] = []
    monkeypatch.setattr(player, "FedProcess", Taker)
    monkeypatch.setattr(Taker, "made", made)
    return made


TEXT = "one two three four five six seven"
"""As `Tones` says it words begin at 0, 0.2, 0.4, 0.7, 0.95, 1.2 and 1.4 s, 50 ms after the one before."""
ENDS = [0.15, 0.35, 0.65, 0.9, 1.15, 1.35, 1.65]


class Course(NamedTuple):
    """What became of a speech. Times are seconds from its `start`. moved: the last instant at which lips moved."""

    words: list[float]
    points: list[str]
    moved: float
    failed: str
    ended: float


async def course(
    outlet: Outlet, text: str = TEXT, abort: float = inf, stops: tuple[float, float] = (inf, inf)
) -> Course:
    loop = asyncio.get_running_loop()
    speech = Speech(id="s", text=text)
    authority = MovementAuthority(speech, "end")
    told: list[Progress] = []
    lips: list[tuple[float, Sequence[MouthShape]]] = []
    begin = outlet.earliest()
    Taker.stops = begin + stops[0], begin + stops[1]
    piece = pieces(speech)[0]
    part = sounding(piece, clause(Tones(), piece.phrase))
    if abort < inf:
        loop.call_at(begin + abort, authority.revoke)
    failed = ""
    try:
        async for each in utter_parts(
            speech, authority, lambda number: part, outlet, lambda shapes: lips.append((loop.time(), shapes))
        ):
            told.append(each)
    except BodyFailed as error:
        failed = error.fault.reason
    ended = loop.time()
    moved = [
        shape.at
        for (since, shapes), (until, _) in pairwise([*lips, (ended, ())])
        for shape in shapes
        if since <= shape.at < until and shape.opening > 0.02
    ]
    return Course(
        [each.at - begin for each in told if isinstance(each, Spoke)],
        [each.sync for each in told if isinstance(each, Reached)],
        max(moved, default=begin) - begin,
        failed,
        ended - begin,
    )


async def ready() -> player.Player:
    device = player.Player(player.PlayerProgram(("a player",), 0.0), Tones.rate)
    await device.ready()
    await asyncio.sleep(5.0)
    return device


async def test_words_are_told_as_a_device_takes_their_sound(takers: list[Taker]) -> None:
    found = await course(await ready())

    assert found.words == pytest.approx(ENDS, abs=0.006)
    assert found.points == ["start", "end"]
    assert not found.failed


@pytest.mark.parametrize("at", [0.0, 0.3, 0.5, 0.77, 1.1, 1.3])
async def test_a_device_that_stops_stops_words_and_lips_and_is_a_fault(takers: list[Taker], at: float) -> None:
    found = await course(await ready(), stops=(at, inf))

    kept = Taker.KEPT / 2 / Tones.rate
    assert found.failed == "the sound device has taken no sound for 0.8 s"
    assert found.points == ["start"]
    assert len(found.words) <= sum(end <= at + kept + player.LATE + 0.006 for end in ENDS)
    assert found.moved <= at + kept + player.LATE + 2 * CHECK + 1e-6
    assert found.ended <= at + kept + player.LATE + STUCK + 2 * CHECK


async def test_a_short_speech_is_not_done_before_the_device_has_taken_it(takers: list[Taker]) -> None:
    found = await course(await ready(), "yes", stops=(-0.1, inf))

    assert (found.words, found.points) == ([], ["start"]) or (found.words, found.points) == ([], [])
    assert found.failed


async def test_words_and_lips_wait_for_a_device_that_stops_for_a_moment(takers: list[Taker]) -> None:
    found = await course(await ready(), stops=(0.5, 0.9))

    assert found.points == ["start", "end"]
    assert found.words[:2] == pytest.approx(ENDS[:2], abs=0.006)
    kept = Taker.KEPT / 2 / Tones.rate
    assert found.words[2:] == pytest.approx([end + 0.4 - kept for end in ENDS[2:]], abs=0.03)
    assert takers[0].played / 2 / Tones.rate >= 1.65


@pytest.mark.parametrize("at", [0.05, 0.32, 0.34, 0.37, 0.6, 0.8, 0.86, 1.34, 1.6])
async def test_an_abort_takes_back_what_was_handed_over_after_the_word(
    takers: list[Taker], at: float, tmp_path: Path
) -> None:
    loop = asyncio.get_running_loop()
    with open(tmp_path / "said.wav", "wb", buffering=0) as file:  # noqa: ASYNC230
        device = await ready()
        begin = loop.time()
        found = await course(
            Several(loop.time, device, WavFile(file, "said.wav", Tones.rate, begin, loop.time)), abort=at
        )
        last = next(
            (end for end, start in zip(ENDS, [0.0, *(end + 0.05 for end in ENDS)], strict=False) if start < at < end),
            at,
        )
        lead, first = device.lead, takers[0]
        await asyncio.sleep(1.0)

    assert found.words == pytest.approx([end for end in ENDS if end <= last], abs=0.006)
    assert found.ended == pytest.approx(last, abs=0.006)
    assert not found.failed
    with wave.open(str(tmp_path / "said.wav")) as sound:
        samples = np.frombuffer(sound.readframes(sound.getnframes()), "<i2")
    assert np.flatnonzero(np.abs(samples) > 100)[-1] / Tones.rate == pytest.approx(
        lead + max([end for end in ENDS if end <= last], default=0.0), abs=0.01
    )
    assert (first.killed_at is not None) == any(at < end + 0.05 <= at + lead for end in ENDS[:-1])  # handed over
    if first.killed_at is not None:
        assert first.killed_at == pytest.approx(begin + lead + last, abs=0.006)
        assert len(takers) == 2
    assert takers[-1].killed_at is None


async def test_an_aborted_speech_does_not_wait_for_a_device_that_has_stopped(takers: list[Taker]) -> None:
    found = await course(await ready(), abort=0.8, stops=(0.5, inf))

    assert not found.failed
    assert found.words == pytest.approx(ENDS[:2], abs=0.006)
    assert found.ended == pytest.approx(0.8, abs=0.006)


@pytest.mark.real_time
async def test_a_player_that_stops_on_purpose_fails_the_speech_and_the_next_one_is_heard(tmp_path: Path) -> None:
    """The first time it is started it takes no more after 0.3 s of sound; it is ended with what it has started."""
    program = f"mkdir {tmp_path}/first 2>/dev/null && {{ head -c 9600; sleep 1000; }}; exec cat"
    voice = Voice(VoiceSettings(player=("sh", "-c", f"{{ {program}; }} >/dev/null")))
    faults = listening(voice)
    async with voice.connected():
        with pytest.raises(BodyFailed, match="has taken no sound for"):
            await said(voice, TEXT)
        assert await said(voice, "one two") == ["one", "two"]

    assert [each.where for each in faults] == ["sound device"]


@pytest.mark.real_time
async def test_the_last_words_of_a_player_are_in_the_fault_and_not_on_the_terminal(
    capfd: pytest.CaptureFixture[str],
) -> None:
    noise = "for n in 1 2 3 4 5 6 7 8 9; do echo underrun $n >&2; done; echo audio open error >&2; exit 1"
    voice = Voice(VoiceSettings(player=("sh", "-c", noise)))
    with pytest.raises(RunFailed) as failed:
        async with voice.connected():
            pass

    assert failed.value.fault.reason.endswith(": audio open error")
    assert "underrun" not in capfd.readouterr().err


@pytest.mark.parametrize("is_new", [True, False])
def test_a_pw_cat_without_raw_sound_is_not_taken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_new: bool
) -> None:
    program = tmp_path / "pw-cat"
    program.write_text(f"#!/bin/sh\necho '--playback {'--raw' if is_new else ''}'\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    if is_new:
        assert player.found(VoiceSettings()) == player.PLAYERS["pw-cat"]
    else:
        with pytest.raises(InputRefused, match="no option --raw, it is too old"):
            player.found(VoiceSettings())


def test_without_any_player_there_is_no_device_unless_one_was_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))

    assert player.found(VoiceSettings()) is None
    with pytest.raises(InputRefused, match="no program here plays sound: tried aplay"):
        player.found(VoiceSettings(device="aplay"))


async def test_a_voice_that_is_made_mute_says_no_more_and_fails() -> None:
    voice = Voice()
    loop, lips = asyncio.get_running_loop(), list[tuple[float, Sequence[MouthShape]]]()
    voice.on_lips = lambda shapes: lips.append((loop.time(), shapes))
    speech, words = Speech(id="s", text=TEXT), list[str]()

    async def tell() -> None:
        async for each in voice.perform(speech, MovementAuthority(speech, "end")):
            words.extend([each.word] if isinstance(each, Spoke) else [])

    async with voice.connected():
        begin = loop.time()
        loop.call_later(0.5, voice.switch_faults, [BodyFault(kind="mute")])
        with pytest.raises(BodyFailed, match="s: the device is silent: no sound is taken"):
            await tell()
        assert loop.time() - begin == pytest.approx(0.5 + STUCK, abs=2 * CHECK)
        with pytest.raises(BodyFailed, match="the device is silent"):
            await said(voice, TEXT)
        voice.switch_faults([])
        assert await said(voice, "one two") == ["one", "two"]

    assert words == ["one", "two"]
    assert next(at for at, shapes in lips if not shapes) - begin <= 0.5 + 2 * CHECK + 1e-6


async def test_a_voice_that_knows_that_it_is_mute_refuses() -> None:
    voice = Voice()
    async with voice.connected():
        asyncio.get_running_loop().call_later(0.5, voice.switch_faults, [BodyFault(kind="voiceless")])
        with pytest.raises(BodyFailed, match="s: the voice cannot speak"):
            await said(voice, TEXT)
        with pytest.raises(BehaviorRefused, match="s: the voice cannot speak"):
            await said(voice, TEXT)
        assert not voice.estimate(Speech(id="s", text=TEXT), None, World(entities=())).feasible
        with pytest.raises(InputRefused, match="cannot play 'stall'"):
            voice.switch_faults([BodyFault(kind="stall")])


@pytest.mark.parametrize("voice", [Voice, SilentVoice])
async def test_the_lips_of_a_face_move_with_words_that_are_heard(voice: type[Voice | SilentVoice]) -> None:
    torso = SimulatedBody()
    parts = tuple(part for part in torso.capabilities.parts if part != "voice")
    body = composed([Member("simulated", torso, parts), Member("other", voice(), ("voice",))])
    async with body.connected():
        stage, jaws = Stage(body, Speech(id="s", text="one, two, three"), "end"), list[float]()
        while not stage.task.done():
            jaws.append(body.idle().added.get("jaw", 0.0))
            await asyncio.sleep(0.01)
        await stage.over()

    assert (max(jaws) > 0.3) == (voice is Voice)
    assert any(isinstance(each, Spoke) for each in stage.progress)


@pytest.mark.parametrize("has_failed", [False, True])
def test_a_cut_behind_the_end_of_a_file_and_one_of_a_file_that_failed_change_nothing(
    tmp_path: Path, has_failed: bool
) -> None:
    said, tail, path = bytes(range(200)), b"\x01\x02", tmp_path / "said.wav"
    with path.open("wb", buffering=0) as file:
        outlet = WavFile(file, "said.wav", 1000, 0.0, lambda: 0.0)
        outlet.play(said, 0.0)
        before = path.read_bytes()
        if has_failed:
            outlet._fault = Fault(reason="the file is full")
        outlet.cut(0.05 if has_failed else 0.2, tail)
        assert path.read_bytes() == before

        outlet.revive()
        outlet.cut(0.05, tail)
        with wave.open(str(path)) as sound:
            assert sound.readframes(sound.getnframes()) == said[:98] + tail
