"""The language of a speech in XML is the nearest `xml:lang`, and what is none is refused with its line."""

import pytest

from engage_hri.schemas.behaviors import Speech
from engage_hri.schemas.documents.xml_decode import decode_xml
from engage_hri.schemas.documents.xml_encode import encode_xml
from engage_hri.schemas.faults import InputRefused

SPACES = ("", ' xmlns="org.mindmakers.bml"', ' xmlns="http://www.bml-initiative.org/bml/bml-1.0"')


def languages(document: str) -> list[str]:
    return [each.language for each in decode_xml(document).behaviors if isinstance(each, Speech)]


@pytest.mark.parametrize("space", SPACES)
@pytest.mark.parametrize(
    ("outer", "speech", "text", "expected"),
    [
        ("", ' xml:lang="de"', "", "de"),
        ("", "", ' xml:lang="pt-BR"', "pt-BR"),
        ("", ' xml:lang="de"', ' xml:lang="fr"', "fr"),
        (' xml:lang="de"', "", "", "de"),
        (' xml:lang="de"', ' xml:lang=""', "", ""),
        ("", "", "", ""),
    ],
)
def test_the_nearest_language_counts(space: str, outer: str, speech: str, text: str, expected: str) -> None:
    document = f'<bml id="b"{space}{outer}><speech id="s"{speech}><text{text}>Guten Tag</text></speech></bml>'

    assert languages(document) == [expected]
    assert languages(encode_xml(decode_xml(document)).decode()) == [expected]


def test_it_holds_for_words_without_a_text_and_behind_a_reference() -> None:
    reference = '<ebml:reference id="r" target="blue" minReliability="0.5" propose="true"/>'
    document = (
        '<ebml:ebml id="f" xmlns="org.mindmakers.bml" xmlns:ebml="edu.wpi.ebml" turnIndex="1" turnStatus="full"'
        ' addressee="human" xml:lang="fr">'
        f'<speech id="s" xml:lang="de">Nimm</speech>{reference} et voilà</ebml:ebml>'
    )

    assert languages(document) == ["de", "fr"]


@pytest.mark.parametrize("tag", ["German!", "en us", "deutschesprache", "-de"])
def test_what_is_no_tag_is_refused_with_its_line(tag: str) -> None:
    with pytest.raises(InputRefused, match=f"line 2: xml:lang='{tag}' is no language.*such as `de` or `pt-BR`"):
        decode_xml(f'<bml id="b">\n<speech id="s" xml:lang="{tag}"><text>Guten Tag</text></speech></bml>')
