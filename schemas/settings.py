"""Settings under which a service runs: told once in each of its lives, for recordings that are opened years later."""

from typing import Any

from msgspec import Struct

from engage_hri.schemas.units import Stamp


class ServiceSettings(Struct, frozen=True, kw_only=True, tag="service_settings", omit_defaults=True):
    """state: each service -> recorders: the configuration of this life, told as it begins to serve.

    run: id of its life, as in `PeerAlive`. version: of Engage. settings: sections and keys as in a file of
    configuration, those at their defaults too, and of a driver all that it has; what is secret is `(hidden)`. files:
    texts of the files that the settings name.
    """

    participant: str
    run: str
    version: str
    at: Stamp
    settings: dict[str, Any]
    files: dict[str, str] = {}

    def __post_init__(self) -> None:
        if not _is_plain(self.settings):
            raise ValueError("settings are tables, lists, texts, numbers, true, false and null")


def _is_plain(value: object) -> bool:
    """True for what JSON has, too: MessagePack has more."""
    match value:
        case dict():
            return all(isinstance(name, str) and _is_plain(one) for name, one in value.items())
        case list() | tuple():
            return all(map(_is_plain, value))
    return value is None or isinstance(value, bool | int | float | str)
