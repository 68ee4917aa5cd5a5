"""Repertoire of the simulated body: the paths of its lexemes, read from TOML.

A table holds lexemes; each is a path, or the name of another lexeme of its table. Files of a user come after the one
that comes with the body: they add to it or override it. `nearest` says what is performed, with a warning, in place of
a lexeme that the standard defines and the body lacks.
"""

import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from difflib import get_close_matches
from importlib.resources import files
from math import radians
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import msgspec
from msgspec import Meta, Struct

from engage_hri.schemas.behaviors import Hand
from engage_hri.schemas.faults import Fault, InputRefused, raised_as
from engage_hri.schemas.text import utf8
from engage_hri.schemas.units import Degrees
from engage_hri.schemas.vocabulary import is_defined, normal
from engage_hri.services.control.config import ControlConfig
from engage_hri.services.control.figure import kinematics
from engage_hri.services.control.figure.kinematics import Side

Table = Literal["gesture", "head", "face", "facs", "pose", "stance"]
TABLES: tuple[Table, ...] = get_args(Table)
NAMES: Mapping[Table, str] = {
    "gesture": "gesture", "head": "head gesture", "face": "face", "facs": "action unit", "pose": "posture",
    "stance": "stance",
}  # fmt: skip
"""Names of what a table holds, as warnings have them."""
FACE_SIDES: Mapping[str, tuple[str, ...]] = {
    "brows": ("left_brow", "right_brow"),
    "lids": ("left_lid", "right_lid"),
    "mouth_corners": ("left_mouth_corner", "right_mouth_corner"),
}
"""Joints of both sides, by the word that means both."""
ADVICE = "see docs/control.md, Repertoire"
_UNIT = re.compile(r"AU(\d+)")
Share = Annotated[float, Meta(ge=-1, le=1)]


class _Part(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Base of what a file can hold."""


class ArmAngles(_Part, frozen=True, kw_only=True):
    """Angles of an arm. inward: of the shoulder, to the middle. forward: of the upper arm, from hanging down."""

    inward: Degrees
    forward: Degrees
    elbow: Degrees

    def joints(self, side: Side) -> dict[str, float]:
        """Angles of the joints of one arm, in radians."""
        inward = 1.0 if side == "right" else -1.0
        angles = (inward * self.inward, self.forward, self.elbow)
        return dict(zip(kinematics.joints_of(f"{side}_arm"), map(radians, angles), strict=True))


class GesturePath(_Part, frozen=True, kw_only=True):
    """Angles of an arm at three sync points of a gesture. hands: with which, where the author does not say."""

    ready: ArmAngles
    stroke: ArmAngles
    stroke_end: ArmAngles
    hands: Hand | None = None


class HeadWay(_Part, frozen=True, kw_only=True):
    """Shares of the way on each axis of the head: to its left, up, and tilted to its left."""

    left: Share = 0.0
    up: Share = 0.0
    tilt: Share = 0.0


class HeadPath(_Part, frozen=True, kw_only=True):
    """Movement of the head on top of the gaze.

    degrees: the way at amount 0 and at amount 1. hold: it stays there until it relaxes; else it swings.
    back: share of the way to the other side before it repeats. again: factor of the time of a repetition.
    """

    to: HeadWay
    degrees: tuple[Degrees, Degrees] = (4.0, 14.0)
    hold: bool = False
    back: Annotated[float, Meta(ge=0, le=1)] = 0.15
    again: Annotated[float, Meta(ge=0.5, le=4)] = 1.0


class TorsoAngles(_Part, frozen=True, kw_only=True):
    """Angles of the torso: turned to its left, leaning forward."""

    turn: Degrees = 0.0
    lean: Degrees = 0.0

    def joints(self) -> dict[str, float]:
        """Angles of the joints, in radians."""
        return {"torso_turn": radians(self.turn), "torso_lean": radians(self.lean)}


class PosePath(_Part, frozen=True, kw_only=True):
    """Angles of the torso and of the arms, of both or of one; parts that are not given stay where they are."""

    torso: TorsoAngles | None = None
    arms: ArmAngles | None = None
    left_arm: ArmAngles | None = None
    right_arm: ArmAngles | None = None

    def joints(self) -> dict[str, dict[str, float]]:
        """Angles of the joints in radians, by part."""
        found = {"torso": self.torso.joints()} if self.torso else {}
        sides: tuple[Side, ...] = ("left", "right")
        for side in sides:
            if arm := (self.left_arm if side == "left" else self.right_arm) or self.arms:
                found[f"{side}_arm"] = arm.joints(side)
        return found


FacePath = dict[str, Share]
_PATHS: Mapping[Table, Any] = {
    "gesture": GesturePath, "head": HeadPath, "face": FacePath, "facs": FacePath, "pose": PosePath,
    "stance": PosePath,
}  # fmt: skip


class Found(Struct, frozen=True):
    """Path of a lexeme. name: the lexeme that it belongs to. note: the warning if that is only the nearest."""

    path: Any
    name: str
    note: str = ""


class Absent(LookupError):
    """The repertoire has no such lexeme, and none that is near; the message says so."""


class Repertoire:
    """Lexemes of a body, and the nearest for those that it lacks."""

    def __init__(self) -> None:
        self._paths: dict[Table, dict[str, Any]] = {table: {} for table in TABLES}
        """By table and lexeme: a path, or the name of another lexeme."""
        self._nearest: dict[Table, dict[str, str]] = {table: {} for table in TABLES}

    def lexemes(self, table: Table) -> list[str]:
        """List the lexemes of a table, in the order of the files."""
        return list(self._paths[table])

    def extended(self, text: str, file: str) -> "Repertoire":
        """Add the lexemes of a file, each in place of one of the same name. Raises InputRefused with file and key."""
        made = Repertoire()
        for table in TABLES:
            made._paths[table] = dict(self._paths[table])
            made._nearest[table] = dict(self._nearest[table])
        raw = _read(text, file)
        nearest = _table(raw.pop("nearest", {}), "nearest", file)
        own = [
            (_known(name, prefix, file), normal(lexeme), value, f"{prefix}{name}.{lexeme}", bool(prefix))
            for prefix, tables in (("", raw), ("nearest.", nearest))
            for name, content in tables.items()
            for lexeme, value in _table(content, f"{prefix}{name}", file).items()
        ]
        for table, lexeme, value, key, is_near in own:
            if is_near and not isinstance(value, str):
                raise _refusal(f"the name of a lexeme is expected, not {value!r}", key, file)
            into = made._nearest if is_near else made._paths
            into[table][lexeme] = _value(value, table, key, file)
        for table, lexeme, value, key, is_near in own:
            made._follow(table, normal(value) if is_near else lexeme, key, file)
        return made

    def find(self, table: Table, lexeme: str) -> Found:
        """Find the path of a lexeme, or the nearest of one that the standard defines. Raises Absent."""
        name, note = normal(lexeme), ""
        if table == "head" and name not in self._paths[table] and (path := self._sum(name)) is not None:
            return Found(path, name)
        if name not in self._paths[table] and (near := self._nearest[table].get(name)) is not None:
            note = f"this body has no {NAMES[table]} {lexeme!r}; it performs {near!r}, the nearest"
            name = near
        while isinstance(path := self._paths[table].get(name), str):
            name = path
        if path is None:
            raise Absent(self._absence(table, lexeme))
        return Found(path, name, note)

    def face(self, path: FacePath, side: str = "BOTH") -> dict[str, float]:
        """Add up the joints of a face: shares of their way, within their ranges."""
        sums: dict[str, float] = {}
        for joint, share in self._joints(path, 1.0):
            if not joint.startswith({"LEFT": "right_", "RIGHT": "left_"}.get(side, "-")):
                sums[joint] = sums.get(joint, 0.0) + share
        limits = kinematics.LIMIT
        return {joint: min(max(share, limits[joint].low), limits[joint].high) for joint, share in sums.items()}

    def _joints(self, path: FacePath, scale: float) -> Iterator[tuple[str, float]]:
        for key, share in path.items():
            if unit := _UNIT.fullmatch(key):
                yield from self._joints(self.find("facs", unit[1]).path, scale * share)
            else:
                yield from ((joint, scale * share) for joint in FACE_SIDES.get(key, (key,)))

    def _sum(self, name: str) -> HeadPath | None:
        """Add up the directions of a name such as `UP_LEFT` or `TILT_LEFT_DOWN`; None if it is no such name."""
        words, ways = name.split("_"), list[HeadPath]()
        while words:
            for length in range(len(words), 0, -1):
                part = "_".join(words[:length])
                path = self.find("head", part).path if part in self._paths["head"] else None
                if isinstance(path, HeadPath) and path.hold:
                    ways.append(path)
                    del words[:length]
                    break
            else:
                return None
        left, up, tilt = (sum(getattr(path.to, axis) for path in ways) for axis in ("left", "up", "tilt"))
        degrees = max(path.degrees for path in ways)
        way = HeadWay(left=max(-1.0, min(1.0, left)), up=max(-1.0, min(1.0, up)), tilt=max(-1.0, min(1.0, tilt)))
        return HeadPath(to=way, degrees=degrees, hold=True)

    def _absence(self, table: Table, lexeme: str) -> str:
        what = f"no {NAMES[table]} {lexeme!r}"
        if is_defined(table, lexeme):
            return f"{what}: BML defines it, but this body has nothing near it"
        known = self.lexemes(table)
        close = get_close_matches(normal(lexeme), known, n=3, cutoff=0.5) if table != "facs" else []
        there = f"do you mean {' or '.join(close)}?" if close else f"there are {', '.join(known)}."
        return f"{what}: {there} A repertoire file can add it: see docs/control.md"

    def _follow(self, table: Table, lexeme: str, key: str, file: str) -> None:
        seen = [lexeme]
        while isinstance(path := self._paths[table].get(seen[-1]), str):
            if path in seen:
                raise _refusal(f"it leads back to itself: {' = '.join([*seen, path])}", key, file)
            seen.append(path)
        if path is None:
            close = get_close_matches(seen[-1], self._paths[table], n=1)
            advice = f"do you mean {close[0]!r}?" if close else f"there are {', '.join(self._paths[table])}"
            raise _refusal(f"there is no {NAMES[table]} {seen[-1]!r}", key, file, advice)
        for joint, angle in self._angles(table, path, key, file):
            limit = kinematics.LIMIT[joint]
            if not limit.low - 1e-9 <= angle <= limit.high + 1e-9:
                reason = f"{joint} would be at {_shown(joint, angle)}"
                low, high = _shown(joint, limit.low), _shown(joint, limit.high)
                raise _refusal(reason, key, file, f"its range is {low} to {high}")

    def _angles(self, table: Table, path: Any, key: str, file: str) -> Iterator[tuple[str, float]]:
        """Angles of all joints on a path."""
        match path:
            case GesturePath(ready=ready, stroke=stroke, stroke_end=stroke_end):
                for angles in (ready, stroke, stroke_end):
                    yield from angles.joints("right").items()
            case HeadPath(to=to, degrees=degrees):
                for joint, share in (("neck_yaw", to.left), ("neck_pitch", to.up), ("neck_roll", to.tilt)):
                    for angle in degrees:
                        if not abs(share * radians(angle)) <= kinematics.NOD_RESERVE:
                            advice = "a movement on top of the gaze goes at most 18 degrees to each side"
                            raise _refusal(f"{joint} would go {abs(share * angle):g} degrees", key, file, advice)
            case PosePath():
                for joints in path.joints().values():
                    yield from joints.items()
            case _:
                yield from self._face_angles(table, path, key, file)

    def _face_angles(self, table: Table, path: FacePath, key: str, file: str) -> Iterator[tuple[str, float]]:
        joints = [*FACE_SIDES, *kinematics.joints_of("face")]
        for name, share in path.items():
            unit = None if table == "facs" else _UNIT.fullmatch(name)
            if unit and unit[1] not in self._paths["facs"]:
                advice = f"there are {', '.join(self._paths['facs'])}"
                raise _refusal(f"there is no action unit {unit[1]}", key, file, advice)
            if not unit and name not in joints:
                units = ", and AU1 and on" if table == "face" else ""
                raise _refusal(f"a face has no {name!r}", key, file, f"there are {', '.join(joints)}{units}")
            if not unit:
                yield from ((joint, share) for joint in FACE_SIDES.get(name, (name,)))


def _read(text: str, file: str) -> dict[str, Any]:
    with raised_as(InputRefused, (ValueError, RecursionError), file, "not TOML", ADVICE):
        return tomllib.loads(text)


def _known(name: str, prefix: str, file: str) -> Table:
    for table in TABLES:
        if table == name:
            return table
    known = ", ".join((*TABLES, *([] if prefix else ["nearest"])))
    raise _refusal(f"unknown table [{prefix}{name}]", "", file, f"known are {known}")


def _table(content: Any, key: str, file: str) -> dict[str, Any]:
    if not isinstance(content, dict):
        raise _refusal(f"a table is expected, not {content!r}", key, file)
    return content


def _value(value: Any, table: Table, key: str, file: str) -> Any:
    if isinstance(value, str):
        return normal(value)
    try:
        return msgspec.convert(value, _PATHS[table])
    except msgspec.ValidationError as error:
        reason, _, place = str(error).partition(" - at `$")
        raise _refusal(reason, f"{key}{place.strip('`')}", file) from error


def _shown(joint: str, angle: float) -> str:
    if kinematics.LIMIT[joint].part == "face":
        return f"{angle:g}"
    return f"{angle / radians(1.0):.0f} degrees"


def _refusal(reason: str, key: str, file: str, advice: str = ADVICE) -> InputRefused:
    return InputRefused(Fault(reason=f"{reason}, in `{key}`" if key else reason, where=file, advice=advice))


def extended(base: Repertoire, texts: Iterable[tuple[str, str]]) -> Repertoire:
    """Extend a repertoire by files, each given by its name and text. Raises InputRefused with file and key."""
    for file, text in texts:
        base = base.extended(text, file)
    return base


def _built_in() -> Repertoire:
    file = files(__package__) / "repertoire.toml"
    return Repertoire().extended(file.read_text(encoding="utf-8"), file.name)


BUILT_IN = _built_in()
"""The repertoire that comes with the body."""


def repertoire_of(config: ControlConfig) -> Repertoire:
    """The repertoire with what the files of the configuration add to it. Raises InputRefused."""
    return extended(BUILT_IN, [(file, _text_of(file)) for file in config.repertoire_files])


def _text_of(file: str) -> str:
    advice = "it is in `control.repertoire`; a relative path counts from the folder of the process"
    with raised_as(InputRefused, OSError, file, advice=advice):
        return utf8(Path(file).read_bytes(), file)
