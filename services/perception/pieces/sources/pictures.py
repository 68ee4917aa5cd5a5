"""Sources that look at pictures of a table: a camera, and a film."""

from collections.abc import Iterator

from engage_hri.schemas.units import Stamp
from engage_hri.services.perception.eyes.camera import StatedCamera
from engage_hri.services.perception.pictures import CameraPictures, FilmPictures, Image, Pictures
from engage_hri.services.perception.pieces.finding import FlatTable, PieceFinder
from engage_hri.services.perception.pieces.spotting import PieceSource, SpottedPieces, TableSettings


class _PictureSource(PieceSource):
    """Pictures, and pieces in them."""

    pictures: type[Pictures]

    def __init__(self, settings: TableSettings) -> None:
        super().__init__(settings)
        self._settings = settings
        self._pictures = self.pictures(settings, "pieces")

    def look(self) -> Iterator[SpottedPieces]:
        size, finder = (0, 0), None
        for image, at in self._pictures.taken():
            if finder is None or image.shape[:2] != size:
                size, finder = image.shape[:2], self._finder(image)
            yield SpottedPieces(at=Stamp("", at), **finder.find(image)._asdict())

    def _finder(self, image: Image) -> PieceFinder:
        of = self._settings
        height, width = image.shape[:2]
        camera = StatedCamera(of.field_of_view, of.place, of.tilt, of.pan, of.roll)
        return PieceFinder(of.table, FlatTable(of.table, camera, width, height), of.palette)


class CameraTable(_PictureSource):
    """A camera of this machine that looks at the table."""

    is_live, pictures = True, CameraPictures


class FilmTable(_PictureSource):
    """A film of a table, or a folder with pictures in the order of their names."""

    is_live, pictures = False, FilmPictures
