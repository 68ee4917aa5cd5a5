"""Settings under which a service runs: told once in each of its lives, for recordings that are opened years later."""

import json
from collections.abc import Mapping
from typing import Any

from msgspec import Struct

from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.units import Stamp

DEEPEST = 50
"""Tables and lists inside each other that are read."""


class SettingsFile(Struct, frozen=True, kw_only=True):
    """A file that settings name, as it was when its service began. name: as the settings have it."""

    name: str
    text: str


class ServiceSettings(Struct, frozen=True, kw_only=True, tag="service_settings", omit_defaults=True):
    """state: each service -> recorders: the configuration of this life, told as it begins to serve.

    run: id of its life, as in `PeerAlive`. version: of Engage. settings: a JSON object as text, with sections and
    keys as in a file of configuration, those at their defaults too, and of a driver all that it has; what is secret
    is `(hidden)`. A driver's number that is not finite is `Infinity`, `-Infinity` or `NaN` there. files: those that
    the settings name.
    """

    participant: str
    run: str
    version: str
    at: Stamp
    settings: str
    files: tuple[SettingsFile, ...] = ()


def text_of(sections: Mapping[str, Any]) -> str:
    """Sections as `ServiceSettings.settings` has them."""
    return json.dumps(sections, ensure_ascii=False)


def sections(text: str) -> dict[str, Any]:
    """Read `ServiceSettings.settings`. Raises InputRefused: it is no JSON object, or cannot be shown."""
    try:
        found = json.loads(text)
        if not isinstance(found, dict):
            raise InputRefused(Fault(reason="settings are a JSON object"))
        if not _is_within(found, DEEPEST):
            raise InputRefused(Fault(reason=f"settings with more than {DEEPEST} tables and lists inside each other"))
        text_of(found).encode()
    except UnicodeEncodeError as error:
        raise InputRefused(Fault(reason="half a character in the settings")) from error
    except (ValueError, RecursionError) as error:
        raise InputRefused(Fault(reason=f"settings are not JSON: {error}")) from error
    return found


def _is_within(value: object, levels: int) -> bool:
    """True if so many tables and lists, or fewer, stand inside each other."""
    inner = value.values() if isinstance(value, dict) else value if isinstance(value, list) else None
    return inner is None or (levels > 0 and all(_is_within(one, levels - 1) for one in inner))
