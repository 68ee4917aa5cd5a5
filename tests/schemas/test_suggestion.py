"""Advice about names that are not known."""

import pytest

from engage_hri.schemas.suggestion import meant, suggestion


@pytest.mark.parametrize(
    ("name", "known", "advice"),
    [
        ("humn", ["table", "human"], "did you mean 'human'?"),
        ("x", ["table", "human"], "known: human, table"),
        ("x", [f"n{number:02}" for number in range(12)], f"known: {', '.join(f'n{each:02}' for each in range(12))}"),
        (
            "x",
            [f"n{number:02}" for number in range(13)],
            f"known: {', '.join(f'n{each:02}' for each in range(12))}, ...",
        ),
        ("x", [], "known: none"),
    ],
)
def test_the_name_that_was_probably_meant_or_those_that_there_are(name: str, known: list[str], advice: str) -> None:
    assert suggestion(name, known) == suggestion(name, reversed(known)) == advice


def test_what_is_said_where_there_is_nothing_is_the_callers() -> None:
    assert suggestion("x", (), "the world is empty") == "the world is empty"


@pytest.mark.parametrize("name", ["CUP", "Cup", "cub", "cup "])
def test_a_name_in_other_letters_is_found(name: str) -> None:
    assert suggestion(name, ["table", "cup"]) == "did you mean 'cup'?"


def test_the_name_is_told_as_it_is_spelled() -> None:
    assert meant("bluesquare", ["Blue-Square"]) == " (did you mean 'Blue-Square'?)"


def test_names_that_differ_in_case_alone_are_all_told() -> None:
    assert suggestion("CUP", ["cup", "Cup", "can"]) == "did you mean 'Cup' or 'cup'?"
    assert meant("CUP", ["cup", "Cup", "can"]) == " (did you mean 'Cup' or 'cup'?)"
