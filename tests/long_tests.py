"""Tests that `make test` leaves out: all in real time but the smoke tests, and the files of `long.toml`."""

import tomllib
from collections.abc import Collection, Mapping
from pathlib import Path

LONG_FILES: Mapping[str, str] = tomllib.loads(Path(__file__).with_name("long.toml").read_text())["files"]
"""Files, relative to `tests`, each with the reason. A name that ends with a slash stands for all of a folder."""


def is_long(file: str, marks: Collection[str]) -> bool:
    """True if a test is left out of `make test`. file: relative to `tests`. marks: names of its marks."""
    if "smoke" in marks:
        return False
    return "real_time" in marks or file in LONG_FILES or any(f"{folder}/" in LONG_FILES for folder in folders(file))


def folders(file: str) -> list[str]:
    """Folders that a file lies in, from the outermost on."""
    parts = file.split("/")[:-1]
    return ["/".join(parts[:end]) for end in range(1, len(parts) + 1)]
