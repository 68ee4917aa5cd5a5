"""Builds the site: `python docs/site/build.py [OUT]`, or `make docs`. Needs the extra `docs`, and no network.

The pages are put together below `build/docs-source`, laid out as in the tree, so that their links hold: README.md is
the first page, and what is made from the code (messages, names of the package, pictures of the folders) joins them.
A warning of Sphinx, such as a link to nowhere or a page that no table of contents has, is an error.
"""

import shutil
import sys
from pathlib import Path

import architecture
import messages
import reference
from pages import for_site
from sphinx.cmd.build import build_main

ROOT = Path(__file__).resolve().parents[2]
SOURCE = ROOT / "build" / "docs-source"
OUT = ROOT / "build" / "docs"
TOP = ("README.md", "CHANGELOG.md", "CONTRIBUTING.md", "SECURITY.md", "tests/README.md")
CONTENTS = {
    "Using it": (
        "commands",
        "console",
        "configuration",
        "deploy",
        "security",
        "faults",
        "scenario",
        "study",
        "recordings",
        "conversations",
        "language-models",
        "voice-frameworks",
    ),
    "From other programs": (
        "reference",
        "people",
        "talk",
        "connection-events",
        "protocol",
        "other-languages",
        "messages",
        "bml",
        "vocabulary",
    ),
    "How it works": (
        "architecture",
        "files",
        "generation",
        "realizer",
        "recognition",
        "hearing",
        "eyes",
        "pieces",
        "control",
        "mujoco",
        "reachy-mini",
        "contract",
        "bus",
        "hostile",
    ),
    "Words and reasons": ("glossary", "decisions/README"),
    "The project": ("../CHANGELOG", "../CONTRIBUTING", "../tests/README", "../SECURITY", "README"),
}
"""The table of contents: captions and pages of docs/."""


def pages() -> dict[str, str]:
    """Every page by its path: those of the tree, and those that are made."""
    tracked = [*TOP, *(path.relative_to(ROOT).as_posix() for path in sorted((ROOT / "docs").rglob("*.md")))]
    found = {name: (ROOT / name).read_text(encoding="utf-8") for name in tracked}
    found["docs/architecture.md"] = architecture.drawn(found["docs/architecture.md"])
    found["docs/messages.md"] = messages.page()
    found["docs/reference.md"] = reference.page()
    made = {name: for_site(name, text, found) for name, text in found.items()}
    decisions = [Path(name).stem for name in made if name.startswith("docs/decisions/0")]
    made["docs/decisions/README.md"] += _toctree("", decisions)
    made["index.md"] = made.pop("README.md") + "".join(
        _toctree(caption, [Path("docs", name).as_posix().replace("docs/../", "") for name in names])
        for caption, names in CONTENTS.items()
    )
    return made


def _toctree(caption: str, names: list[str]) -> str:
    head = f":caption: {caption}\n:hidden:\n" if caption else ":maxdepth: 1\n"
    return "\n".join(["\n```{toctree}", head, *names, "```", ""])


def stage(folder: Path) -> None:
    """Lay out all that Sphinx reads."""
    shutil.rmtree(folder, ignore_errors=True)
    for name, text in pages().items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    for picture in sorted((ROOT / "docs").rglob("*.png")):
        place = folder / picture.relative_to(ROOT)
        place.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(picture, place)
    shutil.copytree(ROOT / "examples", folder / "examples", ignore=shutil.ignore_patterns("__pycache__"))
    (folder / "_static").mkdir()
    here = Path(__file__).parent
    shutil.copy2(here / "engage.css", folder / "_static")
    shutil.copy2(here / "conf.py", folder)


def sphinx(source: str, out: str) -> int:
    """Build what is laid out. Returns 1 if there was a warning."""
    options = ("-W", "--keep-going", "-q", "-E", "-b", "html", "-d", f"{source}/.trees")
    return build_main([*options, source, out])


def main(out: Path = OUT) -> int:
    source = SOURCE if out == OUT else out.with_name(f"{out.name}-source")
    stage(source)
    return sphinx(str(source), str(out))


if __name__ == "__main__":
    if len(sys.argv) > 2 or any(each.startswith("-") for each in sys.argv[1:]):
        sys.exit("usage: build.py [FOLDER]: the folder for the pages; what they are made of lies beside it")
    sys.exit(main(*map(Path, sys.argv[1:])))
