"""A WAV file of all that is said, each sound at its loop time: a whole scenario can be heard and aligned.

The file is valid after each sound, whatever ends the process then: the sizes in its header are brought up to date
with
the samples. Its second 0 is the loop time `origin`: 0 in virtual time, else when the voice was connected. A comment
in the file (LIST INFO ICMT) says that.
"""

import struct
from collections.abc import Callable
from typing import BinaryIO

from engage_hri.schemas.faults import Fault
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.voice.outlets import Outlet

COMMENT_SIZE = 80
_HEADER = 12 + 24 + 8 + 4 + 8 + COMMENT_SIZE + 8
LARGEST = 2**32 - 2**16
"""Bytes of sound in one file: its header has no room for more."""


class WavFile(Outlet):
    """An outlet into a file. It takes what it is given at once, so it needs no lead."""

    def __init__(self, file: BinaryIO, name: str, rate: int, origin: Seconds, now: Callable[[], Seconds]) -> None:
        """Begin an empty file. file: unbuffered. rate: samples per second. origin: the loop time of its second 0."""
        super().__init__(now)
        self._file, self._name, self._rate, self._origin = file, name, rate, origin
        self._size = 0
        self._is_told = False
        """Its fault is known, and told again only after it has taken sound."""
        self._write(0, _header(0, rate, origin))

    def __enter__(self) -> "WavFile":
        return self

    def __exit__(self, *error: object) -> None:
        self._file.close()

    def revive(self) -> None:
        self._fault = None  # there may be room now

    def play(self, samples: bytes, at: Seconds) -> None:
        if self.fault is not None:
            return
        place = max(0, round((at - self._origin) * self._rate)) * 2
        if place + len(samples) > LARGEST:
            self._fail("the file is full", "a WAV file holds 4 GiB; name another one")
            return
        if self._write(_HEADER + place, samples):
            self._size = max(self._size, place + len(samples))
            self._is_told = not self._write(0, _header(self._size, self._rate, self._origin))

    def cut(self, at: Seconds, tail: bytes) -> None:
        size = max(0, round((at - self._origin) * self._rate)) * 2
        if self.fault is None and size < self._size:
            self._size = size
            self._write(max(_HEADER, _HEADER + size - len(tail)), tail)
            self._file.truncate(_HEADER + size)
            self._write(0, _header(size, self._rate, self._origin))

    def _write(self, place: int, content: bytes) -> bool:
        try:
            self._file.seek(place)
            while content:
                content = content[self._file.write(content) :]
        except OSError as error:
            self._fail(error.strerror or str(error), "is the disk full?")
        return self.fault is None

    def _fail(self, reason: str, advice: str) -> None:
        reason = f"the sound file {self._name}: {reason}"
        self._fault = Fault(reason=reason, where=self._name, advice=advice, service="control")
        is_told, self._is_told = self._is_told, True
        if not is_told:
            self.tell_fault()


def _header(size: int, rate: int, origin: Seconds) -> bytes:
    comment = f"Engage; second 0 is loop time {origin:.6f} s".encode().ljust(COMMENT_SIZE, b"\0")[:COMMENT_SIZE]
    info = b"INFO" + b"ICMT" + struct.pack("<I", COMMENT_SIZE) + comment
    return (
        b"RIFF" + struct.pack("<I", _HEADER - 8 + size) + b"WAVE"
        + b"fmt " + struct.pack("<IHHIIHH", 16, 1, 1, rate, 2 * rate, 2, 16)
        + b"LIST" + struct.pack("<I", len(info)) + info
        + b"data" + struct.pack("<I", size)
    )  # fmt: skip
