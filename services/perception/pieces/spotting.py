"""Sources of pieces: what looks at pictures of a table, and tells where it sees which piece. Pure.

    class MySource(PieceSource):
        def look(self) -> Iterator[SpottedPieces]:
            while pieces := self._table_top.pieces():
                yield SpottedPieces(at=Stamp("", time.monotonic()), pieces=pieces)

It is made in a process of its own, as a source of landmarks is (`eyes/looking.py`), and may block there.

    [project.entry-points."engage.pieces"]
    mine = "my_package.table:MySource"
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator

from msgspec import Struct

from engage_hri.schemas.tables import TaskTable
from engage_hri.schemas.units import Degrees, Meters, Probability, Radians, Stamp, Vector
from engage_hri.services.perception.pictures import PictureSettings
from engage_hri.services.perception.pieces.colors import Palette
from engage_hri.services.perception.pieces.config import PiecesConfig

HEIGHT: Meters = 0.04
"""Height at which a hand over a table is taken to be: one picture does not tell."""


class SpottedPiece(Struct, frozen=True):
    """A piece in a picture. seen: share of it that is in view. spread, turn_spread: standard deviations."""

    id: str
    x: Meters
    y: Meters
    yaw: Radians
    seen: Probability = 1.0
    spread: Meters = 0.001
    turn_spread: Radians = 0.01


class SpottedHand(Struct, frozen=True):
    """A hand over the table in a picture. x, y: its middle. from_x, from_y: where it comes over the edge."""

    x: Meters
    y: Meters
    from_x: Meters
    from_y: Meters


class SpottedPieces(Struct, frozen=True, kw_only=True, tag=True):
    """Pieces that are seen in a picture, and hands. at: when it was taken. bare: ids of those where the table is seen
    now that were seen before. A piece that is neither here nor there is covered."""

    at: Stamp
    pieces: tuple[SpottedPiece, ...] = ()
    bare: tuple[str, ...] = ()
    hands: tuple[SpottedHand, ...] = ()


class TableSettings(PictureSettings, frozen=True, kw_only=True):
    """Settings of a source. table, palette: what lies there, and its colors. field_of_view, place, tilt, pan, roll:
    of the camera, as in `AttachedCamera`."""

    table: TaskTable
    palette: Palette
    field_of_view: Degrees
    place: Vector
    tilt: Degrees
    pan: Degrees
    roll: Degrees


def table_settings(config: PiecesConfig, table: TaskTable, palette: Palette) -> TableSettings:
    """Pick the settings of the source."""
    return TableSettings(
        path=config.source.partition(":")[2], device=config.device, rate=config.rate, width=config.width,
        height=config.height, table=table, palette=palette, field_of_view=config.field_of_view, place=config.place,
        tilt=config.tilt, pan=config.pan, roll=config.roll,
    )  # fmt: skip


class PieceSource(ABC):
    """A source of pieces. is_live: as of `LandmarkSource`."""

    is_live: bool

    def __init__(self, settings: TableSettings) -> None:
        """Open it. Raises InputRefused: there is no such file or device, or a package is missing."""
        super().__init__()

    @abstractmethod
    def look(self) -> Iterator[SpottedPieces]:
        """Look at one picture after the other. A film ends with the last one; a device that gives none any more
        raises an EngageError.
        """
