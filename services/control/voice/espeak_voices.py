"""Voices and variants that a library of eSpeak NG has, by the names that its settings know."""

import ctypes
from collections.abc import Iterator
from typing import Any


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
