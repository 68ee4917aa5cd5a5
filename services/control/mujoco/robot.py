"""Robots of other people: their descriptions, and their models at the table with position servos.

A description is a TOML file: which joints of a model are head, arms and trunk, where eyes and hands are. It names a
model, a URDF or an MJCF file, which may lie inside an installed package
(`icub-models:share/iCub/robots/iCubGazeboV2_7/model.urdf`). `docs/mujoco.md` shows one.

The feet are fixed, and all joints that are not described are stiff. Its motors are made to its measure: a stiffness
by which each joint would swing at the described frequency, and the torque that a lively motion takes. Its servos
know most of the weight they carry (`CARRIED`), as those of humanoids do.
"""

import math
import re
from collections.abc import Collection, Mapping, Sequence
from importlib.metadata import PackageNotFoundError, files
from pathlib import Path

import msgspec
import mujoco
import numpy as np
from msgspec import Struct

from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.units import Degrees, Meters, Vector
from engage_hri.services.control.mujoco import model
from engage_hri.services.control.mujoco.physics import Motor
from engage_hri.services.runtime.installation import packages_command
from engage_hri.services.tangram.table import TangramTable


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


CARRIED = 0.9
"""Share of the weight that the servos of a described robot know."""
ROTOR = 0.4
"""Inertia of a rotor behind its gear, as a share of that of what the joint moves."""
PREFIX = "robot/"
"""Before the names of the robot's bodies and joints, in the room."""
SLACK = 0.1
"""Degrees by which a safe pose may be beyond a range: models round."""
MESH = re.compile(r'filename\s*=\s*"([^"]+)"')


def assembled(
    described: Description, path: Path, table: TangramTable, file: Path
) -> tuple[mujoco.MjModel, dict[str, Motor]]:
    """The model at the table, and its motors. path: of the model. file: of the description.

    Raises InputRefused: the model lacks something described, or a joint cannot be at home where it is described.
    """
    robot = _loaded(path)
    _check(described, robot, file)
    _prepare(described, robot)
    scene = mujoco.MjSpec.from_string(model.room(table, _pedestal(described)))
    half = math.radians(described.yaw) / 2
    frame = scene.worldbody.add_frame(pos=described.position, quat=(math.cos(half), 0.0, 0.0, math.sin(half)))
    scene.attach(robot, frame=frame, prefix=PREFIX)
    bare = scene.compile()
    _check_home(described, bare, file)
    motors = _motors(described, bare)
    for joint, motor in motors.items():
        servo = scene.add_actuator(name=PREFIX + joint, target=PREFIX + joint, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        servo.set_to_position(kp=motor.stiffness, kv=motor.damping)
        servo.forcelimited, servo.forcerange = 1, (-motor.limit, motor.limit)
        own = scene.joint(PREFIX + joint)
        own.armature, own.frictionloss = motor.armature, motor.friction
        own.damping = np.array([motor.drag, 0.0, 0.0])  # linear in the speed
    return scene.compile(), motors


def _loaded(path: Path) -> mujoco.MjSpec:
    try:
        if path.suffix.lower() != ".urdf":
            return mujoco.MjSpec.from_file(str(path))
        text, assets = _urdf(path)
        spec = mujoco.MjSpec.from_string(text, assets=assets)
        spec.compiler.fusestatic = False
        return spec
    except (ValueError, OSError) as error:
        raise InputRefused(
            Fault(reason=f"MuJoCo cannot read it: {error}", where=str(path), service="control")
        ) from error


def _urdf(path: Path) -> tuple[str, dict[str, bytes]]:
    """A URDF with its meshes by plain names. `package://NAME/...` is looked for in the folders above the file."""
    assets: dict[str, bytes] = {}

    def plain(found: re.Match[str]) -> str:
        tail = found[1].partition("://")[2].partition("/")[2] if "://" in found[1] else found[1]
        file = next((up / tail for up in path.parents if (up / tail).is_file()), None)
        if file is None or file.suffix.lower() not in (".stl", ".obj"):
            return found[0]
        name = tail.replace("/", "-")
        assets[name] = file.read_bytes()
        return f'filename="{name}"'

    text = MESH.sub(plain, path.read_text(encoding="utf-8"))
    options = '<mujoco><compiler discardvisual="false" fusestatic="false" strippath="true"/></mujoco>'
    return re.sub(r"(<robot\b[^>]*>)", rf"\1{options}", text, count=1), assets


def _check(described: Description, robot: mujoco.MjSpec, file: Path) -> None:
    joints, bodies = {each.name for each in robot.joints}, {each.name for each in robot.bodies}
    named = [(f"{part}.joints", joint) for part, each in described.parts.items() for joint in each.joints]
    named += [("home", joint) for joint in described.home]
    _refuse_unknown(named, joints, "joint", file)
    _refuse_unknown([(key, place.body) for key, place in _places(described)], bodies, "body", file)


def _refuse_unknown(named: Sequence[tuple[str, str]], known: Collection[str], kind: str, file: Path) -> None:
    for key, name in named:
        if name not in known:
            advice = f"it has {', '.join(sorted(filter(None, known)))[:600]}"
            reason = f"{key}: the model has no {kind} {name!r}"
            raise InputRefused(Fault(reason=reason, where=str(file), advice=advice, service="control"))


def _check_home(described: Description, model: mujoco.MjModel, file: Path) -> None:
    """Refuse angles of the safe pose that the joints of the parts cannot have. Raises InputRefused."""
    for joint in [joint for part in described.parts.values() for joint in part.joints]:
        one = model.joint(PREFIX + joint)
        angle, low, high = described.home.get(joint, 0.0), *map(math.degrees, one.range)
        if model.jnt_limited[one.id] and not low - SLACK <= angle <= high + SLACK:
            given = "is" if joint in described.home else "is not given, and so"
            reason = f"home.{joint} {given} {angle:g} degrees: expected {low:.1f}..{high:.1f}"
            raise InputRefused(Fault(reason=reason, where=str(file), service="control"))


def _places(described: Description) -> list[tuple[str, Place]]:
    """Places on the robot, each with its key."""
    arms = [(name, arm) for name, arm in described.parts.items() if isinstance(arm, ArmDescription)]
    heads = [("head.eyes", described.head.eyes)] if described.head is not None else []
    return [
        *heads,
        *((f"{name}.elbow", arm.elbow) for name, arm in arms),
        *((f"{name}.hand", arm.hand) for name, arm in arms),
    ]


def _prepare(described: Description, robot: mujoco.MjSpec) -> None:
    """Stiffen the joints that nobody moves, take out motors, and let only arms touch things."""
    moved = {joint for part in described.parts.values() for joint in part.joints}
    for each in (*robot.actuators, *robot.sensors, *robot.keys, *robot.equalities, *robot.tendons):
        robot.delete(each)
    arms = [arm for arm in (described.left_arm, described.right_arm) if arm is not None]
    names = set()
    for arm in arms:
        for body in (robot.joint(arm.joints[0]).parent, *robot.joint(arm.joints[0]).parent.find_all("body")):
            names.add(body.name)
    for joint in list(robot.joints):
        if joint.name not in moved:
            robot.delete(joint)
    for body in robot.bodies:
        body.gravcomp = CARRIED
        for geom in body.geoms:
            is_solid = geom.contype and body.name in names
            has_looks = geom.group != 3
            geom.contype, geom.conaffinity = (1, 0) if is_solid else (0, 0)
            geom.group = geom.group if has_looks else 3


def _motors(described: Description, bare: mujoco.MjModel) -> dict[str, Motor]:
    """Motors to the measure of what they move, in the safe pose. bare: the model without motors."""
    data = mujoco.MjData(bare)
    for joint, angle in described.home.items():
        if mujoco.mj_name2id(bare, mujoco.mjtObj.mjOBJ_JOINT, PREFIX + joint) >= 0:
            data.joint(PREFIX + joint).qpos[0] = math.radians(angle)
    mujoco.mj_forward(bare, data)
    inertia = np.zeros((bare.nv, bare.nv))
    mujoco.mj_fullM(bare, data, inertia)
    motors = {}
    omega = 2 * math.pi * described.stiffness
    for part in described.parts.values():
        for joint in part.joints:
            number = int(bare.joint(PREFIX + joint).dofadr[0])
            moved = max(float(inertia[number, number]), 0.003)
            rotor = ROTOR * moved
            whole = moved + rotor
            weight = abs(float(data.qfrc_bias[number])) + 9.81 * math.sqrt(moved)
            limit = 3 * weight + 2 * whole * math.radians(part.acceleration)
            motors[joint] = Motor(
                stiffness=whole * omega**2, damping=2 * 0.8 * whole * omega, limit=limit, friction=0.004 * limit,
                drag=0.02 * whole * omega, armature=rotor, speed=math.radians(part.speed),
            )  # fmt: skip
    return motors


def _pedestal(described: Description) -> str:
    x, y, _ = described.position
    return f' <geom class="looks" type="cylinder" pos="{x} {y} 0.01" size="0.22 0.01" material="dark"/>\n'
