"""People before a camera, from the landmarks of one picture after the other. Pure.

    seeing = Seeing(config)
    told = seeing.feed(landmarks, at)     # at: of the picture, on any clock, later than the last
    told = seeing.end()                  # nothing more will come

Angles are filtered for what is told of heads; gestures come from what was measured.
"""

from typing import NamedTuple

import numpy as np

from engage_hri.schemas.perception import FaceLandmarks
from engage_hri.schemas.units import Meters, Radians, Seconds, Vector
from engage_hri.services.perception.eyes.camera import SeatCamera, StatedCamera
from engage_hri.services.perception.eyes.config import EyesConfig
from engage_hri.services.perception.eyes.head_pose import direction, head, yaw_pitch
from engage_hri.services.perception.eyes.looking import unpacked
from engage_hri.services.perception.eyes.nodding import GestureChange, Nodding
from engage_hri.services.perception.eyes.one_euro import OneEuro
from engage_hri.services.perception.eyes.tracking import FaceTracker, TrackedFace

NEAREST: Meters = 0.15
FARTHEST: Meters = 5.0
"""Distances between which a head is believed."""
REST = 0.8
"""Cutoff of the filter for angles while a head stands, Hz."""
SWIFT = 6.0
"""By how much it grows with each radian a second."""
PLACE_REST = 1.0
PLACE_SWIFT = 8.0
"""The same for places, with each metre a second."""


class SeenHead(NamedTuple):
    """A head, in the robot's frame. spread: standard deviation of yaw and of pitch. mouth: share that is open."""

    person: str
    place: Vector
    direction: Vector
    spread: tuple[Radians, Radians]
    mouth: float


class PersonGesture(NamedTuple):
    """News that a nod or a shake has begun or ended."""

    person: str
    change: GestureChange


class PersonCame(NamedTuple):
    """News that somebody is here. at: since when."""

    person: str
    place: Vector
    at: Seconds


class PersonGone(NamedTuple):
    """News that somebody was not seen for long. at: when they were, last."""

    person: str
    at: Seconds


Seen = PersonCame | SeenHead | PersonGesture | PersonGone


class _Known:
    """Memory of somebody."""

    def __init__(self) -> None:
        self.angles, self.place = OneEuro(REST, SWIFT), OneEuro(PLACE_REST, PLACE_SWIFT)
        self.nodding = Nodding()


class Seeing:
    """The people before one camera. camera: None: where the settings say that it stands."""

    def __init__(self, config: EyesConfig, camera: StatedCamera | SeatCamera | None = None) -> None:
        stated = StatedCamera(config.field_of_view, config.place, config.tilt, config.pan, config.roll)
        self._camera = camera or stated
        self._tracker = FaceTracker()
        self._known: dict[str, _Known] = {}
        self._at = float("-inf")

    def feed(self, landmarks: FaceLandmarks, at: Seconds) -> list[Seen]:
        """Take what a source has found in a picture. Returns what is new, in order.

        In a picture that is no later than the one before nothing is new.
        """
        if at <= self._at:
            return []
        self._at = at
        focal = self._camera.focal(landmarks.width)
        found = [head(points, landmarks.width, landmarks.height, focal) for points in unpacked(landmarks.faces)]
        heads = [each for each in found if each is not None and NEAREST < each.distance < FARTHEST]
        here, gone = self._tracker.feed(heads, at)
        told: list[Seen] = []
        for face in gone:
            told += self._gone(face.id, face.at)
        for face in here:
            told += self._seen(face)
        return told

    @property
    def follows(self) -> bool:
        """True while a face is followed, seen in the last picture or not."""
        return self._tracker.follows

    @property
    def missed(self) -> tuple[str, ...]:
        """People who are followed, and whose face was not in the latest picture."""
        return tuple(face.id for face in self._tracker.named if face.at < self._at)

    def end(self) -> list[Seen]:
        """Let all go: nobody looks any more."""
        return [each for face in self._tracker.named for each in self._gone(face.id, face.at)]

    def _seen(self, face: TrackedFace) -> list[Seen]:
        known, told, person, at = self._known.get(face.id), list[Seen](), face.id, face.at
        if known is None:
            known = self._known[person] = _Known()
            told.append(PersonCame(person, self._camera.place(face.head.place), face.since))
        yaw, pitch = yaw_pitch(face.head.ahead)
        told += [PersonGesture(person, each) for each in known.nodding.feed(yaw, pitch, at)]
        place = known.place.feed(face.head.place, at)
        yaw, pitch = known.angles.feed(np.array([yaw, pitch]), at).tolist()
        ahead = direction(yaw, pitch)
        spread = face.head.yaw_spread, face.head.pitch_spread
        told.append(
            SeenHead(
                person, self._camera.place(place), self._camera.direction(ahead), spread, min(face.head.mouth, 1.0)
            )
        )
        return told

    def _gone(self, person: str, at: Seconds) -> list[Seen]:
        changes = self._known.pop(person).nodding.lose()
        return [*(PersonGesture(person, each) for each in changes), PersonGone(person, at)]
