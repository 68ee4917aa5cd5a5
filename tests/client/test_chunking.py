"""Text as it comes, cut where it can be spoken."""

import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engage_hri.schemas.tool import Gesture, Part, Refer, Say
from engage_hri.services.client.chunking import Chunk, Chunker
from engage_hri.services.text.ear import heard
from engage_hri.services.text.marks import Ids
from tests.random_cases import share_of


def chunks(*pieces: str | Part, **settings: int) -> list[Chunk]:
    chunker = Chunker(**settings)
    made = [chunk for piece in pieces for chunk in chunker.feed(piece)]
    return [*made, *filter(None, [chunker.rest()])]


def words(*pieces: str | Part, **settings: int) -> list[str]:
    """Each chunk as a line."""
    return [
        " ".join(part.say if isinstance(part, Say) else f"<{part.refer}>" for part in chunk)  # type: ignore[union-attr]
        for chunk in chunks(*pieces, **settings)
    ]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("Hello there. How are you? Fine", ["Hello there.", "How are you?", "Fine"]),
        ("Well, yes", ["Well, yes"]),
        ("If you have a moment, look here", ["If you have a moment,", "look here"]),
        ("It weighs 3.5 kg, or so; see e.g. this", ["It weighs 3.5 kg,", "or so; see e.g. this"]),
        ("Mr. Bean and Dr. Who met J. Smith. Then", ["Mr. Bean and Dr. Who met J. Smith.", "Then"]),
        ('"Really?" she said... "Yes!" No', ['"Really?" she said...', '"Yes!"', "No"]),
        ("One\n\nTwo \n \n three", ["One", "Two", "three"]),
        ("line one\nline two", ["line one line two"]),
        ("Take [a]. And [b], please, now", ["Take <a> .", "And <b> , please,", "now"]),
        ("[a] [b] [c]", ["<a> <b> <c>"]),
        ("an [open bracket. And [] more", ["an open bracket.", "And more"]),
        ("你好。请把方块给我！谢谢", ["你好。", "请把方块给我！", "谢谢"]),
        ("他说“好。”然后走了", ["他说“好。”", "然后走了"]),
        ("好的，我们现在开始吧，请看这里", ["好的，我们现在开始吧，", "请看这里"]),
        ("好的,我们现在开始吧,好吗?好", ["好的,我们现在开始吧,", "好吗?", "好"]),
        ("今日は、いい天気ですね。「そう？」と", ["今日は、いい天気ですね。", "「そう？」と"]),
        ("現在12：30、です", ["現在12：30、です"]),
        ("ขอบคุณมากครับ สวัสดี", ["ขอบคุณมากครับ", "สวัสดี"]),
        ("把[a]给我。好", ["把 <a> 给我。", "好"]),
        ("Well 😊 done. 😊", ["Well 😊 done.", "😊"]),
        ("   ", []),
        ("... !", []),
    ],
)
def test_text_is_cut_at_ends_of_sentences_and_of_clauses_that_are_long_enough(text: str, expected: list[str]) -> None:
    assert words(text) == expected


def test_a_chunk_comes_as_soon_as_the_next_character_shows_that_it_is_complete() -> None:
    chunker = Chunker()

    assert list(chunker.feed("Hello.")) == []  # it might be 3.5
    assert list(chunker.feed(" ")) == [(Say(say="Hello."),)]
    assert chunker.rest() == ()


def test_references_may_be_certain() -> None:
    assert chunks("see [a!]") == [(Say(say="see"), Refer(refer="a", certainty="high"))]


def test_parts_stand_where_they_stand() -> None:
    nod = Gesture(gesture="nod")

    assert chunks("Yes, ", nod, "it is [a") == [(Say(say="Yes,"), nod, Say(say="it is a"))]


def test_what_stands_behind_a_reference_is_said_though_it_is_no_word() -> None:
    assert chunks("Is it [a]?") == [(Say(say="Is it"), Refer(refer="a"), Say(say="?"))]


def test_a_part_of_words_leaves_as_soon_as_its_sentence_is_complete() -> None:
    chunker = Chunker()

    assert list(chunker.feed("A whole sentence. Now ")) == [(Say(say="A whole sentence."),)]
    assert list(chunker.feed(Say(say="another one."))) == [(Say(say="Now another one."),)]
    assert list(chunker.feed(Say(say="Could you hand me"))) == []
    assert list(chunker.feed(Refer(refer="cup"))) == []
    assert list(chunker.feed(Say(say="? Thanks. And"))) == [
        (Say(say="Could you hand me"), Refer(refer="cup"), Say(say="?")),
        (Say(say="Thanks."),),
    ]
    assert chunker.rest() == (Say(say="And"),)


def test_a_part_shows_that_the_sentence_before_it_is_complete() -> None:
    nod = Gesture(gesture="nod")

    assert chunks("Yes.", nod, "it is") == [(Say(say="Yes."),), (nod, Say(say="it is"))]


def test_brackets_in_a_part_of_words_are_words() -> None:
    assert chunks(Say(say="see [a] there")) == [(Say(say="see a there"),)]


def test_words_of_different_parts_are_different_words() -> None:
    assert words("one", Say(say="two"), "three", Say(say="four")) == ["one two three four"]
    assert words("把方块", Say(say="给我"), "吧") == ["把方块给我吧"]


def test_how_long_a_clause_must_be_can_be_set() -> None:
    assert words("one, two, three", clause_words=1) == ["one,", "two,", "three"]


texts = st.text(st.sampled_from(list("ab .,!?[]\n\"'DrM好。，」ขั")), max_size=60) | st.lists(
    st.sampled_from(
        ["[a]", "[b!]", "Dr. ", "word ", "end. ", "so, ", "\n\n", "3.5 ", "e.g. ", "我们，", "好。", "吧"]
    ),
    max_size=15,
).map("".join)


@settings(max_examples=share_of(200))
@given(texts, st.data())
def test_it_does_not_matter_in_what_bits_the_text_comes(text: str, data: st.DataObject) -> None:
    cuts = sorted(data.draw(st.lists(st.integers(0, len(text)), max_size=8)))
    bits = [text[start:end] for start, end in zip([0, *cuts], [*cuts, len(text)], strict=True)]

    assert chunks(*bits) == chunks(text) == chunks(*text)


@settings(max_examples=100)
@given(texts)
def test_no_word_is_lost(text: str) -> None:
    spoken = " ".join(words(text))
    plain = re.sub(r"\[([^\[\]\s!]+)!?\]", r"<\1>", text)

    assert "".join(re.findall(r"\w+", spoken)) == "".join(re.findall(r"\w+", plain))


@settings(max_examples=200)
@given(texts)
def test_no_word_is_torn(text: str) -> None:
    inside = set(re.findall(r"[a-zM]+", text))

    assert {word for chunk in words(text) for word in re.findall(r"[a-zM]+", chunk)} == inside


@pytest.mark.parametrize("piece", ["Take [vase] now.", Say(say="Take [vase] now.")])
def test_a_bracket_that_is_said_as_words_is_told_in_text_and_in_parts(piece: str | Part) -> None:
    chunker = Chunker()
    assert [*chunker.feed(piece, Ids(())), chunker.rest(Ids(()))]

    assert chunker.left_out == ("brackets that are no reference were said as words: [vase]",)
    assert heard("Take [vase] now.").problems == ("brackets that are no reference were said as words: [vase]",)


@pytest.mark.parametrize("text", ["Take the [blue-squ", "Take `[blue-square]` now."])
def test_a_bracket_that_is_cut_off_or_in_code_is_words_and_told(text: str) -> None:
    chunker, ids = Chunker(), Ids(("blue-square",))
    made = [*chunker.feed(text, ids), chunker.rest(ids)]

    assert all(isinstance(part, Say) for chunk in made for part in chunk)
    assert chunker.left_out[0].startswith("brackets that are no reference were said as words: [blue-squ")


def test_a_finished_sentence_settles_and_an_unfinished_one_does_not() -> None:
    chunker = Chunker()

    assert list(chunker.feed("Let me")) == list(chunker.settled()) == []
    assert list(chunker.feed(" look this up for you.")) == []
    assert list(chunker.settled()) == [(Say(say="Let me look this up for you."),)]
    assert list(chunker.feed(" Here it is. ")) == [(Say(say="Here it is."),)]
