"""Writes the table of behavior types in docs/control.md from `schemas/behavior_types.py`: `make generate`."""

from pathlib import Path

from engage_hri.schemas.behavior_types import SYNC_POINTS, TYPES, BehaviorType

PAGE = Path(__file__).resolve().parents[2] / "docs" / "control.md"
HEAD = "| behavior | sync points | may wait at |\n|---|---|---|\n"
SPEECH = "| speech | start, its marks, end | marks between two words, if its estimate says `hold` |"


def table() -> str:
    """A row for all types that a body performs alike, in the order of the rows of the code; last what has a clock."""
    rows: dict[tuple[str, str], list[str]] = {}
    for row in TYPES.values():
        if row.name != "speech" and (row.performer == "body" or row.holds):
            rows.setdefault((_points(row), ", ".join(row.holds)), []).append(row.name)
    cells = [f"| {', '.join(names)} | {points} | {holds} |" for (points, holds), names in rows.items()]
    return HEAD + "\n".join([*cells, SPEECH]) + "\n"


def _points(row: BehaviorType) -> str:
    points = "all seven" if row.points == SYNC_POINTS else ", ".join(row.points)
    return "; ".join((points, *(" = ".join(group) for group in row.one_instant)))


def page(text: str) -> str:
    """The page with the table as the code has it."""
    before, _, rest = text.partition(HEAD)
    return before + table() + rest[rest.index("\n\n") + 1 :]


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
