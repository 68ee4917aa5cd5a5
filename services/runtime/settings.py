"""Settings of a service, told on the bus once in each of its lives, without what is secret in them."""

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import msgspec
from msgspec import Struct

from engage_hri.schemas import keys
from engage_hri.schemas.participants import ServiceSettings, SettingsFile, text_of
from engage_hri.services.bus.interface import Bus
from engage_hri.services.runtime.service import installed_version

HIDDEN = "(hidden)"
"""Value that stands for one that is secret."""
LARGEST_FILE = 256 * 1024
"""Bytes: of a longer file only the name is told."""
_SECRET = re.compile(
    r"(?:^|[_\W])(?:(?:api|access|private|ssh)?keys?|tokens?|secrets?|pass(?:word|wd|phrase|code)s?|credentials?"
    r"|cert(?:ificate)?s?|auth(?:orization)?|bearer|cookies?)(?:$|[_\W])"
)
_CAMEL = re.compile(r"(?<=[a-z0-9])(?=[A-Z])")
_LOGIN = re.compile(r"(?<=://)[^/@\s]+@")


def tell_settings(bus: Bus, name: str, config: Struct, files: Iterable[str] = (), **more: object) -> None:
    """Publish the settings under which this life of a service runs. What cannot be told is a fault, and no more.

    name: section of the configuration. files: names of the files that it names. more: values that stand beside the
    sections.
    """
    with bus.containing("telling the settings"):
        settings = {**more, name: config}
        texts = {file: text for file in files if (text := _text(file)) is not None}
        told = ServiceSettings(
            participant=bus.name, run=bus.run, version=installed_version(), at=bus.stamp(),
            settings=text_of(shown(settings)),
            files=tuple(SettingsFile(name=file, text=text) for file, text in texts.items()),
        )  # fmt: skip
        bus.publish(keys.settings(bus.name), told)


def shown(settings: object) -> dict[str, Any]:
    """Settings as plain values, without what is secret by the name of its key, or as a login in an address."""
    packed = msgspec.msgpack.encode(msgspec.to_builtins(settings, str_keys=True, enc_hook=str))
    plain: dict[str, Any] = msgspec.msgpack.decode(packed)
    return {name: _shown(value, name) for name, value in plain.items()}


def _shown(value: Any, name: str) -> Any:
    if is_secret(name) and value not in (None, "", [], {}):
        return HIDDEN
    if isinstance(value, dict):
        return {str(inner): _shown(one, str(inner)) for inner, one in value.items()}
    if isinstance(value, list):
        return [_shown(one, name) for one in value]
    return _LOGIN.sub(f"{HIDDEN}@", value) if isinstance(value, str) else value


def is_secret(name: str) -> bool:
    """Tell whether a key by its name holds what nobody else is to know: `api_key`, `password`, `accessToken`."""
    return _SECRET.search(_CAMEL.sub("_", name).lower()) is not None


def _text(file: str) -> str | None:
    """The text of a file; None: it is none, or too long."""
    try:
        data = Path(file).read_bytes()
        return data.decode() if len(data) <= LARGEST_FILE else None
    except (OSError, UnicodeError, ValueError):
        return None
