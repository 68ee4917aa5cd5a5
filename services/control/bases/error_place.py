"""Places in drivers where errors were raised, and words for what was raised: for faults and findings. Pure."""

import traceback
from collections.abc import Sequence
from pathlib import Path
from sysconfig import get_paths

from msgspec import Struct

_PACKAGE = str(Path(__file__).parents[3])
_LIBRARY = tuple(
    str(Path(get_paths()["stdlib"]) / name) for name in ("asyncio", "contextlib.py", "concurrent", "importlib")
)
"""Modules of Python through which errors of tasks and of imports come."""


class Place(Struct, frozen=True):
    """A line of a file."""

    file: str
    line: int


def words_of(error: BaseException) -> str:
    """Say what was raised, on one line."""
    return " ".join(f"{type(error).__name__}: {error}".split())


def place_of(error: BaseException, frames: Sequence[traceback.FrameSummary] = ()) -> Place | None:
    """Find the line of the driver that raised an error; None: it is not known.

    That is the last one outside of this package, of what imports modules and of what runs tasks, if there is one.
    frames: the part of its traceback that counts; none: all of it.
    """
    if isinstance(error, SyntaxError) and error.filename and error.lineno:
        return Place(error.filename, error.lineno)
    every = frames or traceback.extract_tb(error.__traceback__)
    beyond = [each for each in every if not each.filename.startswith(_LIBRARY) and "importlib" not in each.filename]
    own = [each for each in beyond if not each.filename.startswith(_PACKAGE)]
    last = (own or beyond or list(every))[-1:]
    return Place(last[0].filename, last[0].lineno or 0) if last else None


def seen_at(error: BaseException) -> str:
    """Say where to look: `see drivers/pan_tilt.py, line 14`; empty: it is not known."""
    place = place_of(error)
    return f"see {place.file}, line {place.line}" if place else ""
