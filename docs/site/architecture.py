"""The pictures of docs/architecture.md: each folder with layers, drawn from its imports, and what each box is."""

import ast
import re
from collections.abc import Mapping

from drawing import svg
from imports import OURS, ROOT, Picture, imported, layers, needed, picture

MARK = re.compile(r"^<!-- picture of (\S+) -->$", re.MULTILINE)
VOCABULARY = "schemas"


def drawn(text: str) -> str:
    """The page with a picture in the place of each mark. Raises LookupError if a folder of services has no place."""
    rows = {folder: row for folder, row in layers().items() if folder.startswith("services")}
    if missing := rows.keys() ^ set(MARK.findall(text)):
        raise LookupError(f"docs/architecture.md: a picture or layers are missing of {', '.join(sorted(missing))}")
    return MARK.sub(lambda mark: _section(picture(mark[1], rows[mark[1]])), text)


def _section(made: Picture) -> str:
    if made.folder == "services":
        made = _with_vocabulary(made)
    names = [name for row in made.layers for name in row]
    links = {name: f"{name}.html" for name in names if made.folder == "services" and _has_page(name)}
    image = svg(f"Imports in {made.folder}", made.layers, needed(made.imports), links)
    table = [f"| `{name}` | {said} |" for name in names if (said := _said(made.folder, name))]
    return "\n".join(["```{raw} html", image, "```", "", "| | |", "|---|---|", *table])


def _has_page(name: str) -> bool:
    return (ROOT / "docs" / f"{name}.md").is_file()


def _with_vocabulary(made: Picture) -> Picture:
    """With `schemas` below them all, and who imports it."""
    imports: Mapping[str, frozenset[str]] = {
        unit: names | ({VOCABULARY} if _speaks(unit) else set()) for unit, names in made.imports.items()
    }
    return Picture(made.folder, (*made.layers, (VOCABULARY,)), imports)


def _speaks(unit: str) -> bool:
    files = (ROOT / "services" / unit).rglob("*.py")
    return any(name.startswith(f"{OURS}{VOCABULARY}") for path in files for name in imported(path))


def _said(folder: str, name: str) -> str:
    """The first paragraph of its docstring."""
    base = ROOT / (name if name == VOCABULARY else f"{folder}/{name}")
    path = base / "__init__.py" if base.is_dir() else base.with_suffix(".py")
    told = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
    return " ".join(told.split("\n\n")[0].split()).replace("|", "\\|")
