"""Pictures for a sense that sees: from a camera of this machine, or from a film, both with OpenCV.

A camera whose cover is closed, or whose driver gives the same picture again and again, sees nothing, and that is no
absence of what it looks for: such pictures are not given, and after a while the camera fails with the reason.
"""

import time
from abc import ABC, abstractmethod
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from engage_hri.schemas.faults import EngageError, Fault, InputRefused, raised_as
from engage_hri.schemas.units import Seconds
from engage_hri.services.runtime.installation import extra_command

Image = NDArray[np.uint8]
"""Rows of pixels, red, green and blue."""
PATIENCE: Seconds = 1.5
"""Time of black or unchanged pictures from which on a camera is taken to see nothing."""
BLACK = 6.0
"""Mean of a picture, of 255, below which it is black, if nothing in it is brighter than `GLIMMER`."""
GLIMMER = 40
KINDS = (".png", ".jpg", ".jpeg", ".bmp", ".ppm", ".webp")
"""Ends of the names of pictures in a folder."""


class PictureSettings(Struct, frozen=True, kw_only=True):
    """Settings of pictures. path: file or folder; empty of a camera. device, rate, width, height: as in
    `AttachedCamera`."""

    path: str = ""
    device: int = 0
    rate: float = 15.0
    width: int = 640
    height: int = 480


class CameraBlind(EngageError):
    """A camera that gives nothing that can be seen."""


class Blindness:
    """Watch over a camera: does it see? No noise is the same twice, so an unchanged picture is an old one."""

    def __init__(self, where: str) -> None:
        """where: setting of the source."""
        self._where = where
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
            raise CameraBlind(Fault(reason=reason, where=self._where, advice=advice))
        return True


class Pictures(ABC):
    """Pictures, one after the other. settings: of them. sense: section of the settings, for what is wrong."""

    def __init__(self, settings: PictureSettings, sense: str) -> None:
        """Open them. Raises InputRefused, CameraBlind."""
        self._settings, self._sense, self._cv2 = settings, sense, opencv(sense)

    @abstractmethod
    def taken(self) -> Iterator[tuple[Image, Seconds]]:
        """Take each, with its instant: of a camera of the clock of this machine, else from the beginning."""


class CameraPictures(Pictures):
    """Pictures of a camera of this machine."""

    def __init__(self, settings: PictureSettings, sense: str) -> None:
        super().__init__(settings, sense)
        self._camera = self._cv2.VideoCapture(settings.device)
        if not self._camera.isOpened():
            reason = f"no camera {settings.device} can be opened"
            advice = f"is it plugged in, allowed, and not in use? {sense}.device counts cameras; or --from film:PATH"
            raise CameraBlind(Fault(reason=reason, where=f"{sense}.device", advice=advice))
        for name, value in (("FRAME_WIDTH", settings.width), ("FRAME_HEIGHT", settings.height), ("BUFFERSIZE", 1)):
            self._camera.set(getattr(self._cv2, f"CAP_PROP_{name}"), value)

    def taken(self) -> Iterator[tuple[Image, Seconds]]:
        """Take pictures until the camera gives none. Raises CameraBlind."""
        blindness, due = Blindness(f"{self._sense}.source"), float("-inf")
        while self._camera.grab():
            at = time.monotonic()
            if at < due:
                continue
            due = max(due + 1 / self._settings.rate, at)
            is_taken, image = self._camera.retrieve()
            if is_taken:
                image = self._cv2.cvtColor(image, self._cv2.COLOR_BGR2RGB)
                if not blindness.is_blind(image, at):
                    yield image, at
        reason, advice = "the camera gives no picture any more", "is it plugged in?"
        raise CameraBlind(Fault(reason=reason, where=f"{self._sense}.source", advice=advice))


class FilmPictures(Pictures):
    """Pictures of a film, or of a folder, in the order of their names."""

    def __init__(self, settings: PictureSettings, sense: str) -> None:
        super().__init__(settings, sense)
        self._path = Path(settings.path)
        if not settings.path or not self._path.exists():
            raise _refused(self._path, "there is no such file")
        self._names = sorted(each for each in self._path.glob("*") if each.suffix.lower() in KINDS)
        if self._path.is_dir():
            if not self._names:
                raise _refused(self._path, "no picture is in this folder")
        elif not self._cv2.VideoCapture(str(self._path)).isOpened():
            raise _refused(self._path, "it is no film that OpenCV can read")

    def taken(self) -> Iterator[tuple[Image, Seconds]]:
        """Take all of them."""
        for image, at in self._pictures() if self._names else self._frames():
            yield self._cv2.cvtColor(image, self._cv2.COLOR_BGR2RGB), at

    def _pictures(self) -> Iterator[tuple[Image, Seconds]]:
        for number, name in enumerate(self._names):
            if (image := self._cv2.imread(str(name))) is None:
                raise _refused(name, "it is no picture that OpenCV can read")
            yield image, number / self._settings.rate

    def _frames(self) -> Iterator[tuple[Image, Seconds]]:
        film = self._cv2.VideoCapture(str(self._path))
        rate = film.get(self._cv2.CAP_PROP_FPS) or self._settings.rate
        number = 0
        while True:
            is_taken, image = film.read()
            if not is_taken:
                return
            yield image, number / rate
            number += 1


def opencv(sense: str) -> Any:
    """Import OpenCV for a sense. Raises InputRefused: it is not installed."""
    with raised_as(InputRefused, ImportError, f"{sense}.source", advice=extra_command("eyes")):
        import cv2
    return cv2


def _refused(path: Path, reason: str) -> InputRefused:
    return InputRefused(Fault(reason=reason, where=str(path)))
