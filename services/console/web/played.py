"""A recording as the picture of the page, to and fro at any speed. Pure: time is an argument."""

from math import floor

from msgspec.structs import replace

from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.samples import Sample
from engage_hri.services.console.heard import Heard
from engage_hri.services.console.web.frames import PlaybackPlace
from engage_hri.services.console.web.picture import Picture
from engage_hri.services.recording.player import Playback, Timeline
from engage_hri.services.recording.reading import Recording, RecordingTimes, received

BEFORE: Seconds = 30.0
"""Time before a place that is played at once when somebody goes there: what the lanes and the words still show."""


class PlayedPicture:
    """The picture at a place in a recording that moves. visit: counts the jumps; each begins a new picture."""

    def __init__(self, recording: Recording, now: Seconds) -> None:
        self._recording = recording
        self._times = RecordingTimes(recording)
        self._player = Playback(recording, now)
        self.visit = 0
        self._begin()

    def _begin(self) -> None:
        """Begin a new picture, of which nothing is known yet."""
        self.picture = Picture(self._recording.robot, 0.0)
        self._heard = Heard(self._recording.robot, self._recording.clock, self._times.at, self._times.told)

    def place(self, now: Seconds) -> PlaybackPlace:
        """Place where it is now."""
        at, player = self._player.at(now), self._player
        return PlaybackPlace(floor(at * 1000) / 1000, player.end, player.is_paused, player.speed, self.visit)

    def advance(self, now: Seconds) -> None:
        """Take what is due."""
        at = self._player.at(now)
        self._feed(self._player.advance(now))
        self._let_pass(at)

    def seek(self, at: Seconds, now: Seconds) -> None:
        """Go to a time: as if one had looked on for a while before it."""
        self.visit += 1
        self._begin()
        self._player.seek(at, now)
        timeline: Timeline = self._player.timeline
        there = self._player.at(now)
        first, last = timeline.before(there - BEFORE), timeline.before(there)
        self._feed(timeline.standing(first))
        self._feed([self._recording.sample(number) for number in range(first, last) if self._recording.key(number)])
        self._let_pass(there)

    def pause(self, now: Seconds) -> None:
        """Stand still."""
        self._player.pause(now)

    def play(self, now: Seconds, speed: float | None = None) -> None:
        """Go on; from the end, from the beginning. speed: times as fast as it was; None: as before."""
        if self._player.at(now) >= self._player.end:
            self.seek(0.0, now)
        self._player.play(now, speed)

    def _feed(self, samples: list[Sample]) -> None:
        for sample in samples:
            if (one := received(sample)) is None:
                continue
            came = max(0.0, one.at - self._recording.began)
            for message, at in self._heard.take(replace(one, at=came), came):
                self.picture.feed(message, at, came)

    def _let_pass(self, at: Seconds) -> None:
        for message, when in self._heard.advance(at):
            self.picture.feed(message, when, at)
        self.picture.advance(at)
