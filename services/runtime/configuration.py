"""Reading of configurations: TOML in, frozen structs out. A bad one is refused, with the file and the key."""

import os
import tomllib
from collections.abc import Container, Iterable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import msgspec
from msgspec import Struct

from engage_hri.schemas.advice import explained
from engage_hri.schemas.faults import Fault, InputRefused, NotReady, raised_as
from engage_hri.schemas.text import is_utf8, utf8
from engage_hri.services.bus.config import BusConfig, environment

FILE = "ENGAGE_CONFIG"
"""Environment variable that names the file, where no other is given."""
_ADVICE = "see docs/configuration.md"

Kind = TypeVar("Kind", bound=Struct)


def read(
    kind: type[Kind],
    path: Path | None = None,
    *,
    settings: Iterable[str] = (),
    defaults: Iterable[str] = (),
    elsewhere: Container[str] = (),
    variables: Mapping[str, str] = {},
) -> Kind:
    """Read a configuration from a TOML file. Raises InputRefused with the file and the bad key.

    settings: `section.key=value`, each stronger than the file. defaults: the same, weaker than the file.
    elsewhere: sections of the file that are for others. variables: of the environment, stronger than the file:
    `ENGAGE_BUS_CONNECT` and its like, and `ENGAGE_CONFIG`, which names the file if `path` does not.
    """
    if path is None and variables.get(FILE):
        path = Path(variables[FILE])
    merged: dict[str, Any] = {}
    for setting in defaults:
        _merge(merged, _setting(setting))
    if path is not None:
        _merge(merged, _file(path))
    _merge(merged, environment(variables))
    for setting in settings:
        _merge(merged, _setting(setting))
    merged = {key: value for key, value in merged.items() if key in kind.__struct_fields__ or key not in elsewhere}
    where = str(path) if path else "settings"
    if key := _not_a_number(merged):
        raise InputRefused(Fault(reason=f"nan is not a number, in `{key}`", where=where, advice=_ADVICE))
    try:
        return msgspec.convert(merged, kind)
    except msgspec.ValidationError as error:
        raise InputRefused(Fault(reason=_explained(error, kind), where=where, advice=_ADVICE)) from error


class _OnlyBus(Struct, frozen=True):
    """A configuration of which only one section counts."""

    bus: BusConfig = BusConfig()


def bus_config(**given: object) -> BusConfig:
    """The section `[bus]`, from the environment of this process; what is `given` is stronger. Raises InputRefused."""
    settings = [f"bus.{key}={msgspec.json.encode(value).decode()}" for key, value in given.items() if value]
    return read(_OnlyBus, settings=settings, variables=os.environ).bus


def _explained(error: msgspec.ValidationError, kind: Any) -> str:
    reason, key = explained(error, kind)
    return f"{reason}, in `{key}`" if key else reason


def _not_a_number(table: dict[str, Any], place: str = "") -> str:
    """First key with the value nan, which checks of ranges would not find; empty: none."""
    for name, value in table.items():
        key = f"{place}{name}"
        inner = _not_a_number(value, f"{key}.") if isinstance(value, dict) else key if value != value else ""
        if inner:
            return inner
    return ""


def _file(path: Path) -> dict[str, Any]:
    with raised_as(NotReady, OSError, path):
        text = utf8(path.read_bytes(), str(path))
    # A TOMLDecodeError is a ValueError, and so is a number too long.
    with raised_as(InputRefused, (ValueError, RecursionError), path, "not TOML", _ADVICE):
        return tomllib.loads(text)


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
