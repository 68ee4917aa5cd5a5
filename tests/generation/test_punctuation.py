"""What follows a referring phrase and is no word is said with it, in every form in which fragments come."""

import json

import pytest
from msgspec.structs import replace

from engage_hri.schemas.behaviors import After, Constraint, Mark, Speech, Synchronize
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.documents.json_codec import encode_json, read
from engage_hri.schemas.documents.xml_decode import decode_xml
from engage_hri.schemas.documents.xml_encode import encode_xml
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.services.commandline.shell.config import Config
from engage_hri.services.commandline.talk.offline_plan import generated
from engage_hri.services.simulation.still import table_world
from tests.generation.emitted import LOOK, Made, block, by_id, lines, reference, speech

WORLD = table_world()
REFERENCE = """<ebml:reference id="{0}" target="blue-square" minReliability="0.6">
<speechOption text="the square" cost="2"/></ebml:reference>"""
XML = f"""<ebml:ebml xmlns:ebml="edu.wpi.ebml" xmlns="org.mindmakers.bml" id="f">
<speech id="s"><text>Is it</text></speech>
{REFERENCE.format("r1")}, or rather
{REFERENCE.format("r2")}?</ebml:ebml>"""
OPTIONS = [{"text": "the square", "cost": 2}]
REFERS = {"type": "reference", "target": "blue-square", "minimum_reliability": 0.6, "options": OPTIONS}
JSON = {
    "type": "fragment", "id": "f",
    "behaviors": [
        {"type": "speech", "id": "s", "text": "Is it"}, {**REFERS, "id": "r1"},
        {"type": "speech", "id": "t", "text": ", or rather"}, {**REFERS, "id": "r2"},
        {"type": "speech", "id": "u", "text": "?"},
    ],
}  # fmt: skip
REFER = {"refer": "blue-square", "phrases": ["the square"]}
CALL = {
    "turn_status": "full",
    "parts": [{"say": "Is it"}, REFER, {"say": ", or rather"}, REFER, {"say": "?"}],
}


def texts(block: Block) -> list[str]:
    return [behavior.text for behavior in block.behaviors if isinstance(behavior, Speech)]


def made(*behaviors: object, chosen: Made = (LOOK, "the cup"), operators: tuple[object, ...] = ()) -> Block:
    constraints = (Constraint(id="c", operators=operators),) if operators else ()  # type: ignore[arg-type]
    fragment = TurnFragment(id="f", behaviors=behaviors, constraints=constraints)  # type: ignore[arg-type]
    return block(fragment, [chosen] * sum(not isinstance(each, Speech) for each in behaviors))


@pytest.mark.parametrize("form", [XML, json.dumps(JSON), json.dumps(CALL)], ids=["xml", "json", "call"])
def test_each_form_says_the_same(form: str) -> None:
    (plan,) = generated(read(form.encode(), "", "f"), WORLD, Config(), "")

    assert texts(plan.block) == ["Is it", "the square,", "or rather", "the square?"]


def test_text_behind_a_reference_survives_both_forms() -> None:
    fragment = decode_xml(XML)

    assert decode_xml(encode_xml(fragment)).behaviors[2].text == ", or rather"  # type: ignore[union-attr]
    assert len(read(encode_json(fragment))[0].behaviors) == 5
    assert fragment.unread == ()


def test_text_behind_a_reference_takes_no_id_of_the_author() -> None:
    fragment = decode_xml(XML.replace('"s"', '"r1-text"'))

    assert [behavior.id for behavior in fragment.behaviors] == ["r1-text", "r1", "r1-text-2", "r2", "r2-text"]


def test_text_behind_a_required_reference_is_required() -> None:
    required = XML.replace(REFERENCE.format("r1"), f"<required>{REFERENCE.format('r1')}").replace(
        "rather", "rather</required>"
    )
    fragment = decode_xml(required)

    assert [behavior.required for behavior in fragment.behaviors] == [False, True, True, False, False]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (".", ["the cup."]), (" ?! ", ["the cup?!"]), ("'s handle", ["the cup's", "handle"]), (",", ["the cup,"]),
        (", and", ["the cup,", "and"]), ("… well", ["the cup…", "well"]), (".5 litres", ["the cup", ".5 litres"]),
        ("and", ["the cup", "and"]), ("(the red)", ["the cup", "(the red)"]), ("'small", ["the cup", "'small"]),
        ("- or so", ["the cup", "- or so"]), ("'ll do", ["the cup'll", "do"]), ("'is' it", ["the cup", "'is' it"]),
        ("。", ["the cup。"]), ("、それから", ["the cup、", "それから"]), ("」と", ["the cup」", "と"]),
    ],
)  # fmt: skip
def test_what_belongs_to_the_phrase(text: str, said: list[str]) -> None:
    assert texts(made(reference("r"), speech("s", text))) == said


def test_several_speeches_of_punctuation_belong_to_the_phrase() -> None:
    assert texts(made(reference("r"), speech("s", "?"), speech("t", "! Or"))) == ["the cup?!", "Or"]
    assert texts(made(reference("r"), speech("s", " "), speech("t", "?"))) == ["the cup?", " "]


def test_marks_move_with_their_words() -> None:
    result = made(reference("r"), speech("s", ", and then", marks=(Mark("o", 0), Mark("m", 2), Mark("n", 6))))

    said = by_id(result)["s"]
    assert isinstance(said, Speech)
    assert (said.text, [(mark.id, mark.position) for mark in said.marks]) == (
        "and then",
        [("o", 0), ("m", 0), ("n", 4)],
    )


def test_markup_stays_as_it_is() -> None:
    marked = speech("s", ", and", markup=", <emphasis>and</emphasis>")

    assert replace(by_id(made(reference("r"), marked))["s"], needs=()) == marked


def test_without_a_phrase_it_stands_alone() -> None:
    assert texts(made(reference("r"), speech("s", "."), chosen=(LOOK, ""))) == ["."]
    assert texts(made(speech("a", "so"), speech("s", "."))) == ["so", "."]


def test_the_id_of_a_speech_that_is_gone_stands_for_the_phrases_end() -> None:
    operators = (
        After(ref="r:end", syncs=("s:start",)), After(ref="s:end", syncs=("t:start",)),
        Synchronize(syncs=("s:start", "r:end+0.5")),
    )  # fmt: skip

    result = made(reference("r"), speech("s", "!"), speech("t", "Now"), operators=operators)

    assert lines(result, "c") == ["t:start after r-phrase:end"]
