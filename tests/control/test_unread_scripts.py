"""Scripts that eSpeak NG does not read: the table against the engine that is here, and the warning of a speech."""

import asyncio
import ctypes
import re

import pytest

from engage_hri.schemas.behaviors import Speech
from engage_hri.schemas.documents.prosody import Prosody
from engage_hri.schemas.world import World
from engage_hri.services.control.contract.body import MovementAuthority, Reached
from engage_hri.services.control.voice.espeak import EspeakSettings, EspeakSynthesizer
from engage_hri.services.control.voice.espeak_voices import voices
from engage_hri.services.control.voice.scripts import READ_IN, UNREAD_IN, Unread, is_read, told, unread
from engage_hri.services.control.voice.sounding import EspeakVoice

TAG = re.compile(r"[a-z]{2,3}(-.*)?$")
WORLD = World(entities=())
WORDS = {
    "LATIN": "hello", "CYRILLIC": "привет", "GREEK": "καλημέρα", "ARABIC": "مرحبا", "HEBREW": "שלום", "THAI": "สวัสดี",
    "LAO": "ສະບາຍດີ", "MYANMAR": "မင်္ဂလာပါ", "KHMER": "សួស្តី", "TIBETAN": "བཀྲ་ཤིས", "ETHIOPIC": "ሰላም",
    "MONGOLIAN": "ᠮᠣᠩᠭᠣᠯ", "THAANA": "ދިވެހި", "SYRIAC": "ܫܠܡܐ", "TELUGU": "నమస్తే", "ORIYA": "ନମସ୍କାର", "CJK": "你好世界",
    "HIRAGANA": "こんにちは", "KATAKANA": "カタカナ", "GEORGIAN": "გამარჯობა", "DEVANAGARI": "नमस्ते",
    "BENGALI": "নমস্কার",
    "GURMUKHI": "ਸਤਿ", "GUJARATI": "નમસ્તે", "TAMIL": "வணக்கம்", "KANNADA": "ನಮಸ್ತೆ", "MALAYALAM": "നമസ്കാരം",
    "SINHALA": "ආයුබෝවන්", "HANGUL": "안녕하세요",
}  # fmt: skip
"""A word of each script: `hello`, or one as usual."""
MISJUDGED = {
    ("mi", "LATIN"),
    ("qdb", "LATIN"),
    ("ti", "LATIN"),
    ("hy", "LATIN"),
    ("as", "BENGALI"),
    ("kok", "DEVANAGARI"),
    ("he", "LATIN"),
}
"""Languages that stress what they read as they would a spelling, or spell what they are written in: not told."""
WITHOUT_DATA = {"fo", "kaa", "xex"}
"""Languages of 1.52 that lack their dictionary, and say nothing."""


class Asked(EspeakSynthesizer):
    """The engine, asked how it would say a word."""

    def phonemes(self, word: str) -> str:
        self._library.espeak_TextToPhonemes.restype = ctypes.c_char_p
        left, said = ctypes.c_char_p(word.encode()), []
        while left.value:
            said.append(self._library.espeak_TextToPhonemes(ctypes.byref(left), 1, 2) or b"")
        return b" ".join(said).decode()

    def spells(self, word: str, script: str) -> bool:
        """True if the letters have a stress each, or all characters are said in the same way."""
        if script == "CJK":
            return len({self.phonemes(each) for each in word}) == 1
        said = self.phonemes(word)
        return said.count("ˈ") + said.count("ˌ") / 2 >= 0.7 * sum(map(str.isalpha, word))


@pytest.fixture(scope="module")
def engine() -> Asked:
    pytest.importorskip("espeakng_loader", reason="needs the extra `voice`")
    return Asked(EspeakSettings())


def test_the_table_is_what_the_engine_does_in_every_language(engine: Asked) -> None:
    wrong = []
    for language in sorted(filter(TAG.match, voices(engine._library))):
        own = language.partition("-")[0]
        engine._speak_as(language)
        for script, word in WORDS.items():
            if own in WITHOUT_DATA or (own, script) in MISJUDGED:
                continue
            if engine.spells(word, script) == is_read(script, language):
                wrong.append((language, script, engine.phonemes(word)))

    assert not wrong
    assert {*READ_IN, *UNREAD_IN} <= WORDS.keys()


@pytest.mark.parametrize(
    ("text", "language", "expected"),
    [
        ("Привет, мир!", "en-us", [("Привет", "CYRILLIC")]),
        ("你好", "en-us", [("你好", "CJK")]),
        ("你好", "zh-TW", []),
        ("今日は", "ja", [("今日", "CJK")]),
        ("Say مرحبا and こんにちは", "de", [("مرحبا", "ARABIC"), ("こんにちは", "HIRAGANA")]),
        ("hello TV", "ja", [("hello", "LATIN")]),
        ("TV 5", "ja", []),
        ("the angle α of 안녕 and Straße, naïve, 5 € 😊", "en", []),
        ("привет", "uk", []),
    ],
)
def test_words_that_are_spelled_are_found(text: str, language: str, expected: list[tuple[str, str]]) -> None:
    found = unread(text, language)

    assert [(each.word, each.script) for each in found] == expected
    assert {each.language for each in found} <= {language}


def test_a_span_in_its_own_language_is_read() -> None:
    text = "Say привет now, and 你好"

    assert [each.word for each in unread(text, "en", (Prosody(start=4, end=10, language="ru"),))] == ["你好"]


def test_the_warning_says_what_to_do() -> None:
    assert "xml:lang" in told(Unread("привет", "CYRILLIC", "en"))
    assert "'ru'" in told(Unread("привет", "CYRILLIC", "en"))
    assert "kana" in told(Unread("今日", "CJK", "ja"))
    assert "in none" in told(Unread("ສະບາຍດີ", "LAO", "en"))


@pytest.mark.parametrize("text", ["Привет, мир! How are you?", "你好世界", "สวัสดี"])
async def test_a_speech_that_is_spelled_is_warned_of_and_takes_as_long_as_estimated(text: str) -> None:
    pytest.importorskip("espeakng_loader", reason="needs the extra `voice`")
    voice = EspeakVoice()
    speech = Speech(id="s", text=text)
    async with voice.connected():
        estimate = voice.estimate(speech, None, WORLD)
        begin = asyncio.get_running_loop().time()
        said = [each async for each in voice.perform(speech, MovementAuthority(speech, "end"))]
    ended = next(each.at for each in said if isinstance(each, Reached) and each.sync == "end")

    assert "does not read" in estimate.degraded
    assert ended - begin == pytest.approx(sum(phase.natural for phase in estimate.phases), abs=1e-6)
