"""Our cases in BML 1.0 are BML 1.0 by the grammar; so is what we write of any case."""

from pathlib import Path

import pytest

from engage_hri.schemas.blocks import Block
from engage_hri.schemas.documents.dialects import core, in_dialect
from engage_hri.schemas.documents.json_codec import read
from engage_hri.schemas.documents.xml_encode import encode_xml
from tests.conformance.case import Case, cases
from tests.schemas.grammar import violations

NAMES_ONLY = "a synchronize of one point ties nothing, but names it: it is in no series"
LENIENT = {
    "MERGE, in any case",
    "APPEND waits for what is there",  # in lower case
    NAMES_ONLY,
    "marks in every spelling",
    "what points means is the same in every spelling",
    "descriptions are ignored",  # also where the standard has none, and without a priority
}
"""Rules about what is read beyond the standard."""
PERFORMED = [
    case
    for case in cases(Path(__file__).parent / "cases")
    if not case.warnings and not case.dropped and set(case.outcome) == {"done"}
]


@pytest.mark.parametrize(
    "case", [case for case in PERFORMED if case.dialect == "bml-1.0" and case.rule not in LENIENT], ids=str
)
def test_what_is_meant_as_bml_1_0_is_bml_1_0(case: Case) -> None:
    for block in case.blocks:
        assert violations(block.xml) == []


@pytest.mark.parametrize("case", [case for case in PERFORMED if case.rule != NAMES_ONLY], ids=str)
def test_what_we_write_of_it_as_bml_1_0_is_bml_1_0_and_read_without_a_warning(case: Case) -> None:
    for block in _blocks(case).values():
        written = encode_xml(in_dialect(core(block), "bml-1.0", _blocks(case)))
        (again,) = read(written)

        assert violations(written) == []
        assert b"edu.wpi.ebml" not in written
        assert isinstance(again, Block)
        assert again.unread == ()


def _blocks(case: Case) -> dict[str, Block]:
    read_each = [read(block.xml.encode())[0] for block in case.blocks]
    return {block.id: block for block in read_each if isinstance(block, Block)}
