"""Outlets for sound: what a voice plays goes to a device, into a file, or nowhere, at loop times."""

import struct
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from typing import BinaryIO

from engage_hri.schemas.faults import Fault
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.contract.body import SpokenSound

STUCK: Seconds = 0.8
"""So long an outlet may take nothing while it is late, before it counts as dead."""


class Outlet:
    """A way for sound; this one leads nowhere, and takes what it is given at once. All times are loop times, seconds.

    now: loop time. lead: how long before a sound is to be heard it has to be played. fault: why nothing is heard any
    more. is_live: true if it may be late: then `late` is to be asked before anything is told as heard.
    """

    def __init__(self, now: Callable[[], Seconds]) -> None:
        self.now = now
        self._fault: Fault | None = None
        self._on_fault: list[Callable[[], None]] = []

    @property
    def is_live(self) -> bool:
        return False

    @property
    def lead(self) -> Seconds:
        return 0.0

    @property
    def fault(self) -> Fault | None:
        return self._fault

    def earliest(self) -> Seconds:
        """The earliest time at which sound that is played now is heard."""
        return self.now()

    def play(self, samples: bytes, at: Seconds) -> None:
        """Play samples so that they sound from `at` on: 16 bit, little-endian, one channel.

        Calls come in the order of time.
        """

    def rest(self) -> None:
        """Take note that silence follows what was played."""

    def late(self) -> Seconds | None:
        """Say by how much all that was played is late: it should have been heard by now, and was not even taken.

        From then on that is the plan, for what is played next, too; so it is to be asked again and again.

        Returns None if nothing is late; 0 if it is as late as when last asked, and nothing was taken since.
        """
        return None

    def cut(self, at: Seconds, tail: bytes) -> None:
        """Take back what was played and would be heard from `at` on. It is called at that time.

        tail: the last samples before it as they should have been, for an outlet that can still change them.
        """

    def announce_cut(self, at: Seconds) -> None:
        """Take note that `cut` is to come at a time, unless a device is late until then."""

    def revive(self) -> None:
        """Get ready for a speech: try again after a fault."""

    def watch(self, on_fault: Callable[[], None]) -> Callable[[], None]:
        """Call `on_fault` when there is one, until the returned function is called."""
        self._on_fault.append(on_fault)
        return lambda: self._on_fault.remove(on_fault)

    def tell_fault(self) -> None:
        """Call all that watch."""
        for each in list(self._on_fault):
            each()


class Several(Outlet):
    """All outlets of a voice as one: sound is heard at the same time in each. At first it leads nowhere.

    The first is what people hear: all goes by its time, and its fault is that of all. Another one that fails is
    missing, and says so itself. With the fault `mute` it takes no sound, as a device that has stopped.

    outlets: at least one.
    """

    def __init__(self, now: Callable[[], Seconds], *outlets: Outlet) -> None:
        super().__init__(now)
        self.outlets: Sequence[Outlet] = outlets or (Outlet(now),)
        self._is_mute = False
        self._since: Seconds | None = None
        """Loop time at which it was first asked whether sound is late, while it is mute."""
        self._asked: Seconds = 0.0

    @property
    def is_live(self) -> bool:
        return self._is_mute or self.outlets[0].is_live

    @property
    def lead(self) -> Seconds:
        return max(each.lead for each in self.outlets)

    @property
    def fault(self) -> Fault | None:
        return self._fault or self.outlets[0].fault

    def switch(self, *, is_mute: bool) -> None:
        """Take no more sound, or take it again. What was played is not heard to its end."""
        if is_mute:
            self.cut(self.now(), b"")
        self._is_mute = is_mute
        self.revive()
        self.tell_fault()

    def revive(self) -> None:
        self._fault = self._since = None
        for each in self.outlets:
            each.revive()

    def earliest(self) -> Seconds:
        return max(each.earliest() for each in self.outlets)

    def play(self, samples: bytes, at: Seconds) -> None:
        for each in () if self._is_mute else self.outlets:
            each.play(samples, at)

    def rest(self) -> None:
        for each in () if self._is_mute else self.outlets:
            each.rest()

    def late(self) -> Seconds | None:
        if not self._is_mute:
            return self.outlets[0].late()
        now = self.now()
        if self._since is None:
            self._since = self._asked = now
        late, self._asked = now - self._asked, now
        if now - self._since > STUCK:
            self._fault = Fault(reason=f"the device is silent: no sound is taken for {STUCK} s", service="control")
        return late

    def cut(self, at: Seconds, tail: bytes) -> None:
        for each in () if self._is_mute else self.outlets:
            each.cut(at, tail)

    def announce_cut(self, at: Seconds) -> None:
        for each in () if self._is_mute else self.outlets:
            each.announce_cut(at)

    def watch(self, on_fault: Callable[[], None]) -> Callable[[], None]:
        ends = ExitStack()
        for watch in (super().watch, *(each.watch for each in self.outlets)):
            ends.callback(watch(on_fault))
        return ends.close


AHEAD: Seconds = 0.15
"""How long before it is heard sound is told that others play: for its way to them, and a loop that is late."""
SOON: Seconds = 0.06
"""The same where a speech begins or goes on: gestures that begin with it do not wait for it."""
PIECE: Seconds = 0.1
"""Seconds of sound in what is told at a time."""


class ToldSound(Outlet):
    """An outlet to whoever plays the voice elsewhere, as the pages of a window do. It knows nothing of their devices.

    Whether anybody plays it is asked as a speech begins: whoever comes later hears its first words a little late.
    """

    def __init__(
        self,
        now: Callable[[], Seconds],
        rate: int,
        tell: Callable[[SpokenSound], None],
        is_wanted: Callable[[], bool],
    ) -> None:
        """rate: samples per second. tell: gets the sound, and where it is cut. is_wanted: whether anybody plays."""
        super().__init__(now)
        self._rate, self._tell, self._is_wanted = rate, tell, is_wanted
        self._lead: Seconds = 0.0
        self._silent_from: Seconds = 0.0
        """Where what was told is cut, or else ends."""

    @property
    def lead(self) -> Seconds:
        return self._lead

    def earliest(self) -> Seconds:
        return self.now() + min(SOON, self._lead)

    def revive(self) -> None:
        self._lead = AHEAD if self._is_wanted() else 0.0

    def play(self, samples: bytes, at: Seconds) -> None:
        if not self._is_wanted():
            return
        size = 2 * round(PIECE * self._rate)
        for begin in range(0, len(samples), size):
            self._tell(SpokenSound(at + begin / 2 / self._rate, self._rate, samples[begin : begin + size]))
        self._silent_from = max(self._silent_from, at + len(samples) / 2 / self._rate)

    def announce_cut(self, at: Seconds) -> None:
        if at < self._silent_from:
            self._silent_from = at
            self._tell(SpokenSound(at, self._rate))

    def cut(self, at: Seconds, tail: bytes) -> None:
        self.announce_cut(at)


COMMENT_SIZE = 80
_HEADER = 12 + 24 + 8 + 4 + 8 + COMMENT_SIZE + 8
LARGEST = 2**32 - 2**16
"""Bytes of sound in one file: its header has no room for more."""


class WavFile(Outlet):
    """A WAV file of all that is said, each sound at its loop time: a whole scenario can be heard and aligned.

    The file is valid after each sound, whatever ends the process then: the sizes in its header are brought up to date
    with the samples. Its second 0 is the loop time `origin`: 0 in virtual time, else when the voice was connected. A
    comment in the file (LIST INFO ICMT) says that. It takes what it is given at once, so it needs no lead.
    """

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
