"""Writes the table of laws in docs/contract.md from `services/control/testing`: `make generate`."""

import inspect
from pathlib import Path

from engage_hri.services.control.testing import BodyContract

PAGE = Path(__file__).resolve().parents[2] / "docs" / "contract.md"
HEAD = "| law | what holds |\n|---|---|\n"


def table() -> str:
    """A row for each law, those of a topic below its name."""
    rows = []
    for base in BodyContract.__mro__:
        laws = {name: law for name, law in vars(base).items() if name.startswith("test_")}
        rows += [f"| **{vars(base)['topic']}** | |"] if laws else []
        for name, law in laws.items():
            says = (inspect.getdoc(law) or "").partition("\n\n")[0]
            rows.append(f"| {name.removeprefix('test_').replace('_', ' ')} | {' '.join(says.split())} |")
    return HEAD + "\n".join(rows) + "\n"


def page(text: str) -> str:
    """The page with the table as the code has it."""
    before, _, rest = text.partition(HEAD)
    return before + table() + rest[rest.index("\n#") :]


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
