"""What a block holds that its reader does not know: left out and noted, never silently, and never at its expense."""

import pytest
from msgspec.structs import replace

from schemas.behaviors import Gaze, Mark, Speech, Timing, Unknown
from schemas.blocks import Block, Unread
from schemas.faults import InputRefused
from schemas.xml_codec import decode_xml
from tests.schemas.test_xml_codec import BML_1_0, DRAFT, behavior, block


@pytest.mark.parametrize("namespace", [DRAFT, "", BML_1_0])
@pytest.mark.parametrize(
    ("content", "unread"),
    [
        ("<dance/>", Unread(message="unknown element <dance>", kind="BEHAVIOR_TYPE_NOT_SUPPORTED")),
        (
            '<gaze id="g" target="t"><speed/></gaze>',
            Unread(message="unknown element <speed> in <gaze>", behavior="g"),
        ),
        ('<gaze id="g" target="t" speed="9"/>', Unread(message="<gaze> has no attribute 'speed'", behavior="g")),
        ('<speech id="s" text="?">Hi</speech>', Unread(message="<speech> has no attribute 'text'", behavior="s")),
        ('<constraint><during ref="1"/></constraint>', Unread(message="unknown element <during> in a constraint")),
        (
            '<face id="f"><lexeme lexeme="SMILE"/><facs au="1"/></face>',
            Unread(message="more than one expression in a face", behavior="f"),
        ),
        (
            '<posture id="p"><pose part="ARMS" lexeme="X"/><pose part="LEGS" lexeme="Y"/></posture>',
            Unread(message="more than one <pose> in a posture", behavior="p"),
        ),
    ],
)
def test_what_a_block_holds_beyond_bml_is_left_out_and_noted(content: str, unread: Unread, namespace: str) -> None:
    (noted,) = block(content, namespace).unread

    assert noted == replace(unread, message=f"line 1: {unread.message}; it is ignored")


def test_a_block_keeps_an_unknown_behavior_by_name() -> None:
    decoded = block('<dance id="d" start="1"/><required><gaze id="g" target="t" start="d:apex"/></required>')

    assert decoded.behaviors[0] == Unknown(id="d", element="dance")
    assert decoded.unread == ()


def test_an_attribute_that_names_a_sync_point_was_meant_as_timing() -> None:
    decoded = block('<gaze id="g" target="t" apex="s:end"/><speech id="s">Hi</speech>')

    assert decoded.behaviors[0].timing == (Timing("apex", "s:end"),)


def test_a_block_says_who_should_perform_it() -> None:
    assert decode_xml('<bml id="b" characterId="Melvin"/>') == Block(id="b", character_id="Melvin")


def test_descriptions_and_what_others_added_are_nobodys_business() -> None:
    decoded = block("""<description type="application/x">A <b>greeting</b></description>
      <gaze id="g" target="t" other:speed="9" xmlns:other="o" more:thing="1">
        <description><x/></description><other:x/>
      </gaze><other:dance id="d" xmlns:other="o"/>""")

    assert decoded == Block(id="b", behaviors=(Gaze(id="g", target="t"),))


def test_words_may_stand_in_a_description_alone() -> None:
    speech = behavior("""<speech id="s"><description type="application/ssml+xml">
      <speak xmlns="http://www.w3.org/2001/10/synthesis">Oh <mark name="m"/><emphasis>well</emphasis></speak>
      </description></speech>""")

    assert speech == Speech(
        id="s", text="Oh well", marks=(Mark("m", 3),), markup='Oh <mark name="m"/><emphasis>well</emphasis>'
    )


@pytest.mark.parametrize(
    ("xml", "block"),
    [
        ('<bml id="b"><gaze id="g"/></bml>', "b"),
        ('<bml id="b"><gaze id="g" target="t" start="x:end"/></bml>', "b"),
        ('<bml id="b"><constraint><synchronize><sync/></synchronize></constraint></bml>', "b"),
        ("<bml/>", None),
        ('<bml id="b">', None),
    ],
)
def test_a_refusal_knows_whose_it_is(xml: str, block: str | None) -> None:
    with pytest.raises(InputRefused) as refusal:
        decode_xml(xml, "file.xml")

    assert refusal.value.block == block
