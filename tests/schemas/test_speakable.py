"""What is said one after the other, in scripts with spaces and without."""

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from engage_hri.schemas.text import has_words, joined, tokens, word_count
from tests.random_cases import share_of

MIXED = st.text(
    st.sampled_from(list("aZé 3.,!(—😊\n世界。，「」ー。かキャぁ한ข้เไมำ‍ြက္กភ្ាា")) | st.characters(), max_size=40
)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("Okay, let's (start) now.", ["Okay,", "let's", "(start)", "now."]),
        ("Hello, 世界！OK", ["Hello,", "世", "界！", "OK"]),
        ("Hello，world", ["Hello，", "world"]),
        ("「はい」と（言う）", ["「は", "い」", "と", "（言", "う）"]),
        ("きょうキャベツ", ["きょ", "う", "キャ", "ベ", "ツ"]),
        ("เมืองไทย", ["เมื", "อ", "ง", "ไท", "ย"]),
        ("ភាសាខ្មែរ", ["ភា", "សា", "ខ្មែ", "រ"]),
        ("안녕하세요 세계", ["안녕하세요", "세계"]),
        ("好😊 — 3.5kg", ["好😊", "—", "3.5kg"]),
        ("  ", []),
    ],
)
def test_words_are_divided_by_spaces_and_other_scripts_by_characters(text: str, expected: list[str]) -> None:
    assert [token.text for token in tokens(text)] == expected


@settings(max_examples=share_of(300))
@given(MIXED)
@example("「「 ((")
def test_nothing_but_white_space_is_left_out(text: str) -> None:
    found = list(tokens(text))

    assert "".join(token.text for token in found) == "".join(text.split())
    assert all(text[: token.end].endswith(token.text) for token in found)
    assert any(token.letters for token in found) == has_words(text)


def test_an_emoji_is_a_token_without_letters() -> None:
    assert [(token.text, token.letters) for token in tokens("well 😊")] == [("well", 4), ("😊", 0)]
    assert not has_words("😊 …!")


def test_two_characters_count_as_a_word() -> None:
    assert word_count("the red square") == 3
    assert word_count("红色的方块") == 2.5
    assert word_count("…") == 0


def test_texts_are_joined_as_their_scripts_are_written() -> None:
    assert joined(["Take ", " that\n one", "", "."]) == "Take that one."
    assert joined(["把", "红色的方块", "给我。", "谢谢"]) == "把红色的方块给我。谢谢"
    assert joined(["把", "the square", "给我"]) == "把 the square 给我"
