"""The synthesizer eSpeak NG, by ctypes: over a hundred languages, with the time of each word and speech sound.

eSpeak NG is free software under the GNU GPL, version 3 or later. It is not part of Engage, and it is loaded only in
the process of `studio.py`. The library comes from the extra `voice` (package `espeakng-loader`) or from the system.
The events of its interface are those of espeak-ng/speak_lib.h, revision 12.
"""

import ctypes
import ctypes.util
from collections.abc import Iterator, Sequence
from html import escape
from importlib import import_module
from itertools import pairwise
from typing import Any

from msgspec.structs import replace

from engage_hri.schemas.advice import suggestion
from engage_hri.schemas.documents.prosody import Prosody
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.voice.synthesis import (
    Heard,
    Phone,
    Phrase,
    Said,
    SynthesisFailed,
    Synthesizer,
    VoiceSettings,
    refused,
)
from engage_hri.services.runtime.installation import extra_command


class _Voice(ctypes.Structure):
    """The type `espeak_VOICE` of espeak-ng/speak_lib.h."""

    _fields_ = (
        ("name", ctypes.c_char_p), ("languages", ctypes.c_void_p), ("identifier", ctypes.c_char_p),
        ("gender", ctypes.c_ubyte), ("age", ctypes.c_ubyte), ("variant", ctypes.c_ubyte), ("unused", ctypes.c_ubyte),
        ("score", ctypes.c_int), ("own", ctypes.c_void_p),
    )  # fmt: skip


def voices(library: Any) -> dict[str, str]:
    """Identifiers of voices, as `gmw/en`, by the tags of their languages and by name, in lower case.

    library: initialized.
    """
    found: dict[str, str] = {}
    for voice in _voices(library, None):
        for name in (*_languages(voice), voice.name.decode("utf-8", "replace")):
            found.setdefault(name.lower(), voice.identifier.decode("utf-8", "replace"))
    return found


def variants(library: Any) -> set[str]:
    """Names of the variants that it has, as `f2`. library: initialized."""
    kind = ctypes.create_string_buffer(b"variant")
    asked = _Voice(languages=ctypes.cast(kind, ctypes.c_void_p).value)
    found = _voices(library, ctypes.byref(asked))
    return {voice.identifier.decode("utf-8", "replace").removeprefix("!v/") for voice in found}


def _voices(library: Any, asked: Any) -> Iterator[_Voice]:
    library.espeak_ListVoices.restype = ctypes.POINTER(ctypes.POINTER(_Voice))
    listed = library.espeak_ListVoices(asked)
    number = 0
    while listed[number]:
        yield listed[number].contents
        number += 1


def _languages(voice: _Voice) -> Iterator[str]:
    """A list in one string: before each name a byte with its rank, after the last name a byte of 0."""
    place = voice.languages
    while place and ctypes.string_at(place, 1) != b"\0":
        name = ctypes.string_at(place + 1)
        yield name.decode("utf-8", "replace")
        place += len(name) + 2


OR_ELSE = " (eSpeak NG is under the GPL, version 3), or Debian: apt install libespeak-ng1"

_SYNCHRONOUS, _PHONES_IN_IPA, _DO_NOT_EXIT = 2, 0x0003, 0x8000
_UTF8, _SSML = 1, 0x10
_RATE, _PITCH, _RANGE, _WORD_GAP = 1, 3, 4, 7
_WORD, _PHONEME = 1, 7
_END_OF_LIST = 0
_BUFFER = 200
"""Milliseconds of sound for which the engine calls back once."""
_BY_NAME = {"zh": "cmn", "no": "nb", "iw": "he", "tl": "fil", "jp": "ja"}
"""What eSpeak NG calls the language of a tag."""


class EspeakSettings(VoiceSettings, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings of the voice `espeak`.

    language: that of the voice where the text names none, as `de` or `en-gb`. variant: one of eSpeak NG's, as `f2`.
    words_per_minute: 80..450. pitch, pitch_range: 0..99; 50 is usual. word_gap: silence between words, in 10 ms.
    library: the file of the library, where it is not found; data: the folder that holds `espeak-ng-data`.
    """

    language: str = "en-us"
    variant: str = ""
    words_per_minute: int = 165
    pitch: int = 50
    pitch_range: int = 50
    word_gap: int = 0
    library: str = ""
    data: str = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 80 <= self.words_per_minute <= 450:
            raise ValueError(f"words_per_minute is {self.words_per_minute}: expected 80..450")
        for name in ("pitch", "pitch_range"):
            if not 0 <= getattr(self, name) <= 99:
                raise ValueError(f"{name} is {getattr(self, name)}: expected 0..99")
        if not 0 <= self.word_gap <= 100:
            raise ValueError(f"word_gap is {self.word_gap}: expected 0..100")


class _Id(ctypes.Union):
    _fields_ = (("number", ctypes.c_int), ("name", ctypes.c_char_p), ("string", ctypes.c_char * 8))


class _Event(ctypes.Structure):
    _fields_ = (
        ("type", ctypes.c_int), ("identifier", ctypes.c_uint), ("text_position", ctypes.c_int),
        ("length", ctypes.c_int), ("audio_position", ctypes.c_int), ("sample", ctypes.c_int),
        ("user_data", ctypes.c_void_p), ("id", _Id),
    )  # fmt: skip


_Callback = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_int, ctypes.POINTER(_Event))


class EspeakSynthesizer(Synthesizer):
    """eSpeak NG. One in a process: the library has one state."""

    Settings = EspeakSettings

    def __init__(self, settings: EspeakSettings) -> None:
        """Load the library. Raises SynthesisFailed: there is none, it has no data, no such language or no variant."""
        self._settings = settings
        self._library, data = _loaded(settings)
        flags = _PHONES_IN_IPA | _DO_NOT_EXIT
        self.rate = self._library.espeak_Initialize(_SYNCHRONOUS, _BUFFER, data, flags)
        if self.rate <= 0:
            raise refused("eSpeak NG does not find its data", "`data` is the folder that holds espeak-ng-data")
        if settings.variant and settings.variant not in (known := variants(self._library)):
            advice = suggestion(settings.variant, known)
            raise _of_setting("variant", refused(f"eSpeak NG does not have the variant {settings.variant!r}", advice))
        self._voices = voices(self._library)
        self._sound = bytearray()
        self._words: list[tuple[int, int]] = []
        self._phones: list[tuple[str, int]] = []
        self._callback = _Callback(self._take)
        self._language = ""
        try:
            self._speak_as(settings.language)
        except SynthesisFailed as error:
            raise _of_setting("language", error) from error

    def say(self, phrase: Phrase) -> Said:
        self._speak_as(phrase.language or self._settings.language)
        self._sound, self._words, self._phones = bytearray(), [], []
        text, places = ssml(phrase) if phrase.prosody else (phrase.text, range(len(phrase.text)))
        data = text.encode("utf-8", "replace") + b"\0"
        self._library.espeak_SetSynthCallback(self._callback)  # another one in this process may have been there
        flags = _UTF8 | (_SSML if phrase.prosody else 0)
        if self._library.espeak_Synth(data, len(data), 0, 1, 0, flags, None, None) != 0:
            raise refused("eSpeak NG has refused the text")
        self._library.espeak_Synchronize()
        words = [
            Heard(places[min(max(0, at - 1), len(places) - 1)], self._seconds(sample))
            for at, sample in self._words
            if len(places)
        ]
        return Said(bytes(self._sound), words, [Phone(name, self._seconds(at)) for name, at in self._phones])

    def _seconds(self, sample: int) -> Seconds:
        return sample / self.rate

    def _take(self, samples: int | None, count: int, events: Any) -> int:
        """Collect sound and events, as the engine calls back. Returns 0: it is to go on."""
        if samples and count > 0:
            self._sound += ctypes.string_at(samples, 2 * count)
        number = 0
        while events and events[number].type != _END_OF_LIST:
            event = events[number]
            if event.type == _WORD:
                self._words.append((event.text_position, event.sample))
            elif event.type == _PHONEME:
                raw = ctypes.string_at(ctypes.addressof(event.id), 8).split(b"\0")[0]
                self._phones.append((raw.decode("utf-8", "ignore"), event.sample))
            number += 1
        return 0

    def _speak_as(self, language: str) -> None:
        """Change the language. Raises SynthesisFailed: the engine does not have it."""
        if language != self._language:
            self._language = ""
            if not any(self._has(name) for name in _names(language)):
                advice = suggestion(language.strip().lower(), self._voices)
                raise refused(f"eSpeak NG does not have the language {language!r}", advice)
            settings = self._settings
            for parameter, value in (
                (_RATE, settings.words_per_minute),
                (_PITCH, settings.pitch),
                (_RANGE, settings.pitch_range),
                (_WORD_GAP, settings.word_gap),
            ):
                self._library.espeak_SetParameter(parameter, value, 0)
            self._language = language

    def _has(self, name: str) -> bool:
        """Take a voice, by its name, its language, or a language that it has besides, as `en-gb`: if it is there."""
        variant = f"+{self._settings.variant}" if self._settings.variant else ""
        asked = [name, *([self._voices[name]] if name in self._voices else [])]
        return any(
            self._library.espeak_SetVoiceByName(f"{each}{variant}".encode("ascii", "replace")) == 0 for each in asked
        )


def _of_setting(name: str, error: SynthesisFailed) -> SynthesisFailed:
    return SynthesisFailed(replace(error.fault, where=f"control.drivers.espeak.{name}"))


def _names(language: str) -> Iterator[str]:
    """Names by which the engine may know the language of a tag, the closest first."""
    tag = language.strip().replace("_", "-").lower()
    parts = tag.split("-")
    for count in range(len(parts), 0, -1):
        name = "-".join(parts[:count])
        for each in (name, _BY_NAME.get(name, "")):
            if each:
                yield each


def _loaded(settings: EspeakSettings) -> tuple[Any, bytes | None]:
    """The library, and the path of its data; None: the one that it knows itself. Raises SynthesisFailed."""
    file, data = settings.library, settings.data
    if not file:
        try:
            loader = import_module("espeakng_loader")
            file, data = loader.get_library_path(), data or loader.get_data_path()
        except (ImportError, RuntimeError):
            file = ctypes.util.find_library("espeak-ng") or "libespeak-ng.so.1"
    try:
        library = ctypes.CDLL(file)
        library.espeak_Info.restype = ctypes.c_char_p
        return library, data.encode() if data else None
    except (OSError, AttributeError) as error:
        raise refused(f"no library of eSpeak NG: {error}", extra_command("voice") + OR_ELSE) from error


def ssml(phrase: Phrase) -> tuple[str, Sequence[int]]:
    """Write a phrase with its prosody as the SSML that eSpeak NG reads.

    Returns it and, for each of its characters, the character of the text that it stands for.
    """
    written: list[str] = []
    places: list[int] = []

    def write(text: str, place: int) -> None:
        written.append(text)
        places.extend([place] * len(text))

    borders = sorted({0, len(phrase.text), *(edge for span in phrase.prosody for edge in (span.start, span.end))})
    for since, until in pairwise(borders):
        for span in phrase.prosody:
            if span.start == since and span.pause:
                write(f'<break time="{round(span.pause * 1000)}ms"/>', since)
        inside = [span for span in phrase.prosody if span.start <= since and until <= span.end]
        tags = [tag for span in inside for tag in _tags(span)]
        for opening, _ in tags:
            write(opening, since)
        for place in range(since, until):
            write(escape(phrase.text[place]), place)
        for _, closing in reversed(tags):
            write(closing, max(since, until - 1))
    return "".join(written), places


def _tags(span: Prosody) -> Iterator[tuple[str, str]]:
    if span.language:
        name = next(iter(_names(span.language)))
        yield f'<voice xml:lang="{escape(_BY_NAME.get(name, name))}">', "</voice>"
    factors = {"rate": span.rate, "pitch": span.pitch, "volume": span.volume}
    asked = "".join(f' {name}="{_percent(name, factor)}"' for name, factor in factors.items() if factor != 1.0)
    if asked:
        yield f"<prosody{asked}>", "</prosody>"
    if span.emphasis:
        yield f'<emphasis level="{span.emphasis}">', "</emphasis>"


def _percent(name: str, factor: float) -> str:
    """A factor as eSpeak NG reads it: a rate is a percentage of its own, the others a change by so many percent."""
    return f"{round(100 * factor)}%" if name == "rate" else f"{round(100 * factor - 100):+d}%"
