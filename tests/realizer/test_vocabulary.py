"""Everything that the dialects define, played on the simulated body: what happens is what docs/vocabulary.md says."""

import asyncio
import sys
from pathlib import Path
from types import ModuleType

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.blocks import Block, SyncPointProgress, WarningFeedback
from engage_hri.schemas.documents.xml_decode import decode_xml
from engage_hri.schemas.vocabulary import Term, terms
from engage_hri.services.control.config import Variability
from tests.realizer.test_simulated_body import robot

SITE = Path(__file__).parents[2] / "docs" / "site"


@pytest.fixture(scope="module")
def table() -> ModuleType:
    sys.path.insert(0, str(SITE))
    try:
        import vocabulary_table
    finally:
        sys.path.remove(str(SITE))
    del sys.modules["vocabulary_table"]
    return vocabulary_table


@pytest.mark.parametrize("term", list(terms()), ids=str)
async def test_each_term_is_performed_degraded_or_dropped_as_the_page_says(term: Term, table: ModuleType) -> None:
    block = decode_xml(table.sample(term))
    assert isinstance(block, Block)
    async with robot(Variability()) as seen:
        seen.bus.publish(keys.WORLD, table.WORLD)
        await asyncio.sleep(0.1)
        outcome = await seen.perform(block)
    warnings = [each for each in seen.feedback if isinstance(each, WarningFeedback)]
    reached = [each.sync for each in seen.feedback if isinstance(each, SyncPointProgress)]

    assert outcome is not None
    expected = table.told(term)
    assert outcome.status == "done" or expected.outcome == "dropped"
    if expected.outcome == "performed":
        assert warnings == []
    else:
        (warning,) = warnings
        assert (warning.kind == "DEGRADED") is (expected.outcome == "degraded")
        assert (term.value or term.attribute or term.element) in warning.message or expected.outcome == "dropped"
        assert "unknown" not in warning.message
        assert expected.warning.removesuffix("; it is ignored") in warning.message
    if expected.outcome == "degraded" and term.value:
        assert len(warning.message.split("'")) >= 5, "it names what was asked and what is done"
    assert outcome.dropped == (("x",) if expected.outcome == "dropped" else ())
    assert (reached[:1], reached[-1:]) == (([], []) if expected.outcome == "dropped" else (["start"], ["end"]))


def test_the_page_is_not_stale(table: ModuleType) -> None:
    assert table.page() == table.PAGE.read_text(encoding="utf-8"), "make generate"
