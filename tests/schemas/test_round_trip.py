"""What is written reads back equal: any block or fragment, as XML and as JSON, and from one to the other."""

from hypothesis import HealthCheck, given, settings

from engage_hri.schemas.blocks import Block
from engage_hri.schemas.documents.json_codec import decode_json, encode_json, read
from engage_hri.schemas.documents.xml_decode import decode_xml, encode_xml
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.references import disambiguated, without_lines
from tests.schemas.strategies import blocks, fragments

quick = settings(max_examples=40, suppress_health_check=[HealthCheck.too_slow], deadline=None)


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
    assert decode_json(encode_json(block)) == disambiguated(block)


@quick
@given(fragments())
def test_a_fragment_survives_json(fragment: TurnFragment) -> None:
    assert decode_json(encode_json(fragment)) == disambiguated(fragment)


@quick
@given(fragments())
def test_lines_survive_json_but_not_their_removal(fragment: TurnFragment) -> None:
    from_xml = decode_xml(encode_xml(fragment))

    (from_json,) = read(encode_json(from_xml))

    assert from_json == from_xml
    assert without_lines(from_json) == without_lines(disambiguated(fragment))
