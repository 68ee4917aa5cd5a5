"""Who imports whom, read from the files, and held to the layers of tests/test_architecture.py.

A unit is a file or folder directly within one of the folders that have layers, by its name: `realizer` in
`services`, `plan` in `services/realizer`.
"""

import ast
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
TABLE = ROOT / "tests" / "test_architecture.py"
OURS = "engage_hri."


class Upwards(Exception):
    """An import goes up, stays in its layer, or closes a circle."""


class Picture(NamedTuple):
    """Units of one folder. layers: from the top. imports: of each unit, the units of the folder that it imports."""

    folder: str
    layers: tuple[tuple[str, ...], ...]
    imports: Mapping[str, frozenset[str]]


def layers(table: Path = TABLE) -> dict[str, tuple[tuple[str, ...], ...]]:
    """The table of layers, by folder: names from the top."""
    for node in ast.parse(table.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "LAYERS":
            rows: dict[str, str] = ast.literal_eval(node.value)
            return {folder: tuple(tuple(row.split()) for row in text.split(">")) for folder, text in rows.items()}
    raise LookupError(f"{table.name} has no table LAYERS")


def picture(folder: str, rows: tuple[tuple[str, ...], ...], root: Path = ROOT) -> Picture:
    """The units of a folder in their layers. Raises Upwards if an import does not point down."""
    found: dict[str, set[str]] = {}
    for path in sorted((root / folder).rglob("*.py")):
        unit = path.relative_to(root / folder).with_suffix("").parts[0]
        if not unit.startswith("__") and path.name != "__main__.py":  # ways in: they start at the top
            found.setdefault(unit, set()).update(_units(path, f"{OURS}{folder.replace('/', '.')}."))
    imports = {unit: frozenset(names & found.keys() - {unit}) for unit, names in found.items()}
    made = Picture(folder, tuple(tuple(name for name in row if name in found) for row in rows), imports)
    if wrong := sorted(upwards(made)):
        raise Upwards(f"{folder}: {', '.join(wrong)}")
    return made


def _units(path: Path, prefix: str) -> set[str]:
    return {name.removeprefix(prefix).split(".")[0] for name in imported(path) if name.startswith(prefix)}


def imported(path: Path) -> tuple[str, ...]:
    """Every module that a file imports anywhere in it, with what it takes of it."""
    return _imported(path.read_text(encoding="utf-8"), path)


@cache
def _imported(text: str, path: Path) -> tuple[str, ...]:
    """A file is asked for several times: for the picture of its folder, and of the folders around that."""
    found: list[str] = []
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            found += (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, f"{path}: imports begin with {OURS}"
            found += (f"{node.module}.{alias.name}" for alias in node.names)
    return tuple(found)


def upwards(made: Picture) -> Iterator[str]:
    """The imports that do not point down, in words. Where all do, there is no circle either."""
    rank = {unit: number for number, row in enumerate(made.layers) for unit in row}
    for unit, names in made.imports.items():
        if unit not in rank:
            yield f"{unit} has no layer"
        yield from (f"{unit} imports {name}" for name in names if unit in rank and rank.get(name, -1) <= rank[unit])


def needed(imports: Mapping[str, frozenset[str]]) -> dict[str, frozenset[str]]:
    """Without what follows from the others: where a imports b and b imports c, a's import of c is left out."""
    below: dict[str, frozenset[str]] = {}

    def reach(unit: str) -> frozenset[str]:
        if unit not in below:
            below[unit] = frozenset().union(*({name} | reach(name) for name in imports.get(unit, ())))
        return below[unit]

    return {
        unit: frozenset(name for name in names if not any(name in reach(other) for other in names - {name}))
        for unit, names in imports.items()
    }
