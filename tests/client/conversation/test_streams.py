"""What models' servers stream: bytes cut anywhere lose no word, and tool calls are words as they come."""

import json
import random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from engage_hri.schemas.tool import Gesture, Refer
from engage_hri.services.client.conversation.calls import CallReader
from engage_hri.services.client.conversation.dialects import (
    CallBit,
    Finished,
    ModelFailed,
    TextBit,
    ToolForm,
    read_arguments,
)
from engage_hri.services.client.conversation.history import PersonSaid, RobotSaid, ToolCall, messages
from engage_hri.services.client.conversation.wire import Frames
from tests.client.conversation.servers import STREAMS, Script, cut, dialect

WORDS = (
    "hello", "Grüß", "dich", "日本語", "naïve", "😊", "quote\"d", "back\\slash", "line\nbreak", "[cup]", "data:",
    "ok", "é́", "tab\t", "{brace}", "nul", "\u2028",
)  # fmt: skip


def scripts(chance: random.Random) -> Script:
    def text() -> str:
        return " ".join(chance.choice(WORDS) for _ in range(chance.randrange(1, 30)))

    made: list[Any] = []
    for _ in range(chance.randrange(1, 4)):
        parts = [
            {"say": text()} if chance.random() < 0.7 else {"refer": "cup"} for _ in range(chance.randrange(1, 4))
        ]
        made.append(
            text() if chance.random() < 0.6 else ("perform_turn_fragment", {"turn_status": "full", "parts": parts})
        )
    return made


def read(form: str, chunks: list[bytes]) -> tuple[str, dict[int, CallBit], bool]:
    """What a stream says: its text, its calls with all of their JSON, and whether it is complete."""
    frames, of = Frames(dialect(form).framing), dialect(form)
    events = [event for chunk in chunks for event in frames.feed(chunk)]
    text, calls, is_finished = "", dict[int, CallBit](), False
    for bit in (bit for event in [*events, *frames.end()] for bit in of.read(event)):
        match bit:
            case TextBit():
                text += bit.text
            case CallBit(number=number):
                known = calls.get(number, CallBit(number))
                calls[number] = CallBit(number, known.id + bit.id, known.name + bit.name, known.json + bit.json)
            case Finished():
                is_finished = True
    return text, calls, is_finished


@pytest.mark.parametrize("form", STREAMS)
def test_of_500_streams_cut_at_any_byte_no_letter_is_lost(form: str) -> None:
    for seed in range(500):
        chance = random.Random(seed)
        script = scripts(chance)
        data = b"".join(STREAMS[form](script))
        if chance.random() < 0.3:
            data = data.replace(b"\n", b"\r\n")
        elif form != "ollama" and chance.random() < 0.2:
            data = data.replace(b"\n", b"\r")
        text, calls, is_finished = read(form, cut(data, chance))

        assert is_finished, seed
        assert text == "".join(each for each in script if isinstance(each, str)), seed
        told = [(call.name, read_arguments(call.json)) for call in calls.values()]
        assert told == [each for each in script if not isinstance(each, str)], seed


@given(st.lists(st.text(min_size=1), min_size=1, max_size=4), st.data())
def test_words_of_a_call_come_as_they_are_written_and_none_twice(says: list[str], data: st.DataObject) -> None:
    written = json.dumps(
        {"turn_status": "full", "parts": [{"say": say} for say in says]}, ensure_ascii=data.draw(st.booleans())
    )
    places = sorted(data.draw(st.lists(st.integers(0, len(written)))))
    bits = [written[begin:end] for begin, end in zip([0, *places], [*places, len(written)], strict=True)]
    reader, told = CallReader(), ""
    for bit in bits:
        told += "".join(str(piece) for piece in reader.feed(bit))
        assert "".join(f"{say} " for say in says).encode(errors="replace").startswith(told.encode(errors="replace"))
    told += "".join(str(piece) for piece in reader.end())

    assert told == "".join(f"{say} " for say in says)
    assert reader.fields == {"turn_status": "full"}


def test_a_word_is_there_before_its_sentence_is_and_a_reference_when_it_is_complete() -> None:
    reader = CallReader()
    told = [
        [*reader.feed(bit)]
        for bit in (
            '{"parts": [{"sa',
            'y": "Take the',
            ' "}, {"refer": "cu',
            'p"}, {"gesture"',
            ': "nod"}, 7, {"say": 3}]}',
        )
    ]

    assert told == [[], ["Take the"], [" ", " "], [Refer(refer="cup")], [Gesture(gesture="nod")]]
    assert [*reader.end()] == []


def test_what_is_no_json_or_no_call_says_nothing() -> None:
    for wrong in (
        "",
        "null",
        "[1]",
        '{"parts": 3}',
        '{"parts": [{"tell": "x"}]}',
        '{"parts": [{"refer": 3}]}',
        "nonsense",
    ):
        reader = CallReader()
        assert [*reader.feed(wrong), *reader.end()] == []


@pytest.mark.parametrize(
    ("form", "event", "told"),
    [
        ("openai", '{"error": {"message": "too many", "code": 429}}', "too many"),
        (
            "anthropic",
            '{"type": "error", "error": {"type": "overloaded_error", "message": "Overloaded"}}',
            "Overloaded",
        ),
        ("ollama", '{"error": "model not found"}', "model not found"),
        ("openai", "<html>", "is not read"),
        ("openai", "[1]", "is not read"),
        ("ollama", '{"message": {"tool_calls": [{}]}}', "is not read"),
    ],
)
def test_an_error_in_a_stream_is_told(form: str, event: str, told: str) -> None:
    with pytest.raises(ModelFailed, match=told):
        list(dialect(form).read(event))


def test_what_a_model_thinks_is_no_word() -> None:
    openai = '{"choices": [{"delta": {"reasoning_content": "hm", "content": null}}]}'
    anthropic = '{"type": "content_block_delta", "index": 0, "delta": {"type": "thinking_delta", "thinking": "hm"}}'
    ollama = '{"message": {"content": "", "thinking": "hm"}, "done": false}'
    told = [
        [*dialect(form).read(event)]
        for form, event in (("openai", openai), ("anthropic", anthropic), ("ollama", ollama))
    ]
    assert told == [[], [], []]


HISTORY = (
    PersonSaid(who="ann", text="Is it warm?", began=0.0),
    RobotSaid(to="ann", began=1.0, written="Let me look.", said="Let me look.",
              calls=[ToolCall(id="c1", name="weather", arguments='{"city": "Ulm"}', result="12 degrees")]),
    RobotSaid(to="ann", began=2.0, written="It is twelve degrees.", said="It is", unsaid="twelve degrees."),
    PersonSaid(who="ben", text="Stop.", began=3.0),
)  # fmt: skip
TOOL = ToolForm(name="weather", description="Tells it.", schema={"type": "object", "properties": {}})


def test_a_history_says_who_spoke_what_was_cut_and_what_tools_told() -> None:
    told = [(each.role, each.text, len(each.calls)) for each in messages(HISTORY)]

    assert told == [
        ("user", "ann: Is it warm?", 0), ("assistant", "Let me look.", 1), ("results", "", 1),
        ("assistant", "It is", 0),
        ("user", '(You were interrupted, and have not said: "twelve degrees.")\nben: Stop.', 0),
    ]  # fmt: skip
    assert [each.role for each in messages(HISTORY[1:2])] == ["user", "assistant", "results"]


def test_each_form_has_its_own_body() -> None:
    chat = dialect("openai").body("m", "You are kind.", messages(HISTORY), [TOOL])
    assert [each["role"] for each in chat["messages"]] == ["system", "user", "assistant", "tool", "assistant", "user"]
    assert chat["messages"][2]["tool_calls"][0]["function"] == {"name": "weather", "arguments": '{"city": "Ulm"}'}
    assert (chat["messages"][3]["tool_call_id"], chat["stream"]) == ("c1", True)

    own = dialect("anthropic").body("m", "You are kind.", messages(HISTORY), [TOOL])
    assert [each["role"] for each in own["messages"]] == ["user", "assistant", "user", "assistant", "user"]
    assert own["messages"][1]["content"][1]["input"] == {"city": "Ulm"}
    assert own["messages"][2]["content"][0] == {"type": "tool_result", "tool_use_id": "c1", "content": "12 degrees"}
    assert (own["system"], own["tools"][0]["input_schema"]) == ("You are kind.", TOOL.schema)

    lines = dialect("ollama").body("m", "", messages(HISTORY), [])
    assert lines["messages"][1]["tool_calls"][0]["function"]["arguments"] == {"city": "Ulm"}
    assert "tools" not in lines
