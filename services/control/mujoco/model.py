# ruff: noqa: E501 - XML
"""The torso at its table as a MuJoCo model: the XML, made from the kinematics and from the tangram table. Pure.

Joints, lengths and ranges are those of `torso.kinematics`; masses, motors and gears are of a robot of this size made
of hobby parts. Arms and nose collide with things (table, pieces, obstacles); things with each other; the robot not
with itself: its joint limits see to that.
"""

import math
from collections.abc import Iterable, Iterator

from engage_hri.schemas.units import Meters, Seconds, Vector
from engage_hri.services.control.figure import kinematics
from engage_hri.services.control.mujoco.physics import Motor
from engage_hri.services.tangram.table import Piece, TangramTable

STEP: Seconds = 0.002
"""Time step of the physics."""
SLACK = math.radians(1.5)
"""Radians by which a joint may leave the range in which motions are planned, with what its end stop yields."""
END_STOP = "0.99 0.999 0.001"
"""Impedance of the end stops of joints; their time constant is two steps, the shortest that MuJoCo takes."""
YIELDING = math.radians(0.5)
"""Radians by which an end stop yields to what falls onto it."""
AWAY: Meters = -5.0
"""Height at which obstacles wait."""
BOARD: Meters = 0.01
"""Half the thickness of the board that makes the table higher."""
THICKNESS: Meters = 0.012
"""Of a tangram piece."""
SKIN: Meters = 0.008
"""Radius of the forearm that collides. Its axis may come as near to the table as `kinematics.CLEARANCE`."""
COLORS = {
    "orange": "0.95 0.52 0.12", "white": "0.95 0.95 0.92", "blue": "0.16 0.36 0.82", "green": "0.18 0.62 0.30",
    "purple": "0.52 0.26 0.68", "red": "0.84 0.16 0.16", "pink": "0.95 0.48 0.66", "yellow": "0.96 0.82 0.18",
}  # fmt: skip
OBSTACLES: dict[str, tuple[tuple[Vector, Vector], ...]] = {
    "left_arm": (((0.285, 0.14, 0.90), (0.012, 0.16, 0.17)),),
    "right_arm": (((0.285, -0.14, 0.90), (0.012, 0.16, 0.17)),),
    "head": (((0.125, 0.075, 1.17), (0.03, 0.012, 0.10)), ((0.125, -0.075, 1.17), (0.03, 0.012, 0.10))),
    "torso": (((0.15, 0.0, 0.84), (0.02, 0.10, 0.06)),),
}
"""What stands in the way of a part, once a fault puts it there: middle and half the size of boxes."""


NECK_MOTOR = Motor(stiffness=160, damping=4.0, limit=12, friction=0.05, drag=0.05, armature=0.01, speed=6.0)
MOTORS = {
    "torso_turn": Motor(stiffness=4000, damping=70, limit=150, friction=1.0, drag=1.0, armature=0.2, speed=0.8),
    "torso_lean": Motor(stiffness=6000, damping=140, limit=260, friction=1.0, drag=1.0, armature=0.2, speed=0.8),
    "neck_yaw": NECK_MOTOR,
    "neck_pitch": NECK_MOTOR,
    "neck_roll": NECK_MOTOR,
    **{
        f"{side}_{name}": motor
        for side in ("left", "right")
        for name, motor in {
            "shoulder_yaw": Motor(
                stiffness=250, damping=9.0, limit=14, friction=0.15, drag=0.2, armature=0.02, speed=2.6
            ),
            "shoulder_pitch": Motor(
                stiffness=250, damping=9.0, limit=14, friction=0.15, drag=0.2, armature=0.02, speed=2.6
            ),
            "elbow": Motor(stiffness=160, damping=5.0, limit=8, friction=0.1, drag=0.1, armature=0.015, speed=2.6),
        }.items()
    },
}
"""Motor of each joint that is part of the physics. The face is a screen: it is there at once."""
MASSES = {"torso": 11.0, "head": 1.8, "upper_arm": 0.7, "forearm": 0.45, "hand": 0.12}


def scene(table: TangramTable) -> str:
    """The torso at its table as XML: with pieces at their starting places, the person, and obstacles under the floor."""
    return room(table, "".join(_obstacles()) + _robot(), "".join(map(_actuator, MOTORS)))


def room(table: TangramTable, robot: str = "", actuators: str = "") -> str:
    """A room with the table, its pieces and the person, as XML. robot: bodies in it."""
    return f"""<mujoco model="engage torso">
<option timestep="{STEP}" integrator="implicitfast" cone="elliptic"><flag sleep="enable"/></option>
<size memory="4M"/>
<visual>
 <headlight ambient="0.34 0.34 0.36" diffuse="0.28 0.28 0.28" specular="0.1 0.1 0.1"/>
 <quality shadowsize="2048" offsamples="4"/>
 <map znear="0.02" shadowclip="1.6" haze="0.35"/>
 <rgba haze="0.80 0.85 0.90 1"/>
 <global offwidth="1920" offheight="1080" fovy="42"/>
</visual>
<asset>
 <texture type="skybox" builtin="gradient" rgb1="0.86 0.90 0.94" rgb2="0.62 0.70 0.80" width="64" height="64"/>
 <texture name="floor" type="2d" builtin="checker" rgb1="0.74 0.76 0.78" rgb2="0.70 0.72 0.74" width="256" height="256"/>
 <texture name="wood" type="2d" builtin="flat" rgb1="0.79 0.66 0.50" rgb2="0.72 0.58 0.42" mark="random"
  markrgb="0.74 0.60 0.44" random="0.02" width="256" height="256"/>
 <material name="floor" texture="floor" texrepeat="6 6" reflectance="0.04"/>
 <material name="wood" texture="wood" texrepeat="1 1" specular="0.25" shininess="0.4"/>
 <material name="shell" rgba="0.93 0.94 0.96 1" specular="0.5" shininess="0.6"/>
 <material name="dark" rgba="0.16 0.18 0.22 1" specular="0.4" shininess="0.5"/>
 <material name="accent" rgba="0.10 0.52 0.62 1" specular="0.5" shininess="0.6"/>
 <material name="glow" rgba="0.45 0.90 1 1" emission="0.9"/>
{"".join(_meshes(table.pieces))}</asset>
<default>
 <default class="thing"><geom contype="2" conaffinity="3" friction="0.6 0.005 0.0001"/></default>
 <default class="looks"><geom contype="0" conaffinity="0" group="1" mass="0"/></default>
 <default class="skin"><geom contype="1" conaffinity="0" group="3" mass="0" friction="0.5 0.005 0.0001" rgba="1 0 0 0.4"/></default>
 <default class="weight"><geom contype="0" conaffinity="0" group="4" rgba="0 1 0 0.3"/></default>
</default>
<worldbody>
 <light pos="0.5 0.9 3" dir="0.05 -0.3 -1" directional="true" castshadow="true" diffuse="0.62 0.60 0.56" specular="0.3 0.3 0.3"/>
 <light pos="1.6 -1.2 2.2" dir="-0.6 0.5 -1" castshadow="false" diffuse="0.22 0.24 0.28" specular="0 0 0"/>
 <geom name="floor" type="plane" size="4 4 0.1" material="floor" contype="2" conaffinity="3"/>
{_table(table)}{_person(table)}{robot}{"".join(map(_piece, table.pieces))}</worldbody>
<actuator>
{actuators}</actuator>
</mujoco>
"""


def _table(table: TangramTable) -> str:
    (x, y, top), corners = table.surface.center, table.surface.footprint
    half_x, half_y = max(corner[0] for corner in corners), max(corner[1] for corner in corners)
    legs = "".join(
        f'  <geom class="looks" type="cylinder" pos="{sx * (half_x - 0.05)} {sy * (half_y - 0.05)} {-top / 2 - 0.02}"'
        f' size="0.022 {top / 2 - 0.02}" material="dark"/>\n'
        for sx in (-1, 1)
        for sy in (-1, 1)
    )
    return f""" <body name="table" pos="{x} {y} {top}">
  <geom name="table" class="thing" type="box" pos="0 0 -0.015" size="{half_x} {half_y} 0.015" material="wood"/>
{legs} </body>
 <body name="high table" mocap="true" pos="{x} {y} {AWAY}">
  <geom name="high table" class="thing" type="box" size="{half_x} {half_y} {BOARD}" material="wood"/>
 </body>
"""


def _person(table: TangramTable) -> str:
    """The person across the table, who is only seen: nothing touches them."""
    (x, y, z), left, right = table.person.face, table.person.left_hand, table.person.right_hand
    skin, cloth = 'rgba="0.86 0.66 0.54 1"', 'rgba="0.36 0.44 0.62 1"'
    arms = "".join(
        f'  <geom class="looks" type="capsule" fromto="{x + 0.04} {y + side * 0.19} {z - 0.27}'
        f' {hand[0] + 0.1} {hand[1] * 1.35} {hand[2] + 0.02}" size="0.042" {cloth}/>\n'
        f'  <geom class="looks" type="capsule" fromto="{hand[0] + 0.1} {hand[1] * 1.35} {hand[2] + 0.02}'
        f' {hand[0]} {hand[1]} {hand[2] + 0.06}" size="0.034" {cloth}/>\n'
        f'  <geom class="looks" type="sphere" pos="{hand[0] - 0.03} {hand[1]} {hand[2] + 0.07}" size="0.04" {skin}/>\n'
        for hand, side in ((left, -1), (right, 1))
    )
    return f""" <body name="person">
  <geom class="looks" type="ellipsoid" pos="{x} {y} {z}" size="0.095 0.08 0.12" {skin}/>
  <geom class="looks" type="ellipsoid" pos="{x + 0.03} {y} {z + 0.045}" size="0.09 0.086 0.09" rgba="0.24 0.17 0.13 1"/>
  <geom class="looks" type="sphere" pos="{x - 0.085} {y - 0.033} {z + 0.012}" size="0.013" rgba="0.1 0.1 0.12 1"/>
  <geom class="looks" type="sphere" pos="{x - 0.085} {y + 0.033} {z + 0.012}" size="0.013" rgba="0.1 0.1 0.12 1"/>
  <geom class="looks" type="cylinder" pos="{x + 0.02} {y} {z - 0.15}" size="0.045 0.06" {skin}/>
  <geom class="looks" type="ellipsoid" pos="{x + 0.05} {y} {z - 0.46}" size="0.13 0.20 0.30" {cloth}/>
{arms} </body>
"""


def _obstacles() -> Iterator[str]:
    """Boxes under the floor, until they are put in the way."""
    for part, boxes in OBSTACLES.items():
        for number, (_, size) in enumerate(boxes):
            name = f"obstacle {part} {number}"
            yield (
                f' <body name="{name}" mocap="true" pos="{3 + number} 0 {AWAY}">\n'
                f'  <geom name="{name}" class="thing" type="box" size="{_numbers(size)}" rgba="0.75 0.2 0.15 0.8"/>\n'
                " </body>\n"
            )


def _robot() -> str:
    hip, neck = kinematics.HIP, kinematics.NECK
    up = neck[2] - hip[2]
    return f""" <geom class="looks" type="cylinder" pos="0 0 0.28" size="0.10 0.28" material="dark"/>
 <geom class="looks" type="cylinder" pos="0 0 0.02" size="0.24 0.02" material="dark"/>
 <body name="torso" pos="{_numbers(hip)}">
  {_joint("torso_turn", "0 0 1")}
  {_joint("torso_lean", "0 1 0")}
  <geom class="weight" type="box" pos="0 0 0.2" size="0.08 0.14 0.2" mass="{MASSES["torso"]}"/>
  <geom class="skin" name="belly" type="box" pos="0 0 0.24" size="0.10 0.12 0.16"/>
  <geom class="looks" type="ellipsoid" pos="0 0 0.05" size="0.115 0.13 0.10" material="dark"/>
  <geom class="looks" type="ellipsoid" pos="-0.005 0 0.25" size="0.115 0.155 0.19" material="shell"/>
  <geom class="looks" type="capsule" fromto="0 -0.17 {up - 0.15} 0 0.17 {up - 0.15}" size="0.062" material="shell"/>
  <geom class="looks" type="ellipsoid" pos="0.085 0 0.30" size="0.035 0.06 0.06" material="accent"/>
  <geom class="looks" type="cylinder" pos="0 0 {up - 0.06}" size="0.045 0.06" material="dark"/>
  <body name="head" pos="0 0 {up}">
   {_joint("neck_yaw", "0 0 1")}
   {_joint("neck_pitch", "0 -1 0")}
   {_joint("neck_roll", "-1 0 0")}
   <geom class="weight" type="ellipsoid" pos="0.01 0 0.07" size="0.10 0.08 0.10" mass="{MASSES["head"]}"/>
   <geom class="skin" name="nose" type="capsule" fromto="0.10 0 0.04 0.13 0 0.04" size="0.02"/>
   <geom class="looks" type="ellipsoid" pos="-0.005 0 0.075" size="0.102 0.092 0.112" material="shell"/>
   <geom class="looks" type="ellipsoid" pos="0.022 0 0.072" size="0.083 0.074 0.084" material="dark"/>
   <geom class="looks" type="cylinder" pos="-0.01 0.092 0.075" euler="90 0 0" size="0.034 0.012" material="accent"/>
   <geom class="looks" type="cylinder" pos="-0.01 -0.092 0.075" euler="90 0 0" size="0.034 0.012" material="accent"/>
{_face()}   <site name="eyes" pos="{kinematics.EYES_AHEAD} 0 {kinematics.EYES_ABOVE}" size="0.004" group="5"/>
  </body>
{_arm("left")}{_arm("right")} </body>
"""


def _face() -> str:
    """The face as a screen shows it. `face.py` moves these for a picture."""
    sides = "".join(
        f'   <geom class="looks" name="{side}_eye" type="ellipsoid" pos="0.094 {y} 0.088" size="0.008 0.014 0.017" material="glow"/>\n'
        f'   <geom class="looks" name="{side}_brow" type="capsule" pos="0.098 {y} 0.118" euler="90 0 0" size="0.0035 0.013" material="glow"/>\n'
        f'   <geom class="looks" name="{side}_mouth" type="capsule" pos="0.098 {y / 2} 0.035" euler="90 0 0" size="0.0035 0.012" material="glow"/>\n'
        for side, y in (("left", 0.030), ("right", -0.030))
    )
    return (
        sides
        + '   <geom class="looks" name="jaw" type="capsule" pos="0.092 0 0.028" euler="90 0 0" size="0.0035 0.012" material="glow"/>\n'
    )


def _arm(side: kinematics.Side) -> str:
    shoulder, hip = kinematics.SHOULDER[side], kinematics.HIP
    at = (shoulder[0] - hip[0], shoulder[1] - hip[1], shoulder[2] - hip[2])
    upper, lower = kinematics.UPPER_ARM, kinematics.FOREARM
    return f"""  <body name="{side}_upper_arm" pos="{_numbers(at)}">
   {_joint(f"{side}_shoulder_yaw", "0 0 1")}
   {_joint(f"{side}_shoulder_pitch", "0 -1 0")}
   <geom class="weight" type="capsule" fromto="0 0 0 0 0 {-upper}" size="0.03" mass="{MASSES["upper_arm"]}"/>
   <geom class="looks" type="sphere" size="0.058" material="accent"/>
   <geom class="looks" type="capsule" fromto="0 0 -0.02 0 0 {-upper}" size="0.036" material="shell"/>
   <body name="{side}_forearm" pos="0 0 {-upper}">
    {_joint(f"{side}_elbow", "0 -1 0")}
    <geom class="weight" type="capsule" fromto="0 0 0 0 0 -0.17" size="0.025" mass="{MASSES["forearm"]}"/>
    <geom class="weight" type="sphere" pos="0 0 -0.2" size="0.025" mass="{MASSES["hand"]}"/>
    <geom class="skin" name="{side}_forearm" type="capsule" fromto="0 0 0 0 0 {-lower + SKIN}" size="{SKIN}"/>
    <geom class="looks" type="sphere" size="0.04" material="dark"/>
    <geom class="looks" type="capsule" fromto="0 0 -0.03 0 0 -0.15" size="0.030" material="shell"/>
    <geom class="looks" type="ellipsoid" pos="0 0 -0.185" size="0.030 0.022 0.034" material="dark"/>
    <geom class="looks" type="capsule" fromto="0 0 -0.20 0 0 {-lower + 0.010}" size="0.010" material="accent"/>
    <site name="{side}_elbow" size="0.004" group="5"/>
    <site name="{side}_hand" pos="0 0 {-lower}" size="0.004" group="5"/>
   </body>
  </body>
"""


def _joint(name: str, axis: str) -> str:
    limit, motor = kinematics.LIMIT[name], MOTORS[name]
    slack = SLACK - YIELDING
    low, high = math.degrees(limit.low - slack), math.degrees(limit.high + slack)
    return (
        f'<joint name="{name}" axis="{axis}" range="{low:.3f} {high:.3f}" damping="{motor.drag}"'
        f' frictionloss="{motor.friction}" armature="{motor.armature}" solreflimit="{2 * STEP:g} 1"'
        f' solimplimit="{END_STOP}"/>'
    )


def _actuator(joint: str) -> str:
    motor = MOTORS[joint]
    return (
        f' <position name="{joint}" joint="{joint}" kp="{motor.stiffness}" kv="{motor.damping}"'
        f' forcerange="{-motor.limit} {motor.limit}"/>\n'
    )


def _meshes(pieces: Iterable[Piece]) -> Iterator[str]:
    for piece in pieces:
        if piece.shape not in ("square", "rectangle"):
            vertices = " ".join(f"{x} {y} {z}" for z in (-THICKNESS / 2, THICKNESS / 2) for x, y in piece.footprint)
            yield f' <mesh name="{piece.id}" vertex="{vertices}"/>\n'


def _piece(piece: Piece) -> str:
    """A piece on the table. Of MuJoCo's frame of a mesh, which is its middle and main axes, nobody needs to know."""
    rgba = f'rgba="{COLORS.get(piece.color, "0.6 0.6 0.6")} 1"'
    if piece.shape in ("square", "rectangle"):
        half = [max(abs(corner[axis]) for corner in piece.footprint) for axis in (0, 1)]
        form = f'type="box" size="{half[0]} {half[1]} {THICKNESS / 2}"'
    else:
        form = f'type="mesh" mesh="{piece.id}"'
    return f""" <body name="{piece.id}" pos="{piece.start.x} {piece.start.y} {kinematics.TABLE_TOP + THICKNESS / 2}"
  euler="0 0 {piece.start.yaw}">
  <freejoint name="{piece.id}"/>
  <geom class="thing" {form} mass="0.02" {rgba}/>
 </body>
"""


def _numbers(values: Iterable[float]) -> str:
    return " ".join(f"{value:g}" for value in values)
