"""How pages are made fit for the site, and how the pictures of the folders are drawn."""

import re
import sys
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import pytest

SITE = Path(__file__).parents[2] / "docs" / "site"
MODULES = ("architecture", "configuration", "drawing", "imports", "messages", "pages")


@pytest.fixture(scope="module")
def site() -> Iterator[SimpleNamespace]:
    """The modules that make the site; they find one another as scripts in one folder do."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(SITE))
        yield SimpleNamespace(**{name: __import__(name) for name in MODULES})
        for name in MODULES:
            sys.modules.pop(name)


def tree(root: Path, files: dict[str, str]) -> Path:
    for name, text in files.items():
        path = root / "services" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return root


def test_a_page_that_is_named_becomes_a_link(site: SimpleNamespace) -> None:
    pages = ["docs/bml.md", "docs/decisions/0001-a.md", "docs/decisions/README.md", "CHANGELOG.md"]
    made = site.pages.for_site("docs/decisions/0001-a.md", "See docs/bml.md and docs/decisions/0001.", pages)

    assert made == "See [bml.md](../bml.md) and [0001](0001-a.md)."
    assert site.pages.for_site("CHANGELOG.md", "(docs/bml.md, Blocks)", pages) == "([bml.md](docs/bml.md), Blocks)"


def test_links_and_code_stay_as_they_are(site: SimpleNamespace) -> None:
    text = "[docs/bml.md](bml.md)\n\n```text\ndocs/bml.md\n```\n"

    assert site.pages.for_site("docs/a.md", text, ["docs/bml.md"]) == text


def test_a_page_that_is_named_and_not_there_is_an_error(site: SimpleNamespace) -> None:
    with pytest.raises(LookupError, match=r"docs/gone\.md"):
        site.pages.for_site("README.md", "See docs/gone.md.", ["docs/bml.md"])


def test_a_message_is_linked_to_its_table(site: SimpleNamespace) -> None:
    made = site.pages.for_site("docs/bus.md", "[`Status`](protocol.md#messages)", [])

    assert made == "[`Status`](messages.md#status--status)"


def test_a_diagram_of_states_becomes_a_table(site: SimpleNamespace) -> None:
    steps = ["[*] --> idle", "idle --> busy : asks, begs / started", "busy --> idle"]
    diagram = "\n    ".join(["stateDiagram-v2", *steps])

    assert site.pages.for_site("docs/a.md", f"```mermaid\n{diagram}\n```", []).splitlines() == [
        "It begins in `idle`.",
        "",
        "| state | what happens / what is told of it | next state |",
        "|---|---|---|",
        "| `idle` | `asks`, `begs` / started | `busy` |",
        "| `busy` |  | `idle` |",
    ]


def test_a_diagram_of_another_kind_is_an_error(site: SimpleNamespace) -> None:
    with pytest.raises(LookupError, match="mermaid"):
        site.pages.for_site("docs/a.md", "```mermaid\ngraph TD\n    A --> B\n```", [])


def test_imports_are_those_of_the_files(site: SimpleNamespace, tmp_path: Path) -> None:
    root = tree(
        tmp_path,
        {
            "high/__init__.py": "",
            "high/__main__.py": "from engage_hri.services.nowhere import x",
            "high/a.py": "import engage_hri.services.middle.b\nfrom engage_hri.services import low",
            "middle/b.py": "def f():\n    from engage_hri.services.low import g",
            "low.py": "",
        },
    )
    made = site.imports.picture("services", (("high",), ("middle",), ("low",)), root)

    assert made.imports == {"high": {"middle", "low"}, "middle": {"low"}, "low": set()}
    assert site.imports.needed(made.imports) == {"high": {"middle"}, "middle": {"low"}, "low": set()}


@pytest.mark.parametrize(
    ("files", "reason"),
    [
        ({"a.py": "", "b.py": "from engage_hri.services.a import x"}, "b imports a"),
        (
            {"b.py": "import engage_hri.services.c", "c.py": "import engage_hri.services.b"},
            "b imports c, c imports b",
        ),
        ({"d.py": ""}, "d has no layer"),
    ],
)
def test_an_import_that_goes_up_or_beside_fails(
    files: dict[str, str], reason: str, site: SimpleNamespace, tmp_path: Path
) -> None:
    with pytest.raises(site.imports.Upwards, match=reason):
        site.imports.picture("services", (("a",), ("b", "c")), tree(tmp_path, files))


def test_arrows_point_down_and_boxes_keep_apart(site: SimpleNamespace) -> None:
    """In every picture of the page, as it is drawn."""
    for folder, rows in site.imports.layers().items():
        if not folder.startswith("services"):
            continue
        made = site.imports.picture(folder, rows)
        drawn = site.drawing.svg(folder, made.layers, made.imports)

        boxes = [
            tuple(map(float, box)) for box in re.findall(r'<rect x="([\d.]+)" y="([\d.]+)" width="([\d.]+)"', drawn)
        ]
        assert len(boxes) == len(made.imports)
        for (x, y, width), (right, same, _) in pairwise(sorted(boxes, key=lambda box: (box[1], box[0]))):
            assert y != same or x + width < right
        paths = re.findall(r'class="arrow" d="([^"]+)"', drawn)
        assert len(paths) == sum(map(len, made.imports.values()))
        for path in paths:
            heights = [float(number) for number in re.findall(r"[MCV, ]?[\d.]+ ([\d.]+)(?= C| V|$)", path)]
            assert heights == sorted(heights)
            assert len(heights) > 1


def test_a_folder_of_services_without_a_picture_is_an_error(site: SimpleNamespace) -> None:
    with pytest.raises(LookupError, match="services/realizer"):
        site.architecture.drawn("<!-- picture of services -->\n")
