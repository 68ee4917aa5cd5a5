"""What is made from the code and tracked is what the code says now."""

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def test_the_page_on_configuration_is_not_stale(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "docs" / "site"))
    import configuration

    assert configuration.page() == (ROOT / "docs" / "configuration.md").read_text(encoding="utf-8"), "make generate"
    del sys.modules["configuration"]


def test_the_table_of_behavior_types_is_not_stale(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "docs" / "site"))
    import types_table

    text = types_table.PAGE.read_text(encoding="utf-8")
    assert types_table.page(text) == text, "make generate"
    del sys.modules["types_table"]


def test_the_table_of_faults_is_not_stale(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "docs" / "site"))
    import faults_table

    for name in faults_table.PAGES:
        text = (faults_table.DOCS / name).read_text(encoding="utf-8")
        assert faults_table.page(name, text) == text, "make generate"
    del sys.modules["faults_table"]


def test_the_table_of_laws_is_not_stale(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "docs" / "site"))
    import laws_table

    text = laws_table.PAGE.read_text(encoding="utf-8")
    assert laws_table.page(text) == text, "make generate"
    del sys.modules["laws_table"]


def test_the_list_of_decisions_is_not_stale_and_tells_what_is_overtaken(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "docs" / "site"))
    import decisions_list

    text = (decisions_list.FOLDER / "README.md").read_text(encoding="utf-8")
    assert decisions_list.page(text) == text, "make generate"
    (tmp_path / "0001-a.md").write_text("# 0001 An idea\n\n*Overtaken by [0002](0002-b.md): a better one.*\n")
    (tmp_path / "0002-b.md").write_text("# 0002 A better one\n\n**Asked.**\n")
    first, second = decisions_list.listed(tmp_path).splitlines()[2:]
    assert first == "- 0001 [An idea](0001-a.md), overtaken by [0002](0002-b.md)"
    assert second == "- 0002 [A better one](0002-b.md)"
    (tmp_path / "0003-c.md").write_text("# 0004 Another number\n")
    with pytest.raises(ValueError, match="0003 TITLE"):
        decisions_list.listed(tmp_path)
    del sys.modules["decisions_list"]


def test_the_list_of_files_is_not_stale_and_wants_a_sentence_of_each(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "docs" / "site"))
    import files_list

    assert files_list.page() == files_list.PAGE.read_text(encoding="utf-8"), "make generate"
    pets = tmp_path / "services" / "pets"
    pets.mkdir(parents=True)
    (pets / "__init__.py").write_text('"""Animals."""\n')
    lives = 'LEAST = 1\nLIVES: int = 3 * 3\n"""Times that it lives.\n\nMore."""\nPAWS, TAILS = 4, 1\n'
    others = '_SECRET = 1\n"""Not told."""\nNAME = "tom4"\n"""Its name."""\n'
    (pets / "cat.py").write_text('"""A cat: how\nit purrs.\n\nMore."""\n' + lives + others)
    (pets / "dog.js").write_text("// Barks\n// at night.\n\n// More.\n")
    assert files_list.page(tmp_path).removeprefix(files_list.HEAD).splitlines() == [
        "",
        "## services/pets/",
        "",
        "Animals.",
        "",
        "- `cat.py`: A cat: how it purrs.",
        "  - `LEAST = 1`, `LIVES = 3 * 3`: Times that it lives.",
        "  - `PAWS, TAILS = 4, 1`",
        "- `dog.js`: Barks at night.",
    ]
    (pets / "cow.py").write_text("MILK = 1\n")
    with pytest.raises(ValueError, match=r"cow\.py: it does not begin"):
        files_list.page(tmp_path)
    del sys.modules["files_list"]


def test_make_generate_writes_all_of_it() -> None:
    """Compared elsewhere: the schemas (tests/schemas/test_export.py), docs/vocabulary.md (tests/realizer)."""
    recipe = (ROOT / "Makefile").read_text(encoding="utf-8").partition("\ngenerate:")[2].partition("\n\n")[0]

    assert "engage_hri.schemas.export" in recipe
    assert "docs/site/configuration.py" in recipe
    assert "docs/site/types_table.py" in recipe
    assert "docs/site/laws_table.py" in recipe
    assert "docs/site/vocabulary_table.py" in recipe
    assert "docs/site/faults_table.py" in recipe
    assert "docs/site/decisions_list.py" in recipe
    assert "docs/site/files_list.py" in recipe
