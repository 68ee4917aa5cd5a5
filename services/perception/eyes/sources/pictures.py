"""Sources that look at pictures: a camera, and a film, both with OpenCV; faces by `litert.py`.

A camera whose cover is closed, or whose driver gives the same picture again and again, sees nothing, and that is no
absence of people: such pictures are not told, and after a while the source fails with the reason.
"""

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from engage_hri.schemas.faults import EngageError, Fault, InputRefused
from engage_hri.schemas.landmarks import FaceLandmarks
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.perception.eyes.looking import LandmarkSource, SourceSettings, missing, packed
from engage_hri.services.perception.eyes.sources.litert import FaceFinder, Image

PATIENCE: Seconds = 1.5
"""Time of black or unchanged pictures from which on a camera is taken to see nothing."""
BLACK = 6.0
"""Mean of a picture, of 255, below which it is black, if nothing in it is brighter than `GLIMMER`."""
GLIMMER = 40
KINDS = (".png", ".jpg", ".jpeg", ".bmp", ".ppm", ".webp")
"""Ends of the names of pictures in a folder."""


class CameraBlind(EngageError):
    """A camera that gives nothing that can be seen."""


class Blindness:
    """Watch over a camera: does it see? No noise is the same twice, so an unchanged picture is an old one."""

    def __init__(self) -> None:
        self._last: Image | None = None
        self._since: Seconds | None = None

    def is_blind(self, image: Image, at: Seconds) -> bool:
        """Take the next picture. Raises CameraBlind: this lasts too long."""
        is_same = self._last is not None and np.array_equal(image, self._last)
        is_black = float(image.mean()) < BLACK and int(image.max()) < GLIMMER
        self._last = image
        if not (is_same or is_black):
            self._since = None
            return False
        self._since = at if self._since is None else self._since
        if at - self._since > PATIENCE:
            reason = (
                "the camera gives black pictures" if is_black else "the camera gives the same picture all the time"
            )
            advice = "is it covered, or is there no light?" if is_black else "unplug it, and plug it in again"
            raise CameraBlind(Fault(reason=reason, where="eyes.source", advice=advice))
        return True


class CameraSource(LandmarkSource):
    """A camera of this machine."""

    is_live = True

    def __init__(self, settings: SourceSettings) -> None:
        super().__init__(settings)
        self._settings, self._cv2 = settings, _opencv()
        self._finder = FaceFinder(Path(settings.models), settings.most_faces)
        self._camera = self._cv2.VideoCapture(settings.device)
        if not self._camera.isOpened():
            reason = f"no camera {settings.device} can be opened"
            advice = "is it plugged in, allowed, and not in use? eyes.device counts cameras; or --from film:PATH"
            raise CameraBlind(Fault(reason=reason, where="eyes.device", advice=advice))
        for name, value in (("FRAME_WIDTH", settings.width), ("FRAME_HEIGHT", settings.height), ("BUFFERSIZE", 1)):
            self._camera.set(getattr(self._cv2, f"CAP_PROP_{name}"), value)

    def look(self) -> Iterator[FaceLandmarks]:
        blindness, due = Blindness(), float("-inf")
        while self._camera.grab():
            at = time.monotonic()
            if at < due:
                continue
            due = max(due + 1 / self._settings.rate, at)
            taken, image = self._camera.retrieve()
            if taken:
                image = self._cv2.cvtColor(image, self._cv2.COLOR_BGR2RGB)
                if not blindness.is_blind(image, at):
                    yield _told(self._finder, image, at)
        reason, advice = "the camera gives no picture any more", "is it plugged in?"
        raise CameraBlind(Fault(reason=reason, where="eyes.source", advice=advice))


class FilmSource(LandmarkSource):
    """A film, or a folder with pictures in the order of their names."""

    is_live = False

    def __init__(self, settings: SourceSettings) -> None:
        super().__init__(settings)
        self._path, self._rate, self._cv2 = Path(settings.path), settings.rate, _opencv()
        if not settings.path or not self._path.exists():
            raise _refused(self._path, "there is no such file")
        self._finder = FaceFinder(Path(settings.models), settings.most_faces)
        self._names = sorted(each for each in self._path.glob("*") if each.suffix.lower() in KINDS)
        if self._path.is_dir():
            if not self._names:
                raise _refused(self._path, "no picture is in this folder")
        elif not self._cv2.VideoCapture(str(self._path)).isOpened():
            raise _refused(self._path, "it is no film that OpenCV can read")

    def look(self) -> Iterator[FaceLandmarks]:
        for image, at in self._pictures() if self._names else self._frames():
            yield _told(self._finder, self._cv2.cvtColor(image, self._cv2.COLOR_BGR2RGB), at)

    def _pictures(self) -> Iterator[tuple[Image, Seconds]]:
        for number, name in enumerate(self._names):
            if (image := self._cv2.imread(str(name))) is None:
                raise _refused(name, "it is no picture that OpenCV can read")
            yield image, number / self._rate

    def _frames(self) -> Iterator[tuple[Image, Seconds]]:
        film = self._cv2.VideoCapture(str(self._path))
        rate = film.get(self._cv2.CAP_PROP_FPS) or self._rate
        number = 0
        while True:
            taken, image = film.read()
            if not taken:
                return
            yield image, number / rate
            number += 1


def _opencv() -> Any:
    try:
        import cv2
    except ImportError as error:
        raise missing("eyes", error) from error
    return cv2


def _refused(path: Path, reason: str) -> InputRefused:
    return InputRefused(Fault(reason=reason, where=str(path)))


def _told(finder: FaceFinder, image: Image, at: Seconds) -> FaceLandmarks:
    height, width = image.shape[:2]
    faces = tuple(packed(points, confidence) for points, confidence in finder.find(image))
    return FaceLandmarks(at=Stamp("", at), width=width, height=height, faces=faces)
