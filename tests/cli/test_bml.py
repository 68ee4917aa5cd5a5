"""`engage bml`: fragments as the BML they become, blocks in another dialect, with or without the extension."""

import json
import re
from pathlib import Path

import pytest

from engage_hri.schemas.blocks import Block
from engage_hri.schemas.documents.json_codec import read
from tests.cli.command import ALONE, FRAGMENT, GOOD_BLOCK, Engage
from tests.schemas.grammar import violations

DOCS = Path(__file__).parents[2] / "docs"


def shown(page: str) -> list[str]:
    """The XML of a page of the documentation."""
    return re.findall(r"```xml\n(.*?)```", (DOCS / page).read_text(encoding="utf-8"), re.DOTALL)


def written(tmp_path: Path, text: str, name: str = "input.xml") -> Path:
    path = tmp_path / name
    path.write_text(text)
    return path


def one(text: str) -> Block:
    (thing,) = read(text.encode())
    assert isinstance(thing, Block)
    return thing


def test_the_documented_fragment_becomes_bml_of_the_standard(engage: Engage, tmp_path: Path) -> None:
    [fragment] = shown("generation.md")  # tests/docs compares what comes of it with the page

    result = engage("bml", written(tmp_path, fragment), "--core")

    assert (result.code, result.err) == (0, "")
    assert violations(result.out) == []


def test_a_fragment_keeps_its_events_unless_told_otherwise(engage: Engage, tmp_path: Path) -> None:
    path = written(tmp_path, FRAGMENT)

    extended, core = (one(engage("bml", path, *flags).out) for flags in ((), ("--core",)))

    ours = {behavior.id for behavior in extended.behaviors} - {behavior.id for behavior in core.behaviors}
    assert ours >= {"turn-pair", "turn-ended", "turn-gaze-event"}
    assert extended.dialect == core.dialect == "bml-1.0"


def test_a_block_is_spelled_in_the_dialect_asked_for_and_back(engage: Engage, tmp_path: Path) -> None:
    spelled = engage("bml", written(tmp_path, GOOD_BLOCK)).out
    back = engage("bml", written(tmp_path, spelled, "back.xml"), "--dialect", "draft").out

    assert 'start="look:ready"' in spelled
    assert violations(spelled) == []
    assert 'xmlns="org.mindmakers.bml"' in back
    assert 'start="look:stroke"' in back


def test_a_turn_in_several_fragments_is_one_document_each(engage: Engage, tmp_path: Path) -> None:
    words = {"type": "speech", "id": "s", "text": "So"}
    turn = [{"id": status, "turn_status": status, "behaviors": [words]} for status in ("beginning", "middle", "end")]

    result = engage("bml", written(tmp_path, json.dumps(turn), "turn.json"), "--core")

    documents = re.split(r"\n\n(?=<\?xml)", result.out)
    assert [one(document).id for document in documents] == ["beginning", "middle", "end"]
    assert [violations(document) for document in documents] == [[], [], []]


def test_what_others_may_refuse_or_nobody_reads_is_warned_of(engage: Engage, tmp_path: Path) -> None:
    block = '<bml id="1st"><wait id="w" duration="1"/><dance/></bml>'

    result = engage("bml", written(tmp_path, block))

    assert result.code == 0
    assert result.err == (
        "warning: line 1: unknown element <dance>; it is ignored\n"
        "warning: id '1st' is no XML name: other realizers of BML 1.0 may refuse it\n"
    )


def test_what_is_refused_when_played_is_refused_here(engage: Engage, tmp_path: Path) -> None:
    path = written(tmp_path, ALONE.replace("blue-square", "blue-circle"))

    result = engage("bml", path)

    assert (result.code, result.out) == (2, "")
    assert f"{path}:3" in result.err
    assert "blue-circle" in result.err


@pytest.mark.parametrize("arguments", [(), ("--dialect", "2.0", "x"), ("--core",)])
def test_bad_arguments_are_refused(engage: Engage, arguments: tuple[str, ...]) -> None:
    assert engage("bml", *arguments).code == 2
