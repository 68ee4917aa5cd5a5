"""The site that `make docs` builds: complete, without a warning, and asking nobody for anything."""

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import urldefrag

import pytest
from msgspec import Struct

import engage_hri
from engage_hri.schemas.messages import Message

ROOT = Path(__file__).parents[2]
SITE = ROOT / "docs" / "site"
MADE_BY_SPHINX = {"genindex.html", "search.html", "py-modindex.html"}


class Tags(HTMLParser):
    """The tags of a page: their names and attributes."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str]]] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, {name: value or "" for name, value in attrs}))


def run(*command: str | Path) -> "subprocess.CompletedProcess[str]":
    quiet = {name: value for name, value in os.environ.items() if name != "PYTHONWARNINGS"}
    return subprocess.run([sys.executable, *command], capture_output=True, text=True, check=False, env=quiet)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("site") / "docs"
    built = run(SITE / "build.py", out)
    assert built.returncode == 0, built.stderr
    assert not built.stderr
    return out


def pages(site: Path) -> dict[Path, Tags]:
    return {path: Tags(path.read_text(encoding="utf-8")) for path in site.rglob("*.html")}


def assets(tags: Tags) -> Iterator[str]:
    """What a browser loads by itself with a page."""
    for tag, given in tags.found:
        if tag in ("script", "img", "iframe", "source", "video", "audio", "embed", "use", "object"):
            yield from (given[name] for name in ("src", "href", "data", "srcset") if name in given)
        elif tag == "link":
            yield given.get("href", "")
        yield from re.findall(r"url\(\s*['\"]?([^)'\"]+)", given.get("style", ""))


def test_no_page_and_no_style_asks_another_place_for_anything(site: Path) -> None:
    asked = {asset for tags in pages(site).values() for asset in assets(tags)}
    for style in site.rglob("*.css"):
        asked |= set(re.findall(r"(?:url\(\s*|@import\s+)['\"]?([^)'\";]+)", style.read_text(encoding="utf-8")))

    assert any(asset.endswith("engage.css") or "engage.css?" in asset for asset in asked)
    assert not [asset for asset in asked if re.match(r"(?:[a-z]+:)?//", asset)]


def test_no_script_names_another_place_but_in_a_comment_or_a_namespace(site: Path) -> None:
    for script in site.rglob("*.js"):
        if script.name == "searchindex.js":  # the words of the pages
            continue
        code = re.sub(r"/\*.*?\*/|(?m:^\s*//.*$)", "", script.read_text(encoding="utf-8"), flags=re.DOTALL)
        named = set(re.findall(r"https?://[\w.-]+", code)) - {"http://www.w3.org"}
        assert not named, script.name


def test_every_page_is_reached_from_the_table_of_contents(site: Path) -> None:
    first = Tags((site / "index.html").read_text(encoding="utf-8"))
    reached = {site / "index.html"}
    todo = [(site / "index.html", first)]
    while todo:
        page, tags = todo.pop()
        for tag, given in tags.found:
            if tag != "a" or "reference internal" not in f"{given.get('class')}":
                continue
            target = (page.parent / urldefrag(given["href"]).url).resolve() if urldefrag(given["href"]).url else page
            if target.suffix == ".html" and target not in reached:
                reached.add(target)
                todo.append((target, Tags(target.read_text(encoding="utf-8"))))

    sources = {path.with_suffix(".html").relative_to(ROOT).as_posix() for path in (ROOT / "docs").rglob("*.md")}
    names = {path.relative_to(site).as_posix() for path in reached}
    assert sources | {"CHANGELOG.html", "CONTRIBUTING.html", "SECURITY.html"} <= names
    everything = {path.relative_to(site).as_posix() for path in site.rglob("*.html")}
    assert everything - names <= MADE_BY_SPHINX


def test_every_public_name_has_an_entry_with_its_methods(site: Path) -> None:
    ids = {given.get("id") for _, given in Tags((site / "docs/reference.html").read_text(encoding="utf-8")).found}

    assert {f"engage_hri.{name}" for name in engage_hri.__all__} <= ids
    for kind in (engage_hri.Robot, engage_hri.Body, engage_hri.MovementAuthority):
        attributes = vars(kind).get("__annotations__", {})
        names = {name for name in vars(kind) if not name.startswith("_") and name not in attributes}
        methods = {name for name in names if callable(getattr(kind, name))}
        assert len(methods) > 4
        assert {f"engage_hri.{kind.__name__}.{name}" for name in methods} <= ids


def test_every_message_has_a_section_with_each_of_its_fields(site: Path) -> None:
    text = (site / "docs/messages.html").read_text(encoding="utf-8")
    cells = set(re.findall(r'<td><p><code class="docutils literal notranslate"><span class="pre">(\w+)<', text))
    kinds: tuple[type[Struct], ...] = Message.__args__

    for kind in kinds:
        assert f'id="{kind.__name__.lower()}-' in text, kind
        assert set(kind.__struct_fields__) <= cells, kind


def test_the_pictures_show_every_folder_of_services(site: Path) -> None:
    text = (site / "docs/architecture.html").read_text(encoding="utf-8")
    boxes = set(re.findall(r"<text[^>]*>([\w/]+)</text>", text))

    folders = {path.name for path in (ROOT / "services").iterdir() if (path / "__init__.py").is_file()}
    assert folders | {"schemas"} <= boxes


def test_the_search_knows_a_name_and_a_term(site: Path) -> None:
    index = (site / "searchindex.js").read_text(encoding="utf-8")

    assert "inhibit_gaze" in index
    assert "backchannel" in index


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("# A\n\n[nowhere](nowhere.md)\n", "nowhere"),
        ("# A\n\n[there](b.md#not-here)\n\n```{toctree}\nb\n```\n", "not-here"),
        ("# A\n\nNothing leads to b.\n", "toctree"),
    ],
)
def test_a_page_that_is_wrong_fails_the_build(text: str, complaint: str, tmp_path: Path) -> None:
    source = tmp_path / "source"
    (source / "_static").mkdir(parents=True)
    (source / "conf.py").write_text((SITE / "conf.py").read_text(encoding="utf-8").replace('"engage.css"', ""))
    (source / "index.md").write_text(text)
    (source / "b.md").write_text("# B\n")
    call = "import sys; sys.path.insert(0, sys.argv[1]); import build; sys.exit(build.sphinx(*sys.argv[2:]))"

    ended = run("-c", call, SITE, source, tmp_path / "out")

    assert ended.returncode == 1
    assert complaint in ended.stderr
