"""Configuration of the services of a robot, and reading of any configuration: TOML in, frozen structs out.

A bad configuration is refused at start, with file and key.
"""

import re
import tomllib
from collections.abc import Iterable
from difflib import get_close_matches
from pathlib import Path
from typing import Any, Literal, TypeVar, get_args, get_origin, get_type_hints

import msgspec
from msgspec import Struct

from engage_hri.schemas.covered import COVERED_FOR
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.ranges import not_negative
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.utf8 import is_utf8, utf8
from engage_hri.services.control.config import ControlConfig
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.realizer.config import RealizerConfig
from engage_hri.services.recognition.config import RecognitionConfig

ELSEWHERE = ("simulation", "collaboration")
"""Sections of the same file that a robot ignores: it loads nothing of the simulation and the task."""
_ADVICE = "see docs/configuration.md"


class RobotConfig(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Sections (TOML tables) of the services, and values that several of them share.

    robot: the namespace on the bus and the robot's actor id. covered_for: time for which an object that is missing in
    reports of the world is taken to be covered, so that the robot still speaks of it and looks at it.
    """

    robot: str = "robot"
    covered_for: Seconds = COVERED_FOR
    generation: GenerationConfig = GenerationConfig()
    realizer: RealizerConfig = RealizerConfig()
    recognition: RecognitionConfig = RecognitionConfig()
    control: ControlConfig = ControlConfig()

    def __post_init__(self) -> None:
        if not self.robot or not set(self.robot).isdisjoint("/*$#?@ "):
            reason = "it has one of / * $ # ? @ or a space" if self.robot else "it is empty"
            raise ValueError(f"robot {self.robot!r} cannot be part of a key: {reason}")
        not_negative(self, ("covered_for",))


Kind = TypeVar("Kind", bound=RobotConfig)


def read(kind: type[Kind], path: Path | None, *, settings: Iterable[str] = (), defaults: Iterable[str] = ()) -> Kind:
    """Read a configuration from a TOML file. Raises InputRefused with the file and the bad key.

    settings: `section.key=value`, each stronger than the file. defaults: the same, weaker than the file.
    """
    merged: dict[str, Any] = {}
    for setting in defaults:
        _merge(merged, _setting(setting))
    if path is not None:
        _merge(merged, _file(path))
    for setting in settings:
        _merge(merged, _setting(setting))
    merged = {key: value for key, value in merged.items() if key in kind.__struct_fields__ or key not in ELSEWHERE}
    where = str(path) if path else "settings"
    if key := _not_a_number(merged):
        raise InputRefused(Fault(reason=f"nan is not a number, in `{key}`", where=where, advice=_ADVICE))
    try:
        return msgspec.convert(merged, kind)
    except msgspec.ValidationError as error:
        raise InputRefused(Fault(reason=_explained(error, kind), where=where, advice=_ADVICE)) from error


def _explained(error: msgspec.ValidationError, kind: Any) -> str:
    """Explain an error: what is wrong, what would be right, and the key."""
    reason, _, place = str(error).partition(" - at `$")
    key = place.strip("`").lstrip(".")
    for name in key.split(".") if key else ():
        kind = get_type_hints(kind)[name.partition("[")[0]]
    if reason.startswith("Invalid enum value"):
        reason = f"{reason.removeprefix('Invalid enum value ')} is none of {', '.join(map(repr, _choices(kind)))}"
    elif unknown := re.fullmatch(r"Object contains unknown field `(.*)`", reason):
        close = get_close_matches(unknown[1], kind.__struct_fields__, n=1)
        known = f"do you mean `{close[0]}`?" if close else f"known are {', '.join(kind.__struct_fields__)}"
        reason = f"unknown key `{unknown[1]}`; {known}"
    return f"{reason}, in `{key}`" if key else reason


def _choices(kind: Any) -> list[str]:
    """Words that a Literal type allows."""
    if get_origin(kind) is Literal:
        return list(get_args(kind))
    return [choice for part in get_args(kind) for choice in _choices(part)]


def _not_a_number(table: dict[str, Any], place: str = "") -> str:
    """First key with the value nan, which checks of ranges would not find; empty: none."""
    for name, value in table.items():
        key = f"{place}{name}"
        inner = _not_a_number(value, f"{key}.") if isinstance(value, dict) else key if value != value else ""
        if inner:
            return inner
    return ""


def _file(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(utf8(path.read_bytes(), str(path)))
    except OSError as error:
        raise InputRefused(Fault(reason=error.strerror or str(error), where=str(path))) from error
    except (ValueError, RecursionError) as error:  # a TOMLDecodeError is a ValueError, and so is a number too long
        raise InputRefused(Fault(reason=f"not TOML: {error}", where=str(path), advice=_ADVICE)) from error


def _setting(text: str) -> dict[str, Any]:
    """Read a setting, `recognition.gaze_resolution=table`. The value is TOML, or else a plain word."""
    key, equals, value = text.partition("=")
    if not is_utf8(text):
        raise InputRefused(Fault(reason=f"setting {text!r} is not UTF-8", advice="section.key=value"))
    if not equals:
        raise InputRefused(Fault(reason=f"no value in setting {text!r}", advice="section.key=value"))
    for form in (f"{key} = {value}", f"{key} = {msgspec.json.encode(value).decode()}"):
        try:
            return tomllib.loads(form)
        except tomllib.TOMLDecodeError:
            continue
    raise InputRefused(Fault(reason=f"bad setting {text!r}", advice="section.key=value"))


def _merge(into: dict[str, Any], news: dict[str, Any]) -> None:
    for key, value in news.items():
        if isinstance(value, dict) and isinstance(into.get(key), dict):
            _merge(into[key], value)
        else:
            into[key] = value
