"""Writes the table of faults in docs/faults.md from `schemas/body_faults.py`: `make generate`."""

from collections.abc import Iterator
from pathlib import Path

from engage_hri.schemas.body_faults import KINDS, FaultKind

PAGE = Path(__file__).resolve().parents[2] / "docs" / "faults.md"
HEAD = "| fault | what one sees | options |\n|---|---|---|\n"


def table() -> str:
    """A row for each kind, in the order of the code."""
    return HEAD + "".join(
        f"| `{name}` | {kind.does} | {'; '.join(_options(kind))} |\n" for name, kind in KINDS.items()
    )


def _options(kind: FaultKind) -> Iterator[str]:
    if kind.on:
        parts = f"a {kind.on}, also `voice`" if kind.voice else f"a {kind.on}"
        yield f"`--part`: {parts}"
    if kind.amount:
        usual = "" if kind.usual is None else f" ({kind.usual:g})"
        yield f"`--amount`{usual}: {kind.amount}"
    if kind.before:
        yield "`--before`"
    if kind.behavior:
        yield "`--behavior`"


def page(text: str) -> str:
    """The page with the table as the code has it."""
    before, _, rest = text.partition(HEAD)
    return before + table() + rest[rest.index("\n\n") + 1 :]


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
