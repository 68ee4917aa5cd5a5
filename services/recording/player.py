"""Player of a recording, pure: time is an argument. It needs no bus, and serves one, or a window.

    player = Player(recording, now)             # it plays from the beginning
    messages = player.advance(now)              # those that are due since last time, oldest first
    messages = player.seek(12.5, now)           # the states as they were then, and who was there
    player.pause(now), player.play(now, speed=2.0), player.deadline

Times called `at` count from the beginning of the recording; `now` is any clock that runs evenly.
"""

from bisect import bisect_left, bisect_right
from collections.abc import Iterator

from engage_hri.schemas import keys
from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.samples import Received, Sample
from engage_hri.services.recording.reading import Recording, received

SLOWEST, FASTEST = 0.01, 100.0
"""Bounds of the speed."""


class Timeline:
    """The messages of a recording by time, and what stood at each time."""

    def __init__(self, recording: Recording) -> None:
        self.recording = recording
        self._presence: list[int] = []
        """Numbers of the messages that tell who comes and goes."""
        self._states: dict[str, list[int]] = {}
        """Numbers of the messages of each state, by key."""
        for number in range(len(recording)):
            key = recording.key(number)
            if not key:
                continue
            if keys.is_presence(key):
                self._presence.append(number)
            elif keys.key_class(key) == "state":
                self._states.setdefault(key, []).append(number)

    @property
    def end(self) -> Seconds:
        return self.recording.duration

    def time(self, number: int) -> Seconds:
        return self.recording.time(number)

    def until(self, at: Seconds) -> int:
        """Number of messages that came up to and including a time."""
        return bisect_right(range(len(self.recording)), at, key=self.recording.time)

    def before(self, at: Seconds) -> int:
        """Number of messages that came before a time."""
        return bisect_left(range(len(self.recording)), at, key=self.recording.time)

    def standing(self, count: int) -> list[Sample]:
        """Messages that a listener gets who comes after the first `count`: who is there, and the last states.

        States of a life go when none of its participants is there any more, as they do on a bus.
        """
        there: dict[str, tuple[int, str]] = {}
        gone: dict[str, int] = {}
        for number in self._presence[: bisect_right(self._presence, count - 1)]:
            told = self.recording.received(number)
            if told is None:
                continue
            match told.message:
                case PeerAlive(participant=name, run=run):
                    there[name] = (number, run)
                    gone.pop(run, None)
                case PeerGone(participant=name) if name in there:
                    _, run = there.pop(name)
                    if run not in {other for _, other in there.values()}:
                        gone[run] = number
        numbers = [number for number, _ in there.values()]
        for states in self._states.values():
            place = bisect_right(states, count - 1)
            if place:
                number = states[place - 1]
                if gone.get(self.recording.life(number), -1) < number:
                    numbers.append(number)
        return [self.recording.sample(number) for number in sorted(numbers)]


class Playback:
    """A place in a recording that moves. at: its time. speed: 1.0 as it was. is_over: the end is reached."""

    def __init__(
        self, recording: Recording, now: Seconds, *, speed: float = 1.0, until: Seconds | None = None
    ) -> None:
        """until: time at which it ends."""
        self.timeline = Timeline(recording)
        self.end = self.timeline.end if until is None else min(until, self.timeline.end)
        self.speed = speed
        self.is_paused = False
        self._at: Seconds = 0.0
        self._since = now
        self._next = 0

    def at(self, now: Seconds) -> Seconds:
        """Time in the recording."""
        if self.is_paused:
            return self._at
        return min(self.end, self._at + max(0.0, now - self._since) * self.speed)

    @property
    def is_over(self) -> bool:
        return self._next >= self.timeline.until(self.end)

    @property
    def deadline(self) -> Seconds | None:
        """Time by the clock of `now` at which the next message is due; None: never."""
        if self.is_paused or self.is_over:
            return None
        return self._since + max(0.0, self.timeline.time(self._next) - self._at) / self.speed

    def advance(self, now: Seconds) -> list[Sample]:
        """The messages that are due since last time."""
        # What is due at `deadline` is due then, whatever the rounding of the way there and back.
        at = self.at(now)
        due = self.deadline
        if due is not None and now >= due:
            at = max(at, min(self.end, self.timeline.time(self._next)))
        until = self.timeline.until(at)
        numbers, self._next = range(self._next, until), max(self._next, until)
        samples = (self.timeline.recording.sample(number) for number in numbers)
        return [sample for sample in samples if sample.key]

    def seek(self, at: Seconds, now: Seconds) -> list[Sample]:
        """Go to a time, to and fro. Returns what stood before it; what came then, or later, follows by `advance`."""
        self._at, self._since = min(max(0.0, at), self.end), now
        self._next = self.timeline.before(self._at)
        return self.timeline.standing(self._next)

    def finish(self) -> None:
        """Take the end for reached."""
        self.end, self._next = -1.0, max(self._next, self.timeline.until(self.end))

    def pause(self, now: Seconds) -> None:
        self._at, self._since, self.is_paused = self.at(now), now, True

    def play(self, now: Seconds, speed: float | None = None) -> None:
        """Go on, or go on faster or slower."""
        self._at, self._since, self.is_paused = self.at(now), now, False
        if speed is not None:
            self.speed = min(max(speed, SLOWEST), FASTEST)


def readable(samples: list[Sample]) -> Iterator[Received]:
    """Decode samples; those that nobody can read are left out."""
    return (one for sample in samples if (one := received(sample)) is not None)
