"""Writes docs/configuration.md from the services' config.py files: `make generate`. A test says when it is stale.

The files are parsed, not imported, because what a field means stands in the strings and comments beside it.
"""

import ast
import fnmatch
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "configuration.md"
SECTIONS = {
    "bus": "bus", "generation": "generation", "realizer": "realizer", "recognition": "recognition",
    "control": "control", "hearing": "perception/hearing",
    "eyes": "perception/eyes", "pieces": "perception/pieces", "door": "door",
    "simulation": "tangram/people", "collaboration": "tangram/collaboration",
}  # fmt: skip
"""Folder of each section."""
HEAD = """\
# Configuration

One TOML file configures all services: `engage run SERVICE --config engage.toml`, and the same option of `demo`,
`up`, `play`, `plan` and `watch`. Each table below is a table of that file. Everything has a default; an unknown key,
a wrong type or a value out of range is refused at start, with the file and the key. One setting can also be given
on the command line, stronger than the file: `--set recognition.gaze_resolution=table`. What drives a robot loads
nothing of the tangram: all commands but `demo`, `up`, `simulate` and `run` of these two pass over `[simulation]` and
`[collaboration]`.

The environment has its say, too: `ENGAGE_CONFIG` names the file where no option does, and `ENGAGE_BUS_ROBOT`,
`ENGAGE_BUS_MODE` and `ENGAGE_BUS_CONNECT` (endpoints, with commas between them) are stronger than the file and weaker
than options. `connect()` of the client reads the same variables and the same section `[bus]`.

```toml
covered_for = 10.0               # s: so long an object that the world leaves out is taken to be covered, where it was

[bus]
robot = "melvin"
connect = ["tcp/192.0.2.1:7447"]

[recognition]
gaze_resolution = "table"

[control.variability]
seed = 3
noise = 0.05
```

This page is made from the code: `make generate`.
"""


class Key(NamedTuple):
    name: str
    kind: str
    default: str
    meaning: str


def page() -> str:
    parts = [HEAD]
    for section, folder in SECTIONS.items():
        module = ast.parse((ROOT / "services" / folder / "config.py").read_text(encoding="utf-8"))
        classes = [node for node in module.body if isinstance(node, ast.ClassDef)]
        own = [node for node in classes if node.name.endswith("Config")]
        for node in [*own, *(node for node in classes if node not in own)]:
            parts.append(_table(section, node, module))
    return "\n".join(parts)


def _table(section: str, node: ast.ClassDef, module: ast.Module) -> str:
    title = f"## `[{section}]`" if node.name.endswith("Config") else f"### `{node.name}` (in `[{section}]`)"
    intro, keys = _keys(node, module)
    rows = [
        f"| `{key.name}` | `{key.kind}` | {f'`{key.default}`' if key.default else 'required'} | {key.meaning} |"
        for key in keys
    ]
    return "\n".join([title, "", intro, "", "| key | type | default | meaning |", "|---|---|---|---|", *rows, ""])


def _docstring(text: str, fields: Sequence[str]) -> tuple[str, dict[str, str]]:
    """What a class docstring says in general, and its `name: meaning` entries; `*_limit` names all that end so."""
    general: list[str] = []
    entries: dict[str, str] = {}
    for paragraph in text.split("\n\n"):
        paragraph = " ".join(paragraph.split())
        starts = [
            (found, names)
            for found in re.finditer(r"(?:^|(?<=\. ))([a-z_*]+(?:, [a-z_*]+)*): ", paragraph)
            if (names := _named(found[1], fields))
        ]
        general.append(paragraph[: starts[0][0].start()] if starts else paragraph)
        ends = [*(found.start() for found, _ in starts[1:]), len(paragraph)] if starts else []
        for (found, names), end in zip(starts, ends, strict=True):
            entries.update(dict.fromkeys(names, paragraph[found.end() : end].strip()))
    return " ".join(part.strip() for part in general if part.strip()), entries


def _named(names: str, fields: Sequence[str]) -> list[str]:
    """The fields that the start of an entry names; none if it is not an entry."""
    groups = [fnmatch.filter(fields, name) for name in names.split(", ")]
    return [name for group in groups for name in group] if all(groups) else []


def _keys(node: ast.ClassDef, module: ast.Module) -> tuple[str, list[Key]]:
    """What the class says in general, and its fields: documented below them or in the class's docstring."""
    inherited = _inherited(node, module)
    assigned = [s for s in node.body if isinstance(s, ast.AnnAssign) and isinstance(s.target, ast.Name)]
    fields = [field for field in assigned if "ClassVar" not in ast.unparse(field.annotation)]
    names = [ast.unparse(field.target) for field in fields]
    general, documented = _docstring(ast.get_docstring(node) or "", names)
    keys = []
    for field, name in zip(fields, names, strict=True):
        below = node.body[node.body.index(field) + 1 :][:1]
        if below and isinstance(below[0], ast.Expr) and isinstance(below[0].value, ast.Constant):
            documented[name] = str(below[0].value.value)
        default = ast.unparse(_value(field.value, module)) if field.value else ""
        meaning = _cell(documented.get(name, ""))
        base = inherited.pop(name, None)
        if base is not None and not meaning:
            meaning = base.meaning
        keys.append(Key(name, _cell(_kind(field.annotation, module)), _cell(default), _capitalized(meaning)))
    return general, [*keys, *inherited.values()]


def _inherited(node: ast.ClassDef, module: ast.Module) -> dict[str, Key]:
    """Fields of the classes of this project from which a class inherits, by name."""
    found: dict[str, Key] = {}
    for base in node.bases:
        for other, tree in _imported(ast.unparse(base), module):
            if isinstance(other, ast.ClassDef):
                found |= {key.name: key for key in _keys(other, tree)[1]}
    return found


def _imported(name: str, module: ast.Module) -> Iterator[tuple[ast.stmt, ast.Module]]:
    """Statements that make a name which is imported from this project, and the module in which they stand."""
    for statement in module.body:
        if (
            isinstance(statement, ast.ImportFrom)
            and statement.module is not None
            and statement.module.startswith("engage_hri.")
            and any(alias.name == name for alias in statement.names)
        ):
            place = ROOT.joinpath(*statement.module.split(".")[1:]).with_suffix(".py")
            tree = ast.parse(place.read_text(encoding="utf-8"))
            yield from ((each, tree) for each in tree.body if _makes(each, name))


def _makes(statement: ast.stmt, name: str) -> bool:
    return getattr(statement, "name", None) == name or (
        isinstance(statement, ast.AnnAssign) and ast.unparse(statement.target) == name
    )


def _kind(annotation: ast.expr, module: ast.Module) -> str:
    """The type as written, with the module's own names for literals spelled out."""
    for statement in module.body:
        if (
            isinstance(annotation, ast.Name)
            and isinstance(statement, ast.Assign)
            and isinstance(statement.targets[0], ast.Name)
            and statement.targets[0].id == annotation.id
        ):
            return ast.unparse(statement.value)
    return ast.unparse(annotation)


def _value(default: ast.expr, module: ast.Module) -> ast.expr:
    """The default as written, with a constant from another module of this project in place of its name."""
    if isinstance(default, ast.Name):
        for made, _ in _imported(default.id, module):
            if isinstance(made, ast.AnnAssign) and made.value:
                return made.value
    return default


def _capitalized(text: str) -> str:
    """A sentence begins with a capital; a symbol, unit or name stays what it is (`kg, s/degree:`)."""
    return text if re.match(r"[\w/]+[:,] ", text) else text[:1].upper() + text[1:]


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
