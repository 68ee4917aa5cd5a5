"""Writes the table of a body's faults in docs/faults.md, and that of causes in docs/protocol.md: `make generate`."""

from collections.abc import Iterator
from pathlib import Path

from engage_hri.schemas.body_faults import KINDS, FaultKind
from engage_hri.schemas.faults import CAUSES

DOCS = Path(__file__).resolve().parents[2] / "docs"
CAUSES_HEAD = "| `cause` | what it says of `whose` |\n|---|---|\n"
HEAD = "| fault | what one sees | options |\n|---|---|---|\n"


def table() -> str:
    """A row for each kind, in the order of the code."""
    return HEAD + "".join(
        f"| `{name}` | {kind.does} | {'; '.join(_options(kind))} |\n" for name, kind in KINDS.items()
    )


def causes() -> str:
    """A row for each cause, in the order of the code."""
    return CAUSES_HEAD + "".join(f"| `{cause}` | {says} |\n" for cause, says in CAUSES.items())


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


PAGES = {"faults.md": (HEAD, table), "protocol.md": (CAUSES_HEAD, causes)}
"""Pages, each with the head of its table and what makes that."""


def page(name: str, text: str) -> str:
    """The page with its table as the code has it."""
    head, made = PAGES[name]
    before, _, rest = text.partition(head)
    return before + made() + rest[("\n" + rest).index("\n\n") :]


if __name__ == "__main__":
    for name in PAGES:
        path = DOCS / name
        path.write_text(page(name, path.read_text(encoding="utf-8")), encoding="utf-8")
