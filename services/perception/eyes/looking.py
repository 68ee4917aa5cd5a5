"""Sources of landmarks: what looks at pictures, and tells the points of the faces that it finds. Pure.

    class MySource(LandmarkSource):
        def look(self) -> Iterator[FaceLandmarks]:
            while picture := self._camera.read():
                yield FaceLandmarks(at=Stamp("", time.monotonic()), width=640, height=480, faces=...)

It is made in a process of its own (`watching.py`), and may block there. Each picture that was looked at is told, one
without faces too: only that is absence.

    [project.entry-points."engage.landmarks"]
    mine = "my_package.eyes:MySource"
"""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.perception import EIGHTHS, FACE_POINTS, FaceLandmarks, FacePoints
from engage_hri.schemas.units import Probability
from engage_hri.services.perception.eyes.config import EyesConfig
from engage_hri.services.perception.pictures import PictureSettings

Floats = NDArray[np.float64]


class SourceSettings(PictureSettings, frozen=True, kw_only=True):
    """Settings of a source. path: file or folder, empty of a live one. device, rate, width, height, most_faces: as in
    `EyesConfig`. models: folder in which `engage eyes install` keeps them."""

    most_faces: int = 4
    models: str = ""


def settings_of(config: EyesConfig, models: str) -> SourceSettings:
    """Pick the settings of the source."""
    return SourceSettings(
        path=config.source.partition(":")[2], device=config.device, rate=config.rate, width=config.width,
        height=config.height, most_faces=config.most_faces, models=models,
    )  # fmt: skip


class LandmarkSource(ABC):
    """A source of landmarks. is_live: its instants are those of this machine's clock (`time.monotonic`); else they
    are seconds from the beginning, and it is played in the time of the loop."""

    is_live: bool

    def __init__(self, settings: SourceSettings) -> None:
        """Open it. Raises InputRefused: there is no such file or device, or a package or a model is missing."""
        super().__init__()

    @abstractmethod
    def look(self) -> Iterator[FaceLandmarks]:
        """Look at one picture after the other. A film ends with the last one; a device that gives none any more
        raises an EngageError.
        """


def packed(points: Floats, confidence: Probability = 1.0) -> FacePoints:
    """Pack the points of a face. points: x, y and depth of each, pixels."""
    steps = np.clip(np.rint(np.asarray(points) * EIGHTHS), -32768, 32767)
    return FacePoints(points=steps.astype("<i2").tobytes(), confidence=round(float(confidence), 3))


def unpacked(faces: Iterable[FacePoints]) -> list[Floats]:
    """Points of faces: x, y and depth of each, pixels."""
    return [np.frombuffer(face.points, "<i2").reshape(FACE_POINTS, 3) / EIGHTHS for face in faces]


def missing(package: str, error: ImportError) -> InputRefused:
    """Make the error of a source whose package is not installed. package: as it is installed, or an extra of ours."""
    from engage_hri.services.runtime.installation import extra_command

    return InputRefused(Fault(reason=str(error), where="eyes.source", advice=extra_command(package)))
