"""Settings of the driver `mujoco`: `control.drivers.mujoco` of the configuration."""

from typing import Literal

from msgspec import Struct

from engage_hri.schemas.body_faults import BodyFault


class MujocoSettings(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings of a body with physics.

    robot: description of a robot of your own (docs/mujoco.md); empty: the torso. faults: with which it starts.
    film: file into which it is filmed while it runs, drawn at the end: .mp4, .webp, .gif, or .png for a sheet.
    view: where the camera stands. rate: pictures a second. size: of a picture, pixels.
    seed: of noisy encoders.
    """

    robot: str = ""
    faults: tuple[BodyFault, ...] = ()
    film: str = ""
    view: Literal["side", "shoulder", "above"] = "side"
    rate: float = 12.0
    size: tuple[int, int] = (720, 540)
    seed: int = 0

    def __post_init__(self) -> None:
        if not 1.0 <= self.rate <= 60.0:
            raise ValueError(f"rate is {self.rate}: expected 1..60 pictures a second")
        if not all(64 <= each <= 1920 for each in self.size):
            raise ValueError(f"size is {self.size}: expected 64..1920 pixels")
