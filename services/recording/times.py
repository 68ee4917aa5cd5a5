"""Instants of messages as times in a recording, through the clocks that its recorder knew. Pure."""

from bisect import bisect_right
from collections.abc import Callable, Iterator
from typing import Any

import msgspec
from msgspec import Struct

from engage_hri.schemas.fragments import HeadOwner
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.bus.samples import Received
from engage_hri.services.recording.form import CLOCK
from engage_hri.services.recording.reading import Recording


class RecordingTimes:
    """Times in a recording. An instant of a clock that its recorder never knew has none."""

    def __init__(self, recording: Recording) -> None:
        self._clock = recording.clock
        self._began = recording.began
        self._offsets: dict[str, tuple[list[Seconds], list[Seconds]]] = {}
        """Offsets of each other clock to the recorder's, and from when on each was known."""
        for at, told in recording.own(CLOCK):
            for clock, known in told.items():
                since, offsets = self._offsets.setdefault(clock, ([], []))
                since.append(at)
                offsets.append(known.offset)

    def at(self, stamp: Stamp, told_at: Seconds) -> Seconds | None:
        """Time of an instant, from the beginning of the recording. told_at: time at which its message came."""
        if stamp.clock == self._clock:
            return stamp.seconds - self._began
        if stamp.clock not in self._offsets:
            return None
        since, offsets = self._offsets[stamp.clock]
        # What was told before the clock was measured is taken by its first measurement.
        return stamp.seconds + offsets[max(0, bisect_right(since, told_at) - 1)] - self._began

    def told(self, message: object, came: Seconds) -> Seconds:
        """Time that a message tells of; that at which it came, if it has none, or of a clock that was not known."""
        stamp = getattr(message, "since" if isinstance(message, HeadOwner) else "at", None)
        at = self.at(stamp, came) if isinstance(stamp, Stamp) else None
        return came if at is None else at


def messages(recording: Recording) -> Iterator[tuple[Received, Seconds]]:
    """All messages that can be read, with the times that they tell of, or else at which they came."""
    times = RecordingTimes(recording)
    for number in range(len(recording)):
        if not recording.key(number) or (received := recording.received(number)) is None:
            continue
        yield received, times.told(received.message, recording.time(number))


def moved(value: Any, instant: Callable[[Stamp], Stamp]) -> Any:
    """A message with other instants, everything else as it was."""
    match value:
        case Stamp():
            return instant(value)
        case Struct():
            fields = {name: getattr(value, name) for name in value.__struct_fields__}
            changed = {name: new for name, old in fields.items() if (new := moved(old, instant)) is not old}
            return msgspec.structs.replace(value, **changed) if changed else value
        case tuple():
            items = tuple(moved(item, instant) for item in value)
            same = all(new is old for new, old in zip(items, value, strict=True))
            return value if same else items
    return value
