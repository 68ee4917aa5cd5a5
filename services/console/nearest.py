"""Behavior as a body performs it, read from the words with which the body warns that it has only something near it.

`Estimate.degraded` (schemas/body.py) says how a body writes these words; a warning of kind DEGRADED repeats them.
"""

import re
from typing import Any, TypeVar

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.behaviors import Gaze, GazeShift
from engage_hri.schemas.vocabulary import normal

_INSTEAD = re.compile(
    r"this body has no [^';]*'(?P<asked>[^']*)'(?: of its '(?P<part>[^']*)')?[^';]*; it (?P<verb>\w+)"
    r"[^';]*'(?P<done>[^']*)'"
)
_LEFT_OUT = re.compile(r"\bno [^';]*'(?P<asked>[^']*)': [^;]*(?=;.*the rest is performed)")
_Thing = TypeVar("_Thing", bound=Struct)


def performed(behavior: _Thing, warning: str) -> _Thing:
    """Put what the body performs in place of what was asked. warning: its words; they may name several things."""
    for match in _INSTEAD.finditer(warning):
        asked, part, done = normal(match["asked"]), match["part"], match["done"]
        if isinstance(behavior, Gaze | GazeShift):
            if match["verb"] == "looks":
                behavior = replace(behavior, offset_angle=0.0, offset_direction="")
        else:
            behavior = _changed(behavior, asked, part, done)
    for match in _LEFT_OUT.finditer(warning):
        behavior = _changed(behavior, normal(match["asked"]), None, "")
    return behavior


def is_unnamed(warning: str) -> bool:
    """Tell whether a body lacks something and does not name what it performs instead."""
    return "this body has no" in warning and not (_INSTEAD.search(warning) or _LEFT_OUT.search(warning))


def _changed(thing: _Thing, asked: str, part: str | None, done: str) -> _Thing:
    """Replace a name in a behavior, and in its expressions or poses. part: given: the part of that pose is replaced.

    done: empty: the name is left out.
    """
    changes: dict[str, Any] = {}
    for field in thing.__struct_fields__:
        value = getattr(thing, field)
        match field:
            case "lexeme" | "stance" if value and normal(value) == asked:
                if part is None:
                    changes[field] = done
                if part is not None or not done:
                    changes |= {"part": done} if hasattr(thing, "part") and field == "lexeme" else {}
            case "au" if str(value) == asked:
                changes[field] = int(done) if done.isdecimal() else 0
            case "expressions" | "poses":
                changes[field] = tuple([_changed(each, asked, part, done) for each in value])
    return replace(thing, **changes) if changes else thing
