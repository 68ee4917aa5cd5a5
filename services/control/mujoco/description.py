"""Descriptions of other people's robots: which joints of a model are head, arms and trunk, where eyes and hands are.

A description is a TOML file. It names a model, a URDF or an MJCF file, which may lie inside an installed package
 (`icub-models:share/iCub/robots/iCubGazeboV2_7/model.urdf`). `docs/mujoco.md` shows one.
"""

from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, files
from pathlib import Path

import msgspec
from msgspec import Struct

from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.units import Degrees, Meters, Vector
from engage_hri.services.runtime.installation import packages_command


class Place(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A point on a body of the model. at: in the frame of that body. axis: of eyes, where they look in that frame."""

    body: str
    at: Vector = (0.0, 0.0, 0.0)
    axis: Vector = (1.0, 0.0, 0.0)


class PartDescription(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Joints of a part. speed, acceleration: of a lively motion, degrees per second, and per second squared."""

    joints: tuple[str, ...]
    speed: Degrees = 120.0
    acceleration: Degrees = 900.0


class HeadDescription(PartDescription, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Head. eyes: the point between them, with the axis along which they look."""

    eyes: Place
    speed: Degrees = 200.0
    acceleration: Degrees = 2000.0


class ArmDescription(PartDescription, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Arm. elbow, hand: ends of the forearm; it points from the one through the other, a fingertip."""

    elbow: Place
    hand: Place


class Description(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A robot. A part that it does not have is left out, and with it the types of behaviors that need it.

    name: as the robot is called. model: URDF or MJCF; relative to the description, or `PACKAGE:PATH` of an installed
    package. position, yaw: where the model stands, so that it looks along x at the table. home: angles of the safe
    pose, degrees, 0 unless given. stiffness: of its servos, as the frequency in Hz at which they would swing.
    """

    name: str
    model: str
    position: Vector = (0.0, 0.0, 0.0)
    yaw: Degrees = 0.0
    home: Mapping[str, Degrees] = {}
    stiffness: float = 10.0
    reach: Meters = 1.5
    head: HeadDescription | None = None
    left_arm: ArmDescription | None = None
    right_arm: ArmDescription | None = None
    torso: PartDescription | None = None

    @property
    def parts(self) -> dict[str, PartDescription]:
        """Descriptions of the parts that it has."""
        found = {"head": self.head, "left_arm": self.left_arm, "right_arm": self.right_arm, "torso": self.torso}
        return {name: part for name, part in found.items() if part is not None}


def read(file: Path) -> tuple[Description, Path]:
    """Read a description. Returns it with the path of its model. Raises InputRefused."""
    try:
        text = file.read_bytes()
    except OSError as error:
        raise _refused(
            error.strerror or str(error), file, "a relative path counts from the folder of the process"
        ) from error
    try:
        described = msgspec.toml.decode(text, type=Description)
    except msgspec.MsgspecError as error:
        raise _refused(str(error), file, "docs/mujoco.md says what a description has") from error
    used = [joint for part in described.parts.values() for joint in part.joints]
    if twice := [joint for joint in dict.fromkeys(used) if used.count(joint) > 1]:
        raise _refused(f"two parts have the joint {twice[0]!r}", file, "a joint belongs to one part")
    return described, _model(described.model, file)


def _model(model: str, file: Path) -> Path:
    package, colon, tail = model.partition(":")
    if not colon or len(package) == 1:  # a drive letter is no package
        path = file.parent / model
        if not path.is_file():
            raise _refused(f"no model {path}", file, "its path counts from the folder of the description")
        return path
    try:
        owned = files(package) or []
    except PackageNotFoundError:
        raise _refused(f"no package {package!r}", file, packages_command(package)) from None
    for each in owned:
        if each.as_posix().endswith(tail):
            return Path(str(each.locate())).resolve()
    raise _refused(f"{package} has no file that ends in {tail!r}", file, "pip show -f lists its files")


def _refused(reason: str, file: Path, advice: str) -> InputRefused:
    return InputRefused(Fault(reason=reason, where=str(file), advice=advice, service="control"))
