"""What is written reads back equal: any block or fragment, as XML and as JSON, and from one to the other."""

import pytest
from hypothesis import HealthCheck, given, settings

from engage_hri.schemas.behaviors import Speech
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.documents.dialects import in_dialect
from engage_hri.schemas.documents.json_codec import encode_json, read
from engage_hri.schemas.documents.xml_decode import decode_xml
from engage_hri.schemas.documents.xml_encode import encode_xml
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.references import disambiguated
from tests.random_cases import share_of
from tests.schemas.strategies import blocks, fragments, without_lines
from tests.schemas.test_xml_codec import BML_1_0, DRAFT

quick = settings(max_examples=share_of(40, 3), suppress_health_check=[HealthCheck.too_slow], deadline=None)


@quick
@given(blocks())
def test_a_block_survives_xml(block: Block) -> None:
    expected = disambiguated(block)

    assert without_lines(decode_xml(encode_xml(block))) == expected


@quick
@given(fragments())
def test_a_fragment_survives_xml(fragment: TurnFragment) -> None:
    expected = disambiguated(fragment)

    assert without_lines(decode_xml(encode_xml(fragment))) == expected


@quick
@given(blocks())
def test_a_block_survives_json(block: Block) -> None:
    assert read(encode_json(block))[0] == disambiguated(block)


@quick
@given(fragments())
def test_a_fragment_survives_json(fragment: TurnFragment) -> None:
    assert read(encode_json(fragment))[0] == disambiguated(fragment)


@quick
@given(fragments())
def test_lines_survive_json_but_not_their_removal(fragment: TurnFragment) -> None:
    from_xml = decode_xml(encode_xml(fragment))

    (from_json,) = read(encode_json(from_xml))

    assert from_json == from_xml
    assert without_lines(from_json) == without_lines(disambiguated(fragment))


@pytest.mark.parametrize("namespace", ["", DRAFT, BML_1_0])
@pytest.mark.parametrize(
    "text",
    ["Oh <b>well</b> then", 'a <sync id="m"/>b <emphasis level="strong">c</emphasis>', "<b>one</b>", "<i/> and <i/>"],
)
def test_markup_of_words_survives_xml_in_each_dialect(text: str, namespace: str) -> None:
    block = decode_xml(f'<bml id="b" xmlns="{namespace}"><speech id="s"><text>{text}</text></speech></bml>'.encode())
    assert isinstance(block, Block)
    assert isinstance(block.behaviors[0], Speech)
    assert block.behaviors[0].markup

    for dialect in ("draft", "bml-1.0"):
        written = decode_xml(encode_xml(in_dialect(block, dialect)))
        assert isinstance(written, Block)
        assert without_lines(written).behaviors == without_lines(block).behaviors


def test_markup_that_is_no_xml_or_has_other_words_travels_all_the_same() -> None:
    for markup in ("<b>not closed", "other <b>words</b>"):
        block = Block(id="b", behaviors=(Speech(id="s", text="Oh well", markup=markup),))

        assert without_lines(decode_xml(encode_xml(block))) == block
