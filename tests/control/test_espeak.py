"""The voice `espeak`: its words are where its sound is, measured by loudness alone; holds, cuts, faults, prosody."""

import asyncio
import wave
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engage_hri.schemas.behaviors import Mark, Speech
from engage_hri.schemas.documents.prosody import Prosody, marked_up, spans
from engage_hri.schemas.faults import InputRefused
from engage_hri.schemas.text import tokens
from engage_hri.schemas.world import World
from engage_hri.services.control.bases.composed import Member, composed
from engage_hri.services.control.contract.body import Arrived, BodyFailed, MovementAuthority, Progress, Reached, Spoke
from engage_hri.services.control.testing import BodyContract
from engage_hri.services.control.torso.body import SimulatedBody
from engage_hri.services.control.voice.clauses import clause
from engage_hri.services.control.voice.espeak import EspeakSettings, EspeakSynthesizer, ssml
from engage_hri.services.control.voice.sounding import EspeakVoice
from engage_hri.services.control.voice.synthesis import Phrase
from engage_hri.services.control.voice.timeline import pieces
from tests.random_cases import trials

pytest.importorskip("espeakng_loader", reason="needs the extra `voice`")

WORLD = World(entities=())
ENGINE = EspeakSynthesizer(EspeakSettings())


class TestEspeakWithTheTorso(BodyContract):
    seeds = trials()

    def make(self):
        torso = SimulatedBody()
        parts = tuple(part for part in torso.capabilities.parts if part != "voice")
        return composed(
            [
                Member("simulated", torso, parts),
                Member("espeak", EspeakVoice(EspeakSettings(device="none")), ("voice",)),
            ]
        )


def heard(file: Path) -> list[tuple[float, float]]:
    """Stretches of a sound file that are louder than its silence, in seconds; gaps under 60 ms do not count."""
    with wave.open(str(file)) as sound:
        rate = sound.getframerate()
        samples = np.frombuffer(sound.readframes(sound.getnframes()), "<i2").astype(float)
    size = rate // 200
    levels = np.abs(samples[: len(samples) // size * size].reshape(-1, size)).max(axis=1)
    loud = np.flatnonzero(levels > 300)
    found: list[list[float]] = []
    for frame in loud.tolist():
        at = frame * size / rate
        if found and at - found[-1][1] < 0.06:
            found[-1][1] = at + size / rate
        else:
            found.append([at, at + size / rate])
    return [(since, until) for since, until in found]


async def said(voice: EspeakVoice, speech: Speech, through: str = "end", **at: float) -> list[Progress]:
    """Say a text. at: loop seconds from now for `extend`, `hold`, `go_on` or `revoke`."""
    authority = MovementAuthority(speech, through)
    loop = asyncio.get_running_loop()
    for name, seconds in at.items():
        method = getattr(authority, name)
        loop.call_later(seconds, method, *(("end",) if name == "extend" else ()))
    return [progress async for progress in voice.perform(speech, authority)]


WORDS = "Apple, moon, river, window, orange, yellow, nine, lemon, many, village."


async def test_words_are_reported_where_the_file_sounds(tmp_path: Path):
    """Each word stands alone between pauses, so that loudness tells when it begins and ends."""
    file = tmp_path / "said.wav"
    voice = EspeakVoice(EspeakSettings(file=str(file)))
    async with voice.connected():
        await asyncio.sleep(2.0)
        speech = Speech(
            id="s", text=WORDS, marks=tuple(Mark(f"m{n}", t.end - len(t.text)) for n, t in enumerate(tokens(WORDS)))
        )
        progress = await said(voice, speech)
    begun = [item.at for item in progress if isinstance(item, Reached) and item.sync.startswith("m")]
    ended = [item.at for item in progress if isinstance(item, Spoke)]
    sound = heard(file)

    assert len(sound) == len(begun) == len(ended) == 10
    assert max(abs(at - since) for at, (since, _) in zip(begun, sound, strict=True)) < 0.03
    assert max(abs(at - until) for at, (_, until) in zip(ended, sound, strict=True)) < 0.03


async def test_it_waits_between_two_words_and_says_the_rest_after(tmp_path: Path):
    file = tmp_path / "said.wav"
    voice = EspeakVoice(EspeakSettings(file=str(file)))
    async with voice.connected():
        speech = Speech(id="s", text="Move the blue square.", marks=(Mark("m", 9),))
        progress = await said(voice, speech, "start", extend=3.0)
    arrived = next(item.at for item in progress if isinstance(item, Arrived))
    first, second = heard(file)

    assert first[1] <= arrived + 0.1
    assert second[0] == pytest.approx(3.0, abs=0.06)  # the b of blue begins with a closure
    assert [item.word for item in progress if isinstance(item, Spoke)] == ["Move", "the", "blue", "square."]


async def test_a_held_voice_stands_at_the_next_word_and_goes_on(tmp_path: Path):
    file = tmp_path / "said.wav"
    voice = EspeakVoice(EspeakSettings(file=str(file)))
    async with voice.connected():
        speech = Speech(id="s", text="Many yellow lemons are lying near my window.")
        free = await said(voice, speech)
        await asyncio.sleep(1.0)
        begin = asyncio.get_running_loop().time()
        progress = await said(voice, speech, hold=0.5, go_on=4.0)
    spoken = [item.at - begin for item in progress if isinstance(item, Spoke)]
    held = max(at for at in spoken if at < 2.0)
    whole = heard(file)

    assert len(spoken) == len([item for item in free if isinstance(item, Spoke)]) == 8
    assert held < 1.2
    # Nothing is lost and nothing said twice: the sound lasts as long, around a pause from the word's end to 4 s.
    lasted = [
        sum(until - since for since, until in whole if low <= since < high)
        for low, high in ((0, begin - 0.5), (begin - 0.5, 99))
    ]
    assert lasted[0] == pytest.approx(lasted[1], abs=0.1)
    assert not [1 for since, until in whole if until > begin + held + 0.1 and since < begin + 3.99]


async def test_an_aborted_voice_ends_at_a_word(tmp_path: Path):
    file = tmp_path / "said.wav"
    voice = EspeakVoice(EspeakSettings(file=str(file)))
    async with voice.connected():
        progress = await said(voice, Speech(id="s", text="Many yellow lemons are lying near my window."), revoke=0.6)
        last = next(item.at for item in reversed(progress) if isinstance(item, Spoke))
        await asyncio.sleep(5.0)

    assert heard(file)[-1][1] <= last + 0.1
    assert last < 0.6 + 0.5


async def test_lips_close_for_closed_sounds_and_when_it_is_cut():
    voice, told = EspeakVoice(), []
    voice.on_lips = told.append
    async with voice.connected():
        await said(voice, Speech(id="s", text="Mama, papa."), revoke=0.5)

    shapes = told[0]
    assert shapes[0].opening == 0.0  # m
    assert max(shape.opening for shape in shapes) > 0.6  # a
    assert [shape.at for shape in shapes] == sorted(shape.at for shape in shapes)
    assert told[-1] == ()


async def test_what_it_cannot_say_is_refused_with_advice():
    voice = EspeakVoice()
    async with voice.connected():
        estimate = voice.estimate(Speech(id="s", text="Hello", language="xx"), None, WORLD)

    assert not estimate.feasible
    assert estimate.fault is not None
    assert "does not have the language 'xx'" in estimate.fault.reason


@pytest.mark.parametrize(
    ("setting", "reason", "advice"),
    [
        ({"variant": "zzz"}, "does not have the variant 'zzz'", "known: "),
        ({"variant": "adm"}, "does not have the variant 'adm'", "did you mean 'adam'?"),
        ({"language": "germn"}, "does not have the language 'germn'", "did you mean 'german'?"),
        ({"language": "qqq"}, "does not have the language 'qqq'", "known: "),
    ],
)
async def test_a_language_or_variant_that_is_not_there_is_refused_at_the_start(setting, reason, advice):
    voice = EspeakVoice(EspeakSettings(**setting))

    with pytest.raises(InputRefused) as refused:
        async with voice.connected():
            pass
    assert refused.value.fault.where == f"control.drivers.espeak.{next(iter(setting))}"
    assert reason in refused.value.fault.reason
    assert advice in refused.value.fault.advice


@pytest.mark.parametrize("language", ["en-gb", "EN_GB", "fr-fr", "de-AT", "hbs", "german"])
def test_a_language_by_any_of_its_names_is_taken(language: str):
    assert len(EspeakSynthesizer(EspeakSettings(language=language, variant="f2")).say(Phrase("Tram")).samples) > 1000


@pytest.mark.real_time
async def test_a_dead_device_is_a_fault_and_no_lips_move_in_silence():
    voice = EspeakVoice(EspeakSettings(device="auto", player=("sh", "-c", "head -c 30000 >/dev/null")))
    faults, lips = [], []
    voice.on_fault, voice.on_lips = faults.append, lips.append
    async with voice.connected():
        said_words: list[str] = []
        speech = Speech(id="s", text="This goes on for quite a while, and nobody will hear how it ends.")

        async def tell() -> None:
            async for progress in voice.perform(speech, MovementAuthority(speech, "end")):
                said_words.extend([progress.word] if isinstance(progress, Spoke) else [])

        with pytest.raises(BodyFailed) as failed:
            await tell()

    assert "has ended with code" in failed.value.fault.reason or "has closed" in failed.value.fault.reason
    assert failed.value.fault.advice
    assert len(faults) == 1
    assert 0 < len(said_words) < 14
    assert lips[-1] == ()


def f0(samples: bytes, rate: int) -> float:
    """Median fundamental frequency, in Hz, of the voiced frames of a sound, by autocorrelation."""
    sound = np.frombuffer(samples, "<i2").astype(float)
    size, found = int(0.04 * rate), []
    for at in range(0, len(sound) - size, size // 2):
        frame = sound[at : at + size] - sound[at : at + size].mean()
        if np.abs(frame).max() < 500:
            continue
        auto = np.correlate(frame, frame, "full")[size - 1 :]
        low, high = int(rate / 250), int(rate / 55)
        lag = low + int(np.argmax(auto[low:high]))
        if auto[lag] > 0.5 * auto[0]:
            found.append(rate / lag)
    return float(np.median(found))


def test_the_low_end_of_a_turn_is_heard():
    text = "Now you can move the yellow one over there."
    start = text.index("over")
    plain = clause(ENGINE, pieces(Speech(id="s", text=text))[0].phrase)
    low = Speech(id="s", text=text, markup=marked_up(text, (), start, len(text), pitch="x-low"))
    lowered = clause(ENGINE, pieces(low)[0].phrase)
    tails = [
        made.samples[2 * int(next(word.start for word in made.words if word.text == "over") * made.rate) :]
        for made in (plain, lowered)
    ]

    assert f0(tails[1], lowered.rate) < 0.9 * f0(tails[0], plain.rate)


def test_prosody_is_read_from_ssml():
    speech = Speech(
        id="s",
        text="Give me the blue one",
        markup='Give me <break time="500ms"/>the <prosody rate="slow" pitch="+2st">blue</prosody> '
        "<emphasis>one</emphasis>",
    )

    assert spans(speech) == (
        Prosody(start=8, end=8, pause=0.5),
        Prosody(start=12, end=16, rate=0.75, pitch=2 ** (2 / 12)),
        Prosody(start=17, end=20, emphasis="moderate"),
    )
    text, places = ssml(Phrase(speech.text, "", spans(speech)))
    assert len(places) == len(text)
    assert '<break time="500ms"/>' in text


LETTERS = "ab cde ,.!?—'1%世界，。かきゃー한국ขไม้สวัสดีПривет😊<&"


@settings(max_examples=60)
@given(
    text=st.text(st.sampled_from(list(LETTERS)), max_size=40),
    language=st.sampled_from(["en-us", "de", "zh", "ja", "th", "ru"]),
)
def test_words_cover_the_text_in_order_and_within_the_sound(text: str, language: str):
    for piece in pieces(Speech(id="s", text=text, language=language)):
        made = clause(ENGINE, piece.phrase)

        assert [word.text for word in made.words] == [token.text for token in tokens(piece.phrase.text)]
        assert [word.position for word in made.words] == [token.end for token in tokens(piece.phrase.text)]
        edges = [edge for word in made.words for edge in (word.start, word.end)]
        assert edges == sorted(edges)
        assert not edges or 0.0 <= edges[0] <= edges[-1] <= made.seconds + 1e-6


def test_a_long_text_is_cut_into_phrases_that_are_all_of_it():
    text = "This is sentence number one of many. Dr. Smith says, e.g. that this is so. " * 30
    found = pieces(Speech(id="s", text=text))

    assert "".join(piece.text for piece in found) == text
    assert max(len(piece.text) for piece in found) < 500
    assert not any(piece.text.rstrip().endswith("Dr.") for piece in found)
