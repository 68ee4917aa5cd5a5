"""Settings of what sees pieces: which source, where its camera stands, and what lies on the table."""

from engage_hri.schemas.units import Degrees
from engage_hri.services.perception.attached import AttachedCamera


class PiecesConfig(AttachedCamera, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings of what sees pieces. Raises ValueError if out of range."""

    source: str = "camera"
    """The pictures: `camera`; `film:PATH`, a film or a folder of pictures; or the name of another package's source,
    with a path behind a colon if it takes one."""
    task: str = "tangram"
    """The table and its pieces: the name of a task that an installed package offers, or a file."""
    colors: str = "colors.toml"
    """The colors of the pieces, a file of `engage calibrate colors`."""
    rate: float = 5.0
    width: int = 1280
    height: int = 720
    field_of_view: Degrees = 70.0
    tilt: Degrees = -38.0
