"""Writes docs/files.md, a line for each file of the code, from what the file says of itself: `make generate`."""

import re
from collections.abc import Iterator
from itertools import groupby, takewhile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "files.md"
ROOTS = ("schemas", "services")
COMMENTS = {".py": "", ".js": "//", ".toml": "#"}
"""Kinds of files that are listed, with what begins a line of their comments."""
DOCSTRING = re.compile(r'(?:#.*\n)*"""((?:.|\n)+?)"""')
VALUE = r"[A-Z][\w, ]*(?:: \w+)? = [-\w. */+(),]*\d[-\w. */+(),]*"
NUMBERS = re.compile(rf'((?:^{VALUE}\n)+)(?:"""((?:.|\n)+?)""")?', re.MULTILINE)
"""Constants, one below the other, with numbers in their values and no text; and the sentence below them, if any."""
HEAD = """# Files: what each is for

Where is what? Search this page for the word. Each line is what the file says of itself first; below it are its
numbers that are no settings. `make generate` writes it here. What to touch for a change is a table in
[CONTRIBUTING.md](../CONTRIBUTING.md), what each test guards is in [tests/README.md](../tests/README.md).
"""


def page(root: Path = ROOT) -> str:
    """The page: folders in order, each with what it is and its files. Raises ValueError: a file says nothing."""
    files = [path for name in ROOTS for kind in COMMENTS for path in (root / name).rglob(f"*{kind}")]
    folders = groupby(sorted(files, key=lambda path: (path.parent, path.name)), key=lambda path: path.parent)
    return HEAD + "".join(_folder(folder, list(inside), root) for folder, inside in folders)


def _folder(folder: Path, files: list[Path], root: Path) -> str:
    init = folder / "__init__.py"
    about = f"\n{first_sentences(init)}\n" if init in files else ""
    lines = [line for path in files if path != init for line in _lines(path)]
    return f"\n## {folder.relative_to(root)}/\n{about}" + ("\n" + "".join(lines) if lines else "")


def _lines(path: Path) -> Iterator[str]:
    yield f"- `{path.name}`: {first_sentences(path)}\n"
    if path.suffix == ".py":
        for constants, says in NUMBERS.findall(path.read_text(encoding="utf-8")):
            named = ", ".join(f"`{re.sub(': .*? =', ' =', each)}`" for each in constants.splitlines())
            yield f"  - {named}{says and ': ' + _in_one_line(says)}\n"


def _in_one_line(text: str) -> str:
    """The first paragraph of a text."""
    return " ".join(text.strip().partition("\n\n")[0].split())


def first_sentences(path: Path) -> str:
    """What a file says of itself: its first paragraph, in one line."""
    text = path.read_text(encoding="utf-8")
    if mark := COMMENTS[path.suffix]:
        lines = takewhile(lambda line: line.startswith(mark), text.splitlines())
        says = "\n".join(line.removeprefix(mark).strip() for line in lines)
    else:
        says = found[1] if (found := DOCSTRING.match(text)) else ""
    if not says.strip():
        raise ValueError(f"{path}: it does not begin with a sentence on what it is for")
    return _in_one_line(says)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
