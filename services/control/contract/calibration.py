"""Calibration of a body: how far its joints are beside, and how well looks and points are known. Thesis 5.4.3. Pure.

    [offsets]                   # degrees to be added to what a joint measures
    right_shoulder_yaw = 3.98

    [errors]                    # degrees within which a part looks or points where it says, 19 times in 20
    right_arm = 0.4

`engage calibrate body` writes such a file. One with [errors] alone, by hand, says how far a robot may be beside that
nobody has calibrated.
"""

import math
from collections.abc import Mapping, Sequence
from math import radians
from pathlib import Path

import msgspec
from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.body import Estimate, Ray
from engage_hri.schemas.faults import InputRefused, raised_as
from engage_hri.schemas.text import utf8
from engage_hri.schemas.units import Degrees, Radians
from engage_hri.services.control.contract.body import Body

PARTS = ("head", "left_arm", "right_arm")
"""Parts that look or point."""
WIDEST: Degrees = 80.0


class Calibration(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A calibration as its file has it. offsets: by joint. errors: by part."""

    offsets: Mapping[str, Degrees] = {}
    errors: Mapping[str, Degrees] = {}

    def __post_init__(self) -> None:
        for part, error in self.errors.items():
            if part not in PARTS:
                raise ValueError(f"errors.{part}: expected one of {', '.join(PARTS)}")
            if not 0.0 <= error <= WIDEST:
                raise ValueError(f"errors.{part} is {error}: expected 0..{WIDEST:g} degrees")
        for joint, offset in self.offsets.items():
            if not math.isfinite(offset):
                raise ValueError(f"offsets.{joint} is {offset}: expected degrees")

    @property
    def radians(self) -> dict[str, Radians]:
        """The offsets in radians."""
        return {joint: radians(offset) for joint, offset in self.offsets.items()}

    def widened(self, ray: Ray | None, part: str) -> Ray | None:
        """A ray of a part, with how far it may be beside; one that says more itself stays."""
        error = radians(self.errors.get(part, 0.0))
        return ray if ray is None or ray.error >= error else replace(ray, error=error)

    def stated(self, estimate: Estimate) -> Estimate:
        """An estimate whose ray says how far it may be beside."""
        part = next((part for part in estimate.parts if part in self.errors), "")
        return replace(estimate, ray=self.widened(estimate.ray, part)) if estimate.ray and part else estimate


def calibrated(body: Body, file: str) -> Calibration:
    """Correct a body by a file, and return what is in it. file: empty: nothing changes. Raises InputRefused."""
    calibration = read(file)
    body.calibrate(calibration.radians)
    return calibration


def read(file: str) -> Calibration:
    """Read a file; empty: one that changes nothing. Raises InputRefused."""
    if not file:
        return Calibration()
    advice = "it is in `control.calibration`; `engage calibrate body` makes one"
    with raised_as(InputRefused, OSError, file, advice=advice), raised_as(InputRefused, msgspec.DecodeError, file):
        return msgspec.toml.decode(utf8(Path(file).read_bytes(), file), type=Calibration)


def written(calibration: Calibration, body: str, comments: Mapping[str, Sequence[str]]) -> str:
    """The text of a file. body: name of the body. comments: lines by part."""
    lines = [f"# Made by `engage calibrate body` of the body {body!r}; `control.calibration` names this file."]
    lines += ["", "[offsets]  # degrees to be added to what a joint measures"] if calibration.offsets else []
    lines += [f"{joint} = {offset:.3f}" for joint, offset in calibration.offsets.items()]
    lines += ["", "[errors]  # degrees within which a part looks or points where it says, 19 times in 20"]
    for part, error in calibration.errors.items():
        lines += [f"# {comment}" for comment in comments.get(part, ())]
        lines.append(f"{part} = {error:.3f}")
    return "\n".join(lines) + "\n"
