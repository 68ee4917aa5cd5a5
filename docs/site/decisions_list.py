"""Writes the list of decisions in docs/decisions/README.md, with their titles: `make generate`.

The third line of a page says what has overtaken it, if anything has: `*Overtaken by [0089](0089-....md): why.*`
"""

import re
from pathlib import Path

FOLDER = Path(__file__).resolve().parents[2] / "docs" / "decisions"
HEAD = "## All of them\n\n"
_TITLE = re.compile(r"# (\d{4}) (.+)")
_OVERTAKEN = re.compile(r"\*Overtaken by (\[\d{4}\]\(\S+\))")


def listed(folder: Path = FOLDER) -> str:
    """A line for each page, in order. Raises ValueError: one has no title with its number."""
    return HEAD + "".join(_line(path) for path in sorted(folder.glob("[0-9]*.md")))


def page(text: str, folder: Path = FOLDER) -> str:
    """The page with the list as the folder has it; nothing is behind it."""
    return text.partition(HEAD)[0] + listed(folder)


def _line(path: Path) -> str:
    first, _, third, *_ = (*path.read_text(encoding="utf-8").splitlines(), "", "")
    title = _TITLE.fullmatch(first)
    if title is None or not path.name.startswith(title[1]):
        raise ValueError(f"{path}: its first line has to be `# {path.name[:4]} TITLE`")
    overtaken = _OVERTAKEN.match(third)
    return f"- {title[1]} [{title[2]}]({path.name}){f', overtaken by {overtaken[1]}' if overtaken else ''}\n"


if __name__ == "__main__":
    readme = FOLDER / "README.md"
    readme.write_text(page(readme.read_text(encoding="utf-8")), encoding="utf-8")
