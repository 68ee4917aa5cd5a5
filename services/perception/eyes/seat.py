"""A person who sits at a page, from what its camera sees: name and place are those of the seat. Pure.

    seen = SeatSeeing(config, "ann", seat)
    told = seen.feed(landmarks, at)
    told = seen.end()

Others may be in the picture: it is the largest face, and from then on that one, until it is gone.
"""

from collections.abc import Iterable

import numpy as np
from msgspec.structs import replace

from engage_hri.schemas.perception import FaceLandmarks, FacePoints
from engage_hri.schemas.units import Seconds, Vector
from engage_hri.services.perception.eyes.camera import SeatCamera
from engage_hri.services.perception.eyes.config import EyesConfig
from engage_hri.services.perception.eyes.looking import Floats, unpacked
from engage_hri.services.perception.eyes.seeing import PersonCame, PersonGone, Seeing, Seen

REACH = 1.0
"""Distance from one picture to the next in which a face is the same, by its size."""


class SeatSeeing:
    """The one at a page. person: their id. seat: their place, in the robot's frame.

    is_here: False: the camera has looked, and they are gone; None: they were not seen yet.
    """

    def __init__(self, config: EyesConfig, person: str, seat: Vector) -> None:
        self._person = person
        self._seeing = Seeing(config, SeatCamera(config.field_of_view, config.place, seat))
        self._last: tuple[Floats, float] | None = None
        """Middle and size of the face in the last picture in which it was seen, pixels."""
        self.is_here: bool | None = None

    def feed(self, landmarks: FaceLandmarks, at: Seconds) -> list[Seen]:
        """Take what their camera has seen in a picture. Returns what is new, in order. at: of the picture."""
        if not self._seeing.follows:
            self._last = None
        told = self._named(self._seeing.feed(replace(landmarks, faces=tuple(self._own(landmarks.faces))), at))
        for each in told:
            if isinstance(each, PersonCame | PersonGone):
                self.is_here = isinstance(each, PersonCame)
        return told

    @property
    def missed(self) -> tuple[str, ...]:
        """The one at the page, if their face is followed, and was not in the latest picture."""
        return (self._person,) if self._seeing.missed else ()

    def end(self) -> list[Seen]:
        """Take it that the camera looks no more: what they do with their head has ended, and nobody has gone."""
        return [each for each in self._named(self._seeing.end()) if not isinstance(each, PersonGone)]

    def _named(self, told: Iterable[Seen]) -> list[Seen]:
        return [each._replace(person=self._person) for each in told]

    def _own(self, faces: tuple[FacePoints, ...]) -> Iterable[FacePoints]:
        """The face of the one at the page, if it is among these."""
        boxes = [(points[:, :2].mean(0), float(np.ptp(points[:, 1]))) for points in unpacked(faces)]
        if self._last is None:
            own = max(range(len(faces)), key=lambda index: boxes[index][1], default=None)
        else:
            middle, size = self._last
            apart = [float(np.linalg.norm(where - middle)) for where, _ in boxes]
            own = min(range(len(faces)), key=lambda index: apart[index], default=None)
            if own is not None and apart[own] > REACH * size:
                own = None
        if own is None:
            return
        self._last = boxes[own]
        yield faces[own]
