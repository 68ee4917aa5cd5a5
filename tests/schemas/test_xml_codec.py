"""The dialects of BML and EBML as people write them, and what is refused, on which line, with which advice."""

import pytest

from engage_hri.schemas.behaviors import (
    After,
    Before,
    Constraint,
    Event,
    Face,
    FaceFacs,
    FaceLexeme,
    Gaze,
    GazeShift,
    Gesture,
    Head,
    Mark,
    Pointing,
    Posture,
    Reference,
    Speech,
    SpeechOption,
    Synchronize,
    Timing,
    TurnSignal,
    Wait,
)
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.documents.xml_decode import decode_xml
from engage_hri.schemas.documents.xml_encode import encode_xml
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.fragments import TurnFragment
from tests.schemas.strategies import without_lines

DRAFT = "org.mindmakers.bml"
BML_1_0 = "http://www.bml-initiative.org/bml/bml-1.0"

FRAGMENT = """<?xml version="1.0"?>
<ebml:ebml id="place" xmlns="org.mindmakers.bml"
    xmlns:ebml="edu.wpi.ebml"
    turnIndex="1" turnStatus="full" addressee="human" accept="nod act">
  <speech id="speech-1"><text>Put it on</text></speech>
  <!-- a comment is no one's business -->
  <ebml:reference id="ref-1"
      target="red-cup"
      minReliability="0.85">
    <speechOption text="the cup" cost="2">
      <distractor object="blue-cup"/>
    </speechOption>
    <speechOption text="that" cost="1" deictic="true"/>
  </ebml:reference>
  <constraint id="constraint-1">
    <synchronize ref="speech-1:end">
      <sync ref="ref-1:start"/>
    </synchronize>
  </constraint>
</ebml:ebml>
"""


def block(content: str, namespace: str = DRAFT) -> Block:
    declared = f' xmlns="{namespace}"' if namespace else ""
    decoded = decode_xml(f'<bml id="b"{declared} xmlns:ebml="edu.wpi.ebml">{content}</bml>')
    assert isinstance(decoded, Block)
    return without_lines(decoded)


def behavior(content: str, namespace: str = DRAFT) -> object:
    (only,) = block(content, namespace).behaviors
    return only


def refused(text: str | bytes) -> Fault:
    with pytest.raises(InputRefused) as refusal:
        decode_xml(text, "file.xml")
    fault = refusal.value.fault
    assert fault.where.startswith("file.xml")
    return fault


def test_a_document_is_written_for_people_to_read_it_and_white_space_of_speech_is_kept() -> None:
    block = Block(id="b", behaviors=(Gaze(id="g", target="cup"), Speech(id="s", text="Well,  this")))

    assert (
        encode_xml(block).decode()
        == """\
<?xml version='1.0' encoding='utf-8'?>
<bml xmlns="org.mindmakers.bml" id="b">
  <gaze id="g" target="cup"/>
  <speech id="s">
    <text xml:space="preserve">Well,  this</text>
  </speech>
</bml>
"""
    )


def test_a_turn_fragment_is_read_with_the_line_of_everything() -> None:
    assert decode_xml(FRAGMENT) == TurnFragment(
        id="place",
        turn_index=1,
        turn_status="full",
        addressee="human",
        line=2,
        accept=("nod", "act"),
        behaviors=(
            Speech(id="speech-1", text="Put it on", line=5),
            Reference(
                id="ref-1",
                line=7,
                target="red-cup",
                minimum_reliability=0.85,
                options=(
                    SpeechOption(text="the cup", cost=2, distractors=("blue-cup",), line=10),
                    SpeechOption(text="that", cost=1, deictic=True, line=13),
                ),
            ),
        ),
        constraints=(
            Constraint(
                id="constraint-1",
                line=15,
                operators=(Synchronize(ref="speech-1:end", syncs=("ref-1:start",), line=16),),
            ),
        ),
    )


def test_a_block_means_the_same_with_and_without_namespace() -> None:
    content = """
      <gaze id="g" target="can"/> <gesture id="p" type="POINT" target="can"/> <speech id="s">This can?</speech>
      <constraint><synchronize ref="g:stroke"><sync ref="p:start"/></synchronize></constraint>"""

    assert block(content) == block(content, namespace="")
    assert block(content) == Block(
        id="b",
        behaviors=(Gaze(id="g", target="can"), Pointing(id="p", target="can"), Speech(id="s", text="This can?")),
        constraints=(Constraint(operators=(Synchronize(ref="g:stroke", syncs=("p:start",)),)),),
    )


def test_bml_1_0_is_read_with_inline_sync_points() -> None:
    content = """
      <pointing id="p" target="can" mode="LEFT_HAND" strokeStart="s:m1+0.5" ready="2"/>
      <gaze id="g" target="can" offsetAngle="10" offsetDirection="LEFT" influence="HEAD"/>
      <speech id="s"><text>This <sync id="m1"/>can?</text></speech>
      <required><head id="h" lexeme="NOD" repetition="2" amount="0.7"/></required>"""

    assert block(content, BML_1_0) == Block(
        id="b",
        dialect="bml-1.0",
        behaviors=(
            Pointing(
                id="p",
                target="can",
                mode="LEFT_HAND",
                timing=(Timing("strokeStart", "s:m1+0.5"), Timing("ready", "2")),
            ),
            Gaze(id="g", target="can", offset_angle=10, offset_direction="LEFT", influence="HEAD"),
            Speech(id="s", text="This can?", marks=(Mark("m1", 5),)),
            Head(id="h", lexeme="NOD", repetition=2, amount=0.7, required=True),
        ),
    )


def test_a_fragment_of_bml_1_0_elements_is_spelled_as_the_draft() -> None:
    fragment = decode_xml(f"""
      <ebml:ebml id="f" xmlns:ebml="edu.wpi.ebml" xmlns="{BML_1_0}">
        <gesture id="g" lexeme="BEAT" strokeStart="look:ready + 1"/> <gaze id="look" target="can"/>
        <constraint><after ref="g:strokeEnd"><sync ref="look:relax"/></after></constraint>
      </ebml:ebml>""")

    assert fragment.behaviors[0].timing == (Timing("stroke_start", "look:stroke+1"),)
    assert fragment.constraints[0].operators[0].ref == "g:stroke_end"


@pytest.mark.parametrize(
    ("xml", "expected"),
    [
        ('<gesture id="x" lexeme="BEAT" mode="both"/>', Gesture(id="x", lexeme="BEAT", mode="BOTH_HANDS")),
        ('<gesture id="x" type="beat"/>', Gesture(id="x", lexeme="BEAT")),
        ('<gesture id="x" type="point" target="t" hand="right"/>', Pointing(id="x", target="t", mode="RIGHT_HAND")),
        ('<head id="x" type="NOD"/>', Head(id="x", lexeme="NOD")),
        ('<head id="x" action="rotation" rotation="shake"/>', Head(id="x", lexeme="SHAKE")),
        ('<head id="x" action="nod" repeats="3"/>', Head(id="x", lexeme="NOD", repetition=3)),
        ('<face id="x" type="FACS" au="12" side="LEFT"/>', FaceFacs(id="x", au=12, side="LEFT")),
        ('<face id="x" type="smile"/>', FaceLexeme(id="x", lexeme="SMILE")),
        ('<face id="x" amount="0.2"><lexeme lexeme="SMILE"/></face>', FaceLexeme(id="x", lexeme="SMILE", amount=0.2)),
        ('<face id="x" amount="0.2"/>', Face(id="x", amount=0.2)),
        ('<gazeShift id="x" target="t"/>', GazeShift(id="x", target="t")),
        ('<wait id="x" duration="1.5"/>', Wait(id="x", duration=1.5)),
        (
            '<posture id="x"><stance type="SITTING"/><pose part="ARMS" lexeme="CROSSED"/></posture>',
            Posture(id="x", stance="SITTING", part="ARMS", lexeme="CROSSED"),
        ),
        ('<gaze id="x" target="t" required="true"/>', Gaze(id="x", target="t", required=True)),
        ('<gaze id="x" target="t" other:thing="1" xmlns:other="o"/>', Gaze(id="x", target="t")),
        ('<gaze id="x" target="t"><o:more xmlns:o="o"/><description/></gaze>', Gaze(id="x", target="t")),
        ('<gaze id="x" target="t" end="x:start+1"/>', Gaze(id="x", target="t", timing=(Timing("end", "x:start+1"),))),
        ('<wait id="x" duration=".5"/>', Wait(id="x", duration=0.5)),
        (
            '<ebml:event id="x" kind="directed_gaze" responder="human" cause="reference" optional="true" limit="2"'
            ' accept="look nod"><ebml:object id="cup"/><ebml:anchor ref="x:start + 1"/></ebml:event>',
            Event(
                id="x", kind="directed_gaze", responder="human", objects=("cup",), cause="reference", optional=True,
                limit=2, accept=("look", "nod"), anchors=("x:start + 1",),
            ),
        ),
        ('<ebml:turn id="x" turn="t-1" signal="ended"/>', TurnSignal(id="x", turn="t-1", signal="ended")),
    ],
)  # fmt: skip
def test_a_spelling_of_a_behavior_is_understood(xml: str, expected: object) -> None:
    assert behavior(xml) == expected


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        ("Hello there", Speech(id="s", text="Hello there")),
        ("<text>\n  Hello\n  there </text>", Speech(id="s", text="Hello there")),
        ('<text>Oh <sync id="m"/>yes</text>', Speech(id="s", text="Oh yes", marks=(Mark("m", 3),))),
        ('<text>Oh<tm id="m"/> yes</text>', Speech(id="s", text="Oh yes", marks=(Mark("m", 2),))),
        ('Oh <mark name="m"/> yes', Speech(id="s", text="Oh yes", marks=(Mark("m", 3),))),
        ('Oh <sync ref="m"/>yes', Speech(id="s", text="Oh yes", marks=(Mark("m", 3),))),
        ('Oh <sync ref="s:m"/>yes', Speech(id="s", text="Oh yes", marks=(Mark("m", 3),))),
        ('Yes <sync id="m"/>', Speech(id="s", text="Yes", marks=(Mark("m", 3),))),
        ('<sync id="m"/>', Speech(id="s", text="", marks=(Mark("m", 0),))),
        ("<text>a <![CDATA[<b>]]> &amp; c</text>", Speech(id="s", text="a <b> & c")),
        ('<text xml:space="preserve"> a  b</text>', Speech(id="s", text=" a  b")),
        (
            '<text>Oh <prosody rate="slow">very <mark name="m"/>well</prosody>!</text>',
            Speech(
                id="s",
                text="Oh very well!",
                marks=(Mark("m", 8),),
                markup='Oh <prosody rate="slow">very <mark name="m"/>well</prosody>!',
            ),
        ),
        (
            '<text>Oh well</text><description type="application/ssml+xml"><speak>Oh <break/>well</speak></description>',  # noqa: E501
            Speech(id="s", text="Oh well", markup="Oh <break/>well"),
        ),
    ],
)
def test_speech_is_read_with_its_marks_and_markup(content: str, expected: Speech) -> None:
    assert behavior(f'<speech id="s">{content}</speech>') == expected


def test_a_mark_tied_to_another_sync_point_is_timed() -> None:
    speech = block('<gaze id="g" target="t"/><speech id="s">Oh <sync ref="g:stroke"/>yes</speech>').behaviors[1]

    assert speech == Speech(id="s", text="Oh yes", marks=(Mark("sync-1", 3),), timing=(Timing("sync-1", "g:stroke"),))


def test_a_reference_to_a_mark_that_looks_like_an_offset_is_made_explicit() -> None:
    decoded = block(
        '<speech id="s">a <sync id="m-2"/>b</speech><gaze id="g" target="t" start="s:m-2" end="g:stroke-2"/>'
    )

    assert decoded.behaviors[1].timing == (Timing("start", "s:m-2+0"), Timing("end", "g:stroke-2"))


def test_a_mark_without_a_name_is_refused_with_its_line() -> None:
    with pytest.raises(InputRefused, match="a mark without a name") as refused:
        block('<speech id="s"><text>a\n<sync/> b</text></speech>')

    assert refused.value.fault.line == 2


def test_before_and_after_keep_their_sides() -> None:
    decoded = block("""<gaze id="g" target="t"/><constraint id="c">
      <before ref="3"><sync ref="g:end"/><sync ref="g:relax + 1"/></before>
      <after ref="1"><sync ref="g:start"/></after>
    </constraint>""")

    assert decoded.constraints[0].operators == (
        Before(ref="3", syncs=("g:end", "g:relax + 1")),
        After(ref="1", syncs=("g:start",)),
    )


@pytest.mark.parametrize("written", ["REPLACE", "replace", "Replace"])
def test_composition_is_case_insensitive(written: str) -> None:
    decoded = decode_xml(f'<bml id="b" composition="{written}"/>')

    assert decoded == Block(id="b", composition="REPLACE")


@pytest.mark.parametrize(
    ("old", "new", "line", "reason"),
    [
        ("</ebml:reference>", "", 20, "malformed XML"),
        ("<speech id", "<speach/><speech id", 5, "unknown element <speach>"),
        ('ref="speech-1:end"', 'ref="speech-2:end"', 16, "unknown behavior 'speech-2'"),
        ('ref="speech-1:end"', 'ref="speech-1"', 16, "expected behavior:sync"),
        ('ref="speech-1:end"', 'ref="speech-1:stop"', 16, "no sync point 'stop'"),
        ('sync ref="ref-1:start"', "sync", 17, "<sync> without ref"),
        ("<synchronize", "<synchronise", 18, "malformed XML"),
        ('"0.85"', '"0"', 7, "outside (0, 1)"),
        ('"0.85"', '"1"', 7, "outside (0, 1)"),
        ('"0.85"', '"high"', 7, "minReliability"),
        ('minReliability="0.85"', 'minReliablity="0.85"', 7, "no attribute 'minReliablity'"),
        ('target="red-cup"', "", 7, "no target"),
        ('cost="1"', 'cost="-1"', 13, "cost -1"),
        ('cost="1"', 'cost="nan"', 13, "cost nan"),
        ('cost="1"', "", 13, "no cost"),
        ('deictic="true"', 'deitic="true"', 13, "no attribute 'deitic'"),
        ('turnStatus="full"', 'turnStatus="whole"', 2, "turnStatus"),
        ('turnIndex="1"', 'turnIndex="4"', 2, "turnIndex"),
        ("turnStatus", "turnstatus", 2, "no attribute 'turnstatus'"),
        ('accept="nod act"', 'accept="clap"', 2, "accept"),
        ('id="ref-1"', 'id="speech-1"', 7, "duplicate id 'speech-1', first on line 5"),
        ('id="ref-1"', 'id="bml"', 7, "reserved"),
        ('id="ref-1"', 'id="a:b"', 7, "may hold neither"),
        ('id="ref-1"', "", 7, "no id"),
        ("<text>Put it on</text>", "", 5, "says nothing"),
        ("<text>Put it on</text>", "<text>Put</text> it", 5, "words beside <text>"),
        ('xmlns:ebml="edu.wpi.ebml"', "", 4, "is not defined"),
        ('xmlns:ebml="edu.wpi.ebml"', 'xmlns:ebml="edu.wpi"', 2, "neither BML nor EBML"),
    ],
)
def test_a_bad_fragment_is_refused_with_its_line(old: str, new: str, line: int, reason: str) -> None:
    assert old in FRAGMENT

    fault = refused(FRAGMENT.replace(old, new))

    assert reason in fault.reason
    assert fault.line == line


ALONE = '<ebml xmlns="edu.wpi.ebml" id="f"><reference id="r" target="t" minReliability=".5" propose="true"'


@pytest.mark.parametrize("value", ["true", "1", " True "])
def test_phrases_may_be_left_to_generation(value: str) -> None:
    (reference,) = decode_xml(ALONE.replace("true", value) + "/></ebml>").behaviors

    assert isinstance(reference, Reference)
    assert reference.options is None


def test_phrases_are_either_offered_or_proposed() -> None:
    fault = refused(ALONE + '><speechOption text="it" cost="1"/></reference></ebml>')
    nobody = refused(ALONE.replace("true", "false") + "/></ebml>")
    elsewhere = refused('<ebml xmlns="edu.wpi.ebml" id="f"><event id="e" propose="true"/></ebml>')

    assert (fault.reason, fault.line) == ("phrases are to be proposed, and offered", 1)
    assert (nobody.reason, 'propose="true"' in nobody.advice) == ("no phrase to choose from", True)
    assert elsewhere.reason == "<event> has no attribute 'propose'"


def test_no_phrase_at_all_is_refused() -> None:
    fault = refused('<ebml xmlns="edu.wpi.ebml" id="f"><reference id="r" target="t" minReliability=".5"/></ebml>')

    assert (fault.reason, fault.line) == ("no phrase to choose from", 1)


@pytest.mark.parametrize(
    ("xml", "reason"),
    [
        ("<bml/>", "no id"),
        ('<bml id="b"><reference id="r" target="t"/></bml>', "can't hold an object reference"),
        ('<bml id="b"><required><dance/></required></bml>', "unknown element <dance>"),
        ('<bml id="b"><gaze id="g"/></bml>', "no target"),
        ('<bml id="b"><head id="h" lexeme="NOD" amount="2"/></bml>', "amount"),
        ('<bml id="b"><gesture id="g" lexeme="BEAT" mode="FOOT"/></bml>', "mode"),
        ('<bml id="b"><wait id="w" duration="-1"/></bml>', "negative"),
        ('<bml id="b"><gaze id="g" target="t" start="x:end"/></bml>', "unknown behavior 'x'"),
        ('<bml id="b"><speech id="s">a <sync id="end"/></speech></bml>', "can't name a mark"),
        ('<bml id="b"><speech id="s">a <sync id="m 1"/></speech></bml>', "'m 1' can't name a mark: it holds a space"),
        ('<bml id="b"><speech id="s">a <sync id="a+b"/></speech></bml>', "'a+b' can't name a mark: it holds '+'"),
        ('<bml id="b"><speech id="s">a <sync id="-m"/></speech></bml>', "can't name a mark: it begins with '-'"),
        ('<bml id="b"><speech id="s">a <sync id="m"/> b <sync id="m"/></speech></bml>', "same name"),
        (
            '<bml id="b"><constraint required="true"><during ref="1"/></constraint></bml>',
            "unknown element <during>",
        ),
        ('<bml id="b" composition="BLEND"/>', "composition"),
        ("<html/>", "neither BML nor EBML"),
        ("", "malformed XML"),
        ("hello", "malformed XML"),
    ],
)
def test_a_bad_block_is_refused(xml: str, reason: str) -> None:
    fault = refused(xml)

    assert reason in fault.reason


def test_advice_names_what_was_probably_meant() -> None:
    fault = refused('<bml id="b"><gaze id="gaze-1" target="t" start="gase-1:end"/></bml>')

    assert fault.advice == "did you mean 'gaze-1'?"


@pytest.mark.parametrize("namespace", [DRAFT, BML_1_0])
def test_a_reference_may_name_its_own_block_or_another(namespace: str) -> None:
    content = '<gaze id="g" target="t" start="other:n:end" end="b:g:stroke + 1"/><wait id="w" end="bml:start + 2"/>'

    assert len(block(content, namespace).behaviors) == 2


def test_what_xml_cannot_hold_is_refused_when_written() -> None:
    with pytest.raises(InputRefused, match="JSON"):
        encode_xml(Block(id="b", behaviors=(Gaze(id="g", target="\0"),)))


def test_a_long_utterance_is_read_in_linear_time_and_refused() -> None:
    with pytest.raises(InputRefused, match=f"{100_000 * len('word ') - 1} characters of speech, at most 5000"):
        behavior(f'<speech id="s"><text>{"word <b/> " * 100_000}</text></speech>')


def test_a_number_and_an_own_point_mean_what_the_document_has() -> None:
    block = decode_xml(
        """<bml id="b" xmlns="http://www.bml-initiative.org/bml/bml-1.0">
        <speech id="s"><text>a <sync id="1"/>b</text></speech>
        <gesture id="g" lexeme="BEAT" stroke="s:1" end="start+3"/>
        <gesture id="h" lexeme="BEAT" start="s:2" end="strokeEnd+1"/></bml>"""
    )
    assert isinstance(block, Block)

    timing = {each.id: [(one.sync, one.ref) for one in each.timing] for each in block.behaviors}
    # Speech s has no mark 2: that is two seconds after the start of a block s.
    assert timing["g"] == [("stroke", "s:1+0"), ("end", "g:start+3")]
    assert timing["h"] == [("start", "s:2"), ("end", "h:strokeEnd+1")]
