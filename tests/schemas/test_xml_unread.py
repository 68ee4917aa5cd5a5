"""What a block holds that its reader does not know: left out and noted, never silently, and never at its expense."""

import pytest
from msgspec.structs import replace

from engage_hri.schemas.behaviors import Gaze, Mark, Speech, Timing, Unknown
from engage_hri.schemas.blocks import Block, Unread
from engage_hri.schemas.documents.xml_decode import decode_xml
from engage_hri.schemas.documents.xml_encode import encode_xml
from engage_hri.schemas.faults import InputRefused
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
        ('Well, <gaze id="g" target="t"/> hello', Unread(message="text 'Well, hello' outside of speech")),
        ('<gaze id="g" target="t" speed="9"/>', Unread(message="<gaze> has no attribute 'speed'", behavior="g")),
        (
            '<head id="g" lexeme="NOD" starrt="1"/>',
            Unread(message="<head> has no attribute 'starrt' (did you mean 'start'?)", behavior="g"),
        ),
        (
            '<gaze id="g" target="t" ofsetAngle="9"/>',
            Unread(message="<gaze> has no attribute 'ofsetAngle' (did you mean 'offsetAngle'?)", behavior="g"),
        ),
        ('<speech id="s" text="?">Hi</speech>', Unread(message="<speech> has no attribute 'text'", behavior="s")),
        ('<constraint><during ref="1"/></constraint>', Unread(message="unknown element <during> in a constraint")),
        (
            '<posture id="p"><stance type="SITTING"/><stance type="STANDING"/></posture>',
            Unread(message="more than one <stance> in a posture", behavior="p"),
        ),
        (
            '<gesture id="g" lexeme="BEAT" trajectory="CURVED"/>',
            Unread(
                message="attribute 'trajectory' of <gesture>, which the draft of 2007 has, is performed by no body",
                behavior="g",
                kind="DEGRADED",
            ),
        ),
        (
            '<face id="f" overshoot="0.3"><lexeme lexeme="SMILE"/></face>',
            Unread(
                message="attribute 'overshoot' of <face>, which BML 1.0 has, is performed by no body",
                behavior="f",
                kind="DEGRADED",
            ),
        ),
        (
            '<head id="h" lexeme="NOD" amount="-0.5"/>',
            Unread(message="the sign of amount '-0.5': a head begins on its own side", behavior="h", kind="DEGRADED"),
        ),
        (
            "<lips/>",
            Unread(
                message="<lips>, which the draft of 2007 has, is performed by no body",
                kind="BEHAVIOR_TYPE_NOT_SUPPORTED",
            ),
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


def test_descriptions_are_nobodys_business_nor_is_what_is_said_of_the_document() -> None:
    decoded = block("""<description type="a/x" other:x="1" xmlns:other="o">A <b>g</b><other:x/></description>
      <gaze id="g" target="t" xml:lang="en" xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" xsi:nil="false">
        <description><x/></description>
      </gaze>""")

    assert decoded == Block(id="b", behaviors=(Gaze(id="g", target="t"),))


@pytest.mark.parametrize("namespace", [DRAFT, "", BML_1_0])
def test_a_behavior_of_another_namespace_is_kept_by_name_and_without_an_id_noted(namespace: str) -> None:
    decoded = block('<o:dance id="d" start="x" xmlns:o="urn:o"/><play xmlns="urn:p"/>', namespace)

    assert decoded.behaviors == (Unknown(id="d", element="o:dance", namespace="urn:o"),)
    message = "line 1: <play> is of namespace 'urn:p', of which nothing is performed; it is ignored"
    assert decoded.unread == (Unread(message=message, kind="CUSTOM_BEHAVIOR_NOT_SUPPORTED"),)
    assert [replace(each, line=0) for each in decode_xml(encode_xml(decoded)).behaviors] == list(decoded.behaviors)


@pytest.mark.parametrize(
    ("content", "behavior", "noted"),
    [
        ('<gaze id="g" target="t" o:speed="9" p:x="1" start="0"><o:y/></gaze>', "g", "<gaze>: o:speed, p:x, <o:y>"),
        ('<face id="f"><lexeme lexeme="SMILE" o:x="1"/></face>', "f", "<face>: o:x"),
        ('<speech id="s">A <o:b o:c="1">b</o:b> <sync id="m" o:at="1"/>c</speech>', "s", "<speech>: <o:b>, o:at"),
        ('<constraint o:x="1"><after ref="0" o:y="1"/></constraint>', "", "<constraint>: o:x, o:y"),
        ('<required o:x="1"><gaze id="g" target="t"/></required>', "", "<required>: o:x"),
        ('<ebml:event id="e" kind="directed_gaze" responder="a" o:x="1"/>', "e", "<event>: o:x"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("root", ["bml", "ebml:ebml"])
def test_what_other_namespaces_add_is_noted_once_for_each_behavior(
    content: str, behavior: str, noted: str, root: str
) -> None:
    namespaces = f'xmlns="{DRAFT}" xmlns:ebml="edu.wpi.ebml" xmlns:o="urn:o" xmlns:p="urn:p"'

    thing = decode_xml(f'<{root} id="b" {namespaces}>\n{content}</{root}>')

    element, parts = noted.split(": ")
    message = f"line 2: what another namespace adds to {element} is not supported: {parts}; it is ignored"
    assert thing.unread == (Unread(message=message, behavior=behavior, kind="CUSTOM_ATTRIBUTE_NOT_SUPPORTED"),)


@pytest.mark.parametrize("root", ["bml", "ebml:ebml"])
def test_an_attribute_of_another_namespace_at_the_root_is_noted(root: str) -> None:
    thing = decode_xml(f'<{root} id="b" xmlns:ebml="edu.wpi.ebml" xmlns:o="urn:o" o:interrupt="a"/>')

    (noted,) = thing.unread
    assert noted.kind == "CUSTOM_ATTRIBUTE_NOT_SUPPORTED"
    assert "o:interrupt" in noted.message


def test_a_required_behavior_of_another_namespace_without_an_id_refuses_the_block() -> None:
    with pytest.raises(InputRefused, match="line 1: <o:dance> is of namespace 'o'"):
        block('<required><o:dance xmlns:o="o"/></required>')


def test_a_fragment_goes_on_without_a_behavior_of_another_namespace() -> None:
    fragment = decode_xml(
        f'<ebml:ebml id="f" xmlns="{DRAFT}" xmlns:ebml="edu.wpi.ebml"><o:x id="x" xmlns:o="o"/></ebml:ebml>'
    )

    assert fragment.behaviors == ()
    assert [(each.behavior, each.kind) for each in fragment.unread] == [("x", "CUSTOM_BEHAVIOR_NOT_SUPPORTED")]


@pytest.mark.parametrize(
    ("content", "text"),
    [
        ("<speech id='s'><text>Oh <o:b>my</o:b> dear</text></speech>", "Oh my dear"),
        ("<speech id='s'>Oh <o:b>my <o:c>dear</o:c></o:b></speech>", "Oh my dear"),
        ("<speech id='s'><text>Oh my</text><o:b>7</o:b></speech>", "Oh my"),
        (
            "<speech id='s'><o:b>7</o:b><description type='application/ssml+xml'>Oh my</description></speech>",
            "Oh my",
        ),
    ],
)
def test_words_inside_an_element_of_another_namespace_are_words(content: str, text: str) -> None:
    decoded = block(f'<required xmlns:o="urn:o">{content}</required>')

    assert [each.text for each in decoded.behaviors if isinstance(each, Speech)] == [text]
    assert [each.kind for each in decoded.unread] == ["CUSTOM_ATTRIBUTE_NOT_SUPPORTED"]


@pytest.mark.parametrize("namespace", [DRAFT, "", BML_1_0])
@pytest.mark.parametrize(
    ("content", "marks"),
    [
        ("", ()),
        ("<text/>", ()),
        (" \n", ()),
        ('<sync id="m"/>', (Mark("m", 0),)),
        ("<description>x</description>", ()),
    ],
)
def test_words_may_stand_in_an_attribute_if_nowhere_else(
    content: str, marks: tuple[Mark, ...], namespace: str
) -> None:
    decoded = block(f'<speech id="s" text=" Hi  there ">{content}</speech>', namespace)

    assert decoded == replace(decoded, behaviors=(Speech(id="s", text="Hi there", marks=marks),), unread=())


@pytest.mark.parametrize("speech", ['<speech id="s" text=" "/>', '<speech id="s" text=""><text> </text></speech>'])
def test_an_attribute_without_words_says_nothing(speech: str) -> None:
    if "<text>" in speech:
        assert [each.text for each in block(speech).behaviors if isinstance(each, Speech)] == [""]
    else:
        with pytest.raises(InputRefused, match="says nothing"):
            block(speech)


def test_what_a_mark_cannot_say_is_noted_once_for_all_the_marks_of_a_speech() -> None:
    decoded = block(
        '<speech id="s">One <sync id="a" time="0.4"/>two <sync id="b" time="0.8"/>three '
        '<mark name="c" time="1"/></speech>'
    )

    messages = [f"line 1: <{each}> has no attribute 'time'; it is ignored" for each in ("sync", "mark")]
    assert decoded.unread == tuple([Unread(message=each, behavior="s") for each in messages])
    assert [each.marks for each in decoded.behaviors if isinstance(each, Speech)] == [
        (Mark("a", 4), Mark("b", 8), Mark("c", 13))
    ]


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


@pytest.mark.parametrize(
    ("content", "element", "behavior"),
    [
        ('<required velocity="1"><wait id="w" duration="1"/></required>', "required", ""),
        ('<constraint velocity="1"/>', "constraint", ""),
        ('<constraint><after ref="1" velocity="1"/></constraint>', "after", ""),
        ('<constraint><after ref="0"><sync ref="1" velocity="1"/></after></constraint>', "sync", ""),
        ('<face id="f"><lexeme lexeme="SMILE" velocity="1"/></face>', "lexeme", "f"),
        ('<face id="f"><facs au="1" velocity="1"/></face>', "facs", "f"),
        ('<posture id="f"><stance type="X" velocity="1"/></posture>', "stance", "f"),
        ('<posture id="f"><pose part="X" velocity="1"/></posture>', "pose", "f"),
        ('<speech id="f"><text velocity="1">Hi</text></speech>', "text", "f"),
        ('<gaze id="f" target="t" velocity="1"/>', "gaze", "f"),
    ],
)
@pytest.mark.parametrize("root", ["bml", "ebml:ebml"])
def test_an_attribute_that_nobody_reads_is_noted_wherever_it_stands(
    content: str, element: str, behavior: str, root: str
) -> None:
    thing = decode_xml(f'<{root} id="b" xmlns="{DRAFT}" xmlns:ebml="edu.wpi.ebml">\n{content}</{root}>')

    message = f"line 2: <{element}> has no attribute 'velocity'; it is ignored"
    assert thing.unread == (Unread(message=message, behavior=behavior),)


@pytest.mark.parametrize("namespace", [DRAFT, "", BML_1_0])
def test_an_event_of_the_core_is_unknown_in_each_dialect(namespace: str) -> None:
    assert block('<event id="e" emit="x"/>', namespace).behaviors == (Unknown(id="e", element="event"),)


def test_a_fragment_with_a_sync_point_that_a_behavior_lacks_is_refused() -> None:
    with pytest.raises(InputRefused, match="line 2: 'g' has no sync point 'apex'"):
        decode_xml(
            '<ebml id="f" xmlns="edu.wpi.ebml">\n<gaze xmlns="" id="g" target="t" apex="s:end"/>'
            '<speech xmlns="" id="s">Hi</speech></ebml>'
        )


@pytest.mark.parametrize("id", ["a b", "a:b", "bml", "x" * 251])
def test_a_bad_id_of_the_whole_names_its_line(id: str) -> None:
    with pytest.raises(InputRefused) as refusal:
        decode_xml(f'<!-- -->\n<bml id="{id}"/>')

    assert refusal.value.fault.line == 2


SWALLOWED = {
    "constraint": (
        '<gaze id="a" target="t"/><constraint><synchronize ref="a:end">'
        '\n<sync ref="a:end"><gaze id="x" target="t"/></sync></synchronize></constraint>',
        "<gaze> in <sync>", "",
    ),
    "face": ('<face id="a"><lexeme lexeme="SMILE">\n<gaze id="x" /></lexeme></face>', "<gaze> in <lexeme>", "a"),
    "posture": (
        '<posture id="a"><pose part="ARMS" lexeme="X">\n<wait id="x" duration="1"/></pose></posture>',
        "<wait> in <pose>", "a",
    ),
    "words": ('<speech id="a">Well, \n<gaze id="x" target="t"/> hello</speech>', "<gaze> in <speech>", "a"),
    "text": ('<speech id="a"><text>Oh, <b>\n<head id="x"/></b>hi</text></speech>', "<head> in <speech>", "a"),
    "mark": ('<speech id="a">Hi <sync id="m">\n<gaze id="x"/></sync>you</speech>', "<gaze> in <speech>", "a"),
    "empty mark": ('<speech id="a">Hi <sync id="m">\n<um/></sync>you</speech>', "<um> in <sync>", "a"),
}  # fmt: skip


@pytest.mark.parametrize("name", SWALLOWED)
def test_no_element_swallows_what_stands_in_it(name: str) -> None:
    content, reason, behavior = SWALLOWED[name]

    decoded = block(content)

    message = f"line 2: unknown element {reason}; it is ignored"
    assert decoded.unread == (Unread(message=message, behavior=behavior),)
    assert [each.id for each in decoded.behaviors] == ["a"]
    with pytest.raises(InputRefused, match=f"unknown element {reason}") as refused:
        decode_xml(f'<ebml:ebml id="f" xmlns="{DRAFT}" xmlns:ebml="edu.wpi.ebml">{content}</ebml:ebml>')
    assert refused.value.fault.line == 2
    assert "beside" in refused.value.fault.advice


def test_a_reference_among_the_words_of_a_fragment_is_refused() -> None:
    with pytest.raises(InputRefused, match="unknown element <reference> in <speech>") as refused:
        decode_xml(
            '<ebml:ebml id="f" xmlns="org.mindmakers.bml" xmlns:ebml="edu.wpi.ebml"><speech id="s">Take '
            '<ebml:reference id="r" target="cup"/> please</speech></ebml:ebml>'
        )

    assert "put it beside the speech" in refused.value.fault.advice


def test_what_is_left_out_of_words_is_no_markup_and_the_words_around_it_stay() -> None:
    speech = behavior('<speech id="s"><b>Well</b>, <gaze id="x" target="t"/> hello<sync id="m"/> you</speech>')

    assert speech == Speech(
        id="s", text="Well, hello you", marks=(Mark("m", 11),), markup='<b>Well</b>,  hello<mark name="m"/> you'
    )


@pytest.mark.parametrize(
    ("content", "line"),
    [
        ("\n\n  words <gaze id='g' target='t'/>", 3),
        ("\n<gaze id='g'\n target='t'/>\n  words", 4),
        ("\n<speech id='s'><text>one\ntwo</text>\n</speech> words", 4),
        ("\n<speech id='s'><text>one\ntwo</text>\n</speech>\n\nwords\n<gaze id='g' target='t'/> more", 6),
    ],
)
def test_words_outside_of_speech_are_noted_with_their_own_line(content: str, line: int) -> None:
    (noted,) = block(content, DRAFT).unread

    assert noted.message.startswith(f"line {line}: text 'words")


def test_a_speech_says_the_first_of_its_alternatives() -> None:
    said = "".join(
        f'<alternative><text>{word} <sync id="m"/>there</text></alternative>' for word in ("Hello", "Hi", "Hey")
    )

    for content in (said, said.replace("<text>", "").replace("</text>", "")):
        found = decode_xml(f'<bml id="b"><speech id="s">{content}</speech></bml>')

        assert isinstance(found, Block)
        (speech,) = found.behaviors
        assert isinstance(speech, Speech)
        assert (speech.text, speech.marks, speech.markup) == ("Hello there", (Mark("m", 6),), "")
        assert [each.kind for each in found.unread] == ["DEGRADED"]


@pytest.mark.parametrize(
    "document",
    [
        '<x:bml id="b"/>',
        '<ebml id="e"><x:reference id="r" object="cup"/></ebml>',
        '<bml id="b"><wait id="w" x:a=""/></bml>',
    ],
)
def test_prefixes_are_declared(document: str) -> None:
    with pytest.raises(InputRefused, match=r"prefix x .* is not defined .*declare the prefix"):
        decode_xml(document)
