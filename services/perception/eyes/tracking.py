"""Faces of one picture after the other: which is whose, who has come, and who has gone. Pure.

A source numbers nothing, and loses faces: a hand before it, a head that turns away, two people who cross. So each
face goes to who is nearest to where it should be by now, if that is possible for a head. Who is not seen stays for a
while, of which only the time counts in which the source has really looked: a camera that stalls takes nobody away.
"""

from collections.abc import Sequence

import numpy as np

from engage_hri.schemas.units import Meters, Seconds
from engage_hri.services.perception.eyes.head_pose import MeasuredHead
from engage_hri.services.reports.action_reports import FACE_GRACE

SEEN_FOR: Seconds = 0.25
"""Time for which a face is to be seen before it is somebody: what is no face rarely lasts."""
LOOKED: Seconds = 0.5
"""Longest time between two pictures in which the source has looked. More is a stall."""
SWIFT = 1.5
"""Metres a second that a head moves at most."""
LEAP: Meters = 0.25
"""Distance by which a measurement of a head that stands may differ."""
MEMORY: Seconds = 0.3
"""Time over which a speed is taken, and for which it is believed."""


class TrackedFace:
    """A face over time. head: as seen last. since, at: first and last instant. id: empty: nobody yet."""

    def __init__(self, head: MeasuredHead, at: Seconds) -> None:
        self.head, self.since, self.at, self.id = head, at, at, ""
        self.missed: Seconds = 0.0
        """Time for which the source has looked since, and not seen this face."""
        self._speed = np.zeros(3)

    def distance(self, head: MeasuredHead, at: Seconds) -> Meters:
        """Distance of a head from where this one should be."""
        expected = self.head.place + self._speed * min(at - self.at, MEMORY)
        return float(np.linalg.norm(head.place - expected))

    def reach(self, at: Seconds) -> Meters:
        """Distance at which it may be from there."""
        return LEAP + SWIFT * min(at - self.at, MEMORY)

    def follow(self, head: MeasuredHead, at: Seconds) -> None:
        """Take the head as it is now."""
        past = at - self.at
        share = min(past / MEMORY, 1.0)
        self._speed = self._speed * (1 - share) + share * (head.place - self.head.place) / past
        self.head, self.at, self.missed = head, at, 0.0


class FaceTracker:
    """People before a camera. Ids are `face_1`, `face_2`, and none is given twice."""

    def __init__(self) -> None:
        self._faces: list[TrackedFace] = []
        self._named = 0
        self._at: Seconds | None = None

    @property
    def named(self) -> list[TrackedFace]:
        """All who are somebody, seen or not."""
        return [face for face in self._faces if face.id]

    @property
    def follows(self) -> bool:
        """True while there is a face that may come back as the same."""
        return bool(self._faces)

    def feed(self, heads: Sequence[MeasuredHead], at: Seconds) -> tuple[list[TrackedFace], list[TrackedFace]]:
        """Take the heads of the next picture. Returns who is seen in it, and who has gone for good."""
        past = 0.0 if self._at is None else at - self._at
        self._at = at
        pairs = sorted(
            (distance, number, index)
            for index, known in enumerate(self._faces)
            for number, head in enumerate(heads)
            if (distance := known.distance(head, at)) < known.reach(at)
        )
        whose: dict[int, TrackedFace] = {}
        for _, number, index in pairs:
            if number not in whose and self._faces[index] not in whose.values():
                whose[number] = self._faces[index]
        for number, head in enumerate(heads):
            if number in whose:
                whose[number].follow(head, at)
            else:
                self._faces.append(TrackedFace(head, at))
        for face in self._faces:
            if face.at < at:
                face.missed += past if past <= LOOKED else 0.0
            elif not face.id and at - face.since >= SEEN_FOR:
                self._named += 1
                face.id = f"face_{self._named}"
        gone = [face for face in self._faces if face.missed > (FACE_GRACE if face.id else LOOKED)]
        self._faces = [face for face in self._faces if face not in gone]
        return [face for face in self._faces if face.id and face.at == at], [face for face in gone if face.id]
