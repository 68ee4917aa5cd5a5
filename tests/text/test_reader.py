"""What is said of a text with marks, what is referred to, and what is told of the rest."""

from collections.abc import Iterable
from random import Random

import pytest

from engage_hri.schemas.behaviors import Speech
from engage_hri.schemas.tool import Say
from engage_hri.services.client.chunking import Chunker
from engage_hri.services.control.contract.body import Spoke
from engage_hri.services.control.serving.live_behavior import progress_of, spoken
from engage_hri.services.control.voice.timeline import uttered
from engage_hri.services.text.ear import heard, is_spoken, said
from engage_hri.services.text.marks import Ids, Piece, Reader, problems
from tests.random_cases import share_of
from tests.text.mixtures import OBJECTS, Maker, letters, plain_text


def read(bits: Iterable[str], ids: Ids) -> list[Piece]:
    reader = Reader()
    return [*(piece for bit in bits for piece in reader.feed(bit, ids)), *reader.finish(ids)]


def words(pieces: Iterable[Piece]) -> str:
    return "".join(each.text for each in pieces if each.kind in ("say", "symbol"))


def bits(text: str, random: Random) -> list[str]:
    found, at = [], 0
    while at < len(text):
        size = random.choice([1, 2, 3, 5, 8, 40])
        found.append(text[at : at + size])
        at += size
    return found


@pytest.mark.parametrize("seed", range(-(-share_of(10_000, 20) // 50)))
def test_letters_are_those_of_a_parser_of_commonmark_in_whatever_bits_a_text_comes(seed: int) -> None:
    for number in range(seed * 50, seed * 50 + 50):
        random = Random(number)
        mixture = Maker(random).mixture()
        pieces = read(bits(mixture.text, random), Ids(OBJECTS))

        assert letters(words(pieces)) == letters(plain_text(mixture.plain)), (number, mixture.text)
        assert tuple(each.text for each in pieces if each.kind == "refer") == mixture.named, (number, mixture.text)


@pytest.mark.parametrize("seed", range(-(-share_of(10_000, 20) // 50)))
def test_the_words_that_a_voice_says_are_those_of_a_parser_of_commonmark(seed: int) -> None:
    for number in range(seed * 50, seed * 50 + 50):
        mixture = Maker(Random(number), with_references=False).mixture()
        speech = Speech(id="s", text=mixture.text)
        asked = spoken(speech)
        assert isinstance(asked, Speech)
        words = uttered(asked).words
        told = [progress_of(speech, Spoke(each.text, each.position, 0.0)).position for each in words]  # type: ignore[union-attr]

        assert letters("".join(each.text for each in words)) == letters(plain_text(mixture.plain)), mixture.text
        assert told == sorted(told)
        assert not told or told[-1] == len(mixture.text)


@pytest.mark.parametrize(
    ("text", "words_of_it"),
    [
        ("**Bold** words and `code` here", "Bold words and code here"),
        ("* star\n* moon", "star, moon"),
        ("* star * moon", "star, moon"),
        ("* star * 5 * 3", "star, 5 * 3"),
        ("# Heading\ntext", "Heading, text"),
        ("***very*** _good_ ~~old~~", "very good old"),
        ("See the [docs](https://example.com) now", "See the docs now"),
        ("![a cat](cat.png) sleeps", "a cat sleeps"),
        ("> quoted", "quoted"),
        ("- [x] done\n- [ ] to do", "done, to do"),
        ("| a | b |\n|---|---|\n| 1 | 2 |", "a, b, 1, 2,"),
        ("```python\nprint(1)\n```\nafter", "print(1) after"),
        ("H<sub>2</sub>O, caf&eacute;", "H2O, café"),
        ("one<br>two", "one, two"),
        ("[laughs] That is funny. *waves* Hello (sighs)", "That is funny. Hello"),
        (
            "It is *very* nice, and *Waves* crash (looks like rain)",
            "It is very nice, and Waves crash (looks like rain)",
        ),
        ("As said [1], [2, 3] and [^4] 【5†source】 show", "As said, and show"),
        ("<think>no\n\nno</think>Yes", "Yes"),
        ("Yes <thinking>never closed", "Yes"),
        ("I like <math> class. It is fun.", "I like class. It is fun."),
        ("A <template> of <x:Script src='a'>it</style>", "A of it"),
        ("So <math><mi>x</mi> 1</math> it <svg/> is", "So it is"),
        (f"<script>{'no ' * 900}</script>Yes", "Yes"),
        ("Hi <mstts:silence/>, <ssml:break/> <bml:mark>x</bml:mark>", "Hi , x"),
        ("<tel:112> <urn:isbn:04> <mailto:a@b.org> <made:up/>", "112 isbn a@b.org"),
        ("B♭, Wörter\u00adbuch, so\u200blid, da&shy;bei", "B♭, Wörterbuch, solid, dabei"),
        ("Go to https://www.example.com/a?b=c. Now", "Go to example.com. Now"),
        ("Write to ann@example.org", "Write to ann@example.org"),
        ('<speed ratio="1.05"/>Hello', "Hello"),
        ("5 * 3, a < b, 5 - 3, 3 > 2, 2^3, ~5", "5 * 3, a < b, 5 - 3, 3 > 2, 2^3, ~5"),
        ("x_1, snake_case, C#, #1, 2*x, $3.50", "x_1, snake_case, C#, #1, 2*x, $3.50"),
        ("1. First\n2. Second", "1. First, 2. Second"),
        ("\\*not emphasis\\* and \\[sic\\]", "*not emphasis* and [sic]"),
        ("Great 👍🏽 ℹ️ 20 °C", "Great 20 °C"),
        ("`<b>` is bold", "<b> is bold"),
        ("[docs][ref]\n\n[ref]: https://example.org 'title'\nend", "docs, end"),
        ("*sigh* Well. _laughs_ No (cough) and (cough syrup)", "Well. No and (cough syrup)"),
        ("*nods* yes. *waves* hello there. *nods slowly* so", "yes. hello there. so"),
        (
            "I *really* mean it. *Really* good. *Looking* at it helps.",
            "I really mean it. Really good. Looking at it helps.",
        ),
        ("See it [1]. Hello (sighs), array[0].", "See it. Hello, array 0."),
        ("Done.<|im_end|>", "Done."),
        ('<tool_call>{"look": "cup"}</tool_call>Yes', "Yes"),
        ("[Robot]: Hello.", "Robot: Hello."),
        ("Title\n=====\n\n---\ntext", "Title, text"),
        ("[![a cat](cat.png)](https://example.org/cats) sleeps", "a cat sleeps"),
        ("Go to https://x.org/a_(b), or www.(sighs)https://x.org", "Go to x.org, or www.x.org"),
    ],
)
def test_what_is_for_the_eye_is_not_said(text: str, words_of_it: str) -> None:
    assert " ".join(heard(text).text.split()) == words_of_it


@pytest.mark.parametrize(
    ("text", "named", "spoken"),
    [
        ("Take [blue square].", [("blue square", False)], "Take ."),
        ("Take [cup!].", [("cup!", False)], "Take ."),
        ("Take [cup!!].", [("cup!", True)], "Take ."),
        ("Take [a[b]].", [("a[b]", False)], "Take ."),
        ("Take [x1!] [x1]", [("x1", True), ("x1", False)], "Take  "),
        ("Take [blue-box].", [("Blue-Box", False)], "Take ."),
        ("array[0] and [sic] [ann] [x]", [], "array 0  and sic ann x"),
        ("[cup](https://example.com) [cup!!](a_(b))", [("cup", False), ("cup!", True)], " "),
        ("[Note]: this is it", [], "Note: this is it"),
        ("a [b [c] d] e", [], "a b c d e"),
        ("an [open bracket", [], "an open bracket"),
    ],
)
def test_a_bracket_is_a_reference_only_if_it_names_an_object(
    text: str, named: list[tuple[str, bool]], spoken: str
) -> None:
    ids = Ids(("blue square", "cup", "cup!", "a[b]", "x1", "Blue-Box"))
    for pieces in (read([text], ids), read(text, ids)):
        assert [(each.text, each.certain) for each in pieces if each.kind == "refer"] == named
        assert words(pieces) == spoken


def test_what_was_left_out_is_told_in_one_line_a_reason() -> None:
    text = "[laughs] See [sic] and [smiles] [1]. https://example.org/x <b>so</b> <think>hm</think>"

    assert problems(read([text], Ids(()))) == (
        "thoughts were not said: <think>",
        "stage directions were not said: [laughs], [smiles]",
        "citations were not said: [1]",
        "addresses were not said in full: https://example.org/x",
        "tags were not said: <b>, </b>",
        "brackets that are no reference were said as words: [sic]",
    )


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("A <!-- b --> c", "tags were not said: <!-- b -->"),
        ("<![CDATA[a]]> <?b ?> <!X>", "tags were not said: <![CDATA[a]]>, <?b ?>, <!X>"),
        ("A <math>b</math> c", "tags were not said: <math>b</math>"),
        ("A <tool_call> c", "tags were not said: <tool_call>"),
        ("A</think> <|im_end|>", "tags were not said: </think>, <|im_end|>"),
        ("```python\nx\n```", "tags were not said: ```python"),
        ("[a](b.html 'c') ![d](e.png)", "addresses were not said in full: (b.html 'c'), (e.png)"),
    ],
)
def test_whatever_had_letters_and_was_left_out_is_told(text: str, told: str) -> None:
    assert problems(read([text], Ids(()))) == problems(read(text, Ids(()))) == (told,)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("Take [cup].", ()),
        ("Take [Cup].", ("ids were written in other letters than the world has: [Cup]",)),
        ("Take [cup] and [CUP!].", ("ids were written in other letters than the world has: [CUP!]",)),
    ],
)
def test_an_id_is_told_only_if_it_was_written_in_other_letters(text: str, told: tuple[str, ...]) -> None:
    assert problems(read([text], Ids(("cup",)))) == problems(read(text, Ids(("cup",)))) == told


@pytest.mark.parametrize(
    ("text", "spoken"),
    [
        ("list[2] entry", "list 2  entry"),
        ("list[2], entry", "list 2, entry"),
        ("list[2]", "list 2"),
        ("[is] it", "is it"),
        ("[is]it", "is it"),
    ],
)
def test_words_in_brackets_do_not_run_into_what_follows(text: str, spoken: str) -> None:
    assert words(read([text], Ids(()))).rstrip() == words(read(text, Ids(()))).rstrip() == spoken


def test_the_world_is_asked_anew_at_each_piece() -> None:
    reader = Reader()
    first = reader.feed("Take [cup] or ", Ids(("cup",)))
    second = [*reader.feed("[cup].", Ids(())), *reader.finish()]

    assert [each.text for each in (*first, *second) if each.kind == "refer"] == ["cup"]
    assert words(second).strip() == "cup."


def test_words_that_were_said_keep_the_spelling_of_their_author() -> None:
    text = "**Bold** 😊 and [laughs] `code`"

    assert " ".join(said(text, len(text)).split()) == "Bold 😊 and code"
    assert said(text, 8) == "Bold"


def test_an_emoji_alone_is_no_words() -> None:
    assert not is_spoken("😊 👍🏽 ℹ️")
    assert not is_spoken("[laughs]")
    assert is_spoken("*very*")


ODD = [
    *"ab1A *_[]()<>`~#!&|\\\n.-+=:/^@\"'{}", "https://", "http:", "www.", "mailto:", "x.y", "@x.y", "https://x.y/z ",
    "<think>", "</think>", "<b>", "<!--", "-->", "<|x|>", "<x@y.z>", "&amp;", "😊", "é", "方", "【1†", "】",
    "(sighs)", "[laughs]", "*waves*", "[a]", "[A!]", "](", "![", "[^1]", "[1]", "[x]", "[r]: ", "```", "~~~\n",
    "<math>", "</math>", "<a:b/>", "<!X>", "|---|", "---|", "\u00ad",
    "`(sighs)`", "`https://x.y/z`", "`www.x.y`", "\n\n", "- ", "1. ", "# ",
]  # fmt: skip
"""Beginnings, ends and wholes of marks."""


def plain_pieces(pieces: Iterable[Piece]) -> list[tuple[object, ...]]:
    """Pieces without regard to where words are cut: what the author wrote next to each other is one piece."""
    found: list[tuple[object, ...]] = []
    for each in pieces:
        if each.kind == "say" and found and found[-1][0] == "say" and found[-1][3] == each.place:
            found[-1] = ("say", f"{found[-1][1]}{each.text}", found[-1][2], each.end)
        else:
            found.append(tuple(each) if each.kind != "say" else tuple(each)[:4])
    return found


@pytest.mark.parametrize("seed", range(-(-share_of(10_000, 20) // 50)))
def test_any_text_is_read_and_the_bits_do_not_matter(seed: int) -> None:
    for number in range(seed * 50, seed * 50 + 50):
        random, ids = Random(number), Ids(("a", "b]"))
        text = "".join(random.choices(ODD, k=random.choice((4, 14, 40))))
        whole = plain_pieces(read([text], ids))

        assert plain_pieces(read(text, ids)) == plain_pieces(read(bits(text, random), ids)) == whole, text
        assert [each[2] for each in whole if each[0] == "say"] == sorted(
            each[2] for each in whole if each[0] == "say"
        )


@pytest.mark.parametrize("seed", range(-(-share_of(10_000, 20) // 50)))
def test_of_a_stream_is_said_what_is_said_of_the_whole_text(seed: int) -> None:
    for number in range(seed * 50, seed * 50 + 50):
        random, ids, chunker = Random(number), Ids(()), Chunker()
        text = "".join(random.choices(ODD, k=random.choice((4, 14, 40))))
        chunks = [*(chunk for bit in bits(text, random) for chunk in chunker.feed(bit, ids)), chunker.rest(ids)]
        said = [heard(part.say).text for chunk in chunks for part in chunk if isinstance(part, Say)]

        assert letters("".join(said)) == letters(heard(text).text), text


@pytest.mark.parametrize("unit", ["[", "[a ", "<a ", "*a ", "`x ", "|", "\n", "(a ", "&", "【", "[x](", "<!--", "# "])
def test_a_long_row_of_marks_is_read_to_its_end(unit: str) -> None:
    text = unit * 10_000

    assert letters(words(read([text], Ids(("cup",))))) == letters(text)
