"""Sources that look at pictures: a camera, and a film; faces by `litert.py`."""

from collections.abc import Iterator
from pathlib import Path

from engage_hri.schemas.perception import FaceLandmarks
from engage_hri.schemas.units import Stamp
from engage_hri.services.perception.eyes.looking import LandmarkSource, SourceSettings, packed
from engage_hri.services.perception.eyes.sources.litert import FaceFinder
from engage_hri.services.perception.pictures import CameraPictures, FilmPictures, Pictures


class _PictureSource(LandmarkSource):
    """Pictures, and faces in them."""

    pictures: type[Pictures]

    def __init__(self, settings: SourceSettings) -> None:
        super().__init__(settings)
        self._pictures = self.pictures(settings, "eyes")
        self._finder = FaceFinder(Path(settings.models), settings.most_faces)

    def look(self) -> Iterator[FaceLandmarks]:
        for image, at in self._pictures.taken():
            height, width = image.shape[:2]
            faces = tuple(packed(points, confidence) for points, confidence in self._finder.find(image))
            yield FaceLandmarks(at=Stamp("", at), width=width, height=height, faces=faces)


class CameraSource(_PictureSource):
    """A camera of this machine."""

    is_live, pictures = True, CameraPictures


class FilmSource(_PictureSource):
    """A film, or a folder with pictures in the order of their names."""

    is_live, pictures = False, FilmPictures
