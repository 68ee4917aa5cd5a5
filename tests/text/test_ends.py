"""Ends of sentences, against a list that was written by hand before any rule was."""

from pathlib import Path

import pytest

from engage_hri.services.text.ends import next_end

ROWS = [
    tuple(line.split("\t"))
    for name in ("sentences.txt", "unseen.txt")
    for line in (Path(__file__).parent / name).read_text("utf-8").splitlines()
    if not line.startswith("#")
]
LANGUAGES = sorted({language for language, _ in ROWS})
UNSPACED = ("zh", "ja")
MISSED = (
    "Acme Corp. and Smith Bros. Ltd. merged.",
    "Wait... what is that? | I do not know.",
    "« Viens ici ! » dit-il. | Elle vint.",
    "Vive en EE. UU. desde 1999. | Le gusta.",
    "Il est 8 h. | On part.",
    "« Bonjour ! » dit-elle. | Il sourit.",
    "Cuesta 3,5 euros aprox. por kilo.",
    "EE. UU. es un país grande.",
    "L'ing. Neri lavora a Roma. | Torna lunedì.",
    "A Dra. Costa ligou às 10 h. | Volte mais tarde.",
)
"""Ten of 343: a pause at `...` does no harm, and others cost too many other sentences. The table is as it was before
`unseen.txt` was written, so that this says how good it is on sentences that it has not seen."""


def joined(language: str, row: str) -> str:
    """The text of a row, in which ` | ` stands between sentences."""
    return ("" if language in UNSPACED else " ").join(row.split(" | "))


def sentences(text: str) -> list[str]:
    found, since, text = [], 0, f"{text} "
    while True:
        end, since = next_end(text, since)
        if end is None:
            return [*found, text.strip()] if text.strip() else found
        is_thai = "\u0e00" <= text[end.place - 1] <= "\u0e7f"
        if end.kind == "sentence" or is_thai:
            found.append(text[: end.place].strip())
            text, since = text[end.place :], 0


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_sentence_ends_where_a_reader_says(language: str) -> None:
    rows = [row for of, row in ROWS if of == language and row not in MISSED]
    found = [" | ".join(sentences(joined(language, row))) for row in rows]

    assert found == rows


@pytest.mark.parametrize("language", LANGUAGES)
def test_the_bits_in_which_a_text_comes_do_not_matter(language: str) -> None:
    for text in [joined(of, row) + " " for of, row in ROWS if of == language]:
        whole = next_end(text)[0]
        since, found = 0, None
        for size in range(1, len(text) + 1):
            found, since = next_end(text[:size], since)
            if found is not None:
                break

        assert found == whole, text


@pytest.mark.parametrize("word", ["red", "it", "cup", "there", "1999", "square"])
def test_an_ordinary_word_does_not_wait_for_the_next(word: str) -> None:
    assert next_end(f"This is {word}. ")[0] is not None
