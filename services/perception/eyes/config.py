"""Settings of eyes: which source, and where its camera stands."""

from math import isfinite

from msgspec import Struct

from engage_hri.schemas.units import Degrees, Vector, positive

PAGE = "page"
"""Source that is no device: the cameras of those who sit at pages of windows."""


class EyesConfig(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings of eyes. Raises ValueError if out of range."""

    source: str = "camera"
    """The landmarks: `camera`; `page`: the cameras of all who sit at pages of windows; `film:PATH`, a film or a
    folder of pictures; `landmarks:FILE`, those of a recording; or the name of another package's source, with a path
    behind a colon if it takes one."""
    device: int = 0
    """Number of the camera, as the system counts them."""
    rate: float = 15.0
    """Pictures in a second: of a camera at most, of a folder of pictures."""
    width: int = 640
    """Pixels that a camera is asked for."""
    height: int = 480
    """Height of the pictures of a camera, in pixels."""
    most_faces: int = 4
    """Faces at once."""
    field_of_view: Degrees = 60.0
    """What the camera sees from the left edge of its picture to the right."""
    place: Vector = (0.05, 0.0, 1.17)
    """Place of the camera, in the robot's frame; that of a page counts as being there."""
    tilt: Degrees = 0.0
    """Up from the horizontal; down: below 0. Of a page nobody needs it, nor `pan`: who sits there has a place."""
    pan: Degrees = 0.0
    """To the robot's left from ahead."""

    def __post_init__(self) -> None:
        positive(self, ("rate", "width", "height", "most_faces", "field_of_view"))
        for name in ("tilt", "pan", "field_of_view"):
            value = getattr(self, name)
            if not isfinite(value) or abs(value) >= 180:
                raise ValueError(f"{name} must be between -180 and 180 degrees, not {value}")
