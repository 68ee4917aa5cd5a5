"""Settings of a camera of a sense: how its pictures come, how many a second, how large, and where it stands."""

from math import isfinite

from msgspec import Struct

from engage_hri.schemas.units import Degrees, Vector, positive


class AttachedCamera(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A camera, without distortion. Raises ValueError if out of range."""

    device: int = 0
    """Number of the camera, as the system counts them."""
    rate: float = 15.0
    """Pictures in a second: of a camera at most, of a folder of pictures."""
    width: int = 640
    """Pixels that a camera is asked for."""
    height: int = 480
    """Height of the pictures of a camera, in pixels."""
    field_of_view: Degrees = 60.0
    """What the camera sees from the left edge of its picture to the right."""
    place: Vector = (0.05, 0.0, 1.17)
    """Place of the camera, in the robot's frame."""
    tilt: Degrees = 0.0
    """Up from the horizontal; down: below 0."""
    pan: Degrees = 0.0
    """To the robot's left from ahead."""
    roll: Degrees = 0.0
    """How far the right edge of the picture hangs down."""

    def __post_init__(self) -> None:
        positive(self, ("rate", "width", "height", "field_of_view"))
        for name in ("tilt", "pan", "roll", "field_of_view"):
            value = getattr(self, name)
            if not isfinite(value) or abs(value) >= 180:
                raise ValueError(f"{name} must be between -180 and 180 degrees, not {value}")
