"""The end of a turn is said lower, thesis 3.3.1: the block says so, and the prosody is that of its last words."""

from engage_hri.schemas.behaviors import Gaze, Mark, Speech
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.documents.prosody import Prosody, spans
from engage_hri.schemas.documents.xml_decode import decode_xml
from engage_hri.schemas.documents.xml_encode import encode_xml
from engage_hri.services.generation.block.emission import lowered


def low(text: str, *marks: Mark, markup: str = "") -> Speech:
    speech = Speech(id="s", text=text, marks=marks, markup=markup)
    result = lowered((Gaze(id="g", target="human"), speech), "s")[1]
    assert isinstance(result, Speech)
    return result


def test_the_last_two_words_are_lower():
    text = "Can you move <it> here & now?"

    assert low(text).markup == 'Can you move &lt;it&gt; <prosody pitch="low">here &amp; now?</prosody>'
    assert spans(low(text)) == (Prosody(start=18, end=29, pitch=0.85),)
    assert spans(low("Stop!")) == (Prosody(start=0, end=5, pitch=0.85),)
    assert spans(low("请把方块放在左边。")) == (Prosody(start=4, end=9, pitch=0.85),)


def test_an_authors_own_prosody_stays():
    markup = '<prosody pitch="high">Now</prosody> you'

    assert low("Now you", markup=markup).markup == markup
    assert low("…").markup == ""


def test_the_block_can_be_written_as_xml_with_its_marks():
    speech = low("Move the blue one", Mark("m", 9), Mark("n", 13))
    block = Block(id="b", behaviors=(speech,))
    read = decode_xml(encode_xml(block))

    assert isinstance(read, Block)
    assert isinstance(read.behaviors[0], Speech)
    assert (read.behaviors[0].markup, read.behaviors[0].marks) == (speech.markup, speech.marks)
