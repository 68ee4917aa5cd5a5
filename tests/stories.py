"""Tests written as text, one claim a story: its steps in time, and what becomes of them.

    a nod into silence is nothing
        with gaze_resolution=table
        1 human +nod; 1.5 human -nod
        nothing

The first line is the claim, by which the story is called: `pytest -k a_nod_into_silence_is_nothing`. A line that
begins with a time holds steps; `with` configures; all other lines say what becomes of it. `ACTION in nod shake` makes
one story of each word, in the place of ACTION. Which steps there are: `recognition/event_stories.py` and
`generation/head_stories.py`.
"""

from collections.abc import Iterator
from itertools import groupby
from typing import NamedTuple

import pytest


class Story(NamedTuple):
    claim: str
    config: dict[str, str]
    steps: list[str]
    becomes: list[str]


def each(text: str) -> pytest.MarkDecorator:
    """Parametrizes a test with every story of the text."""
    told = list(stories(text))
    return pytest.mark.parametrize("story", told, ids=[story.claim.replace(" ", "_") for story in told])


def stories(text: str) -> Iterator[Story]:
    """Raises ValueError for a story that could not fail."""
    for filled, lines in groupby(text.splitlines(), key=lambda line: bool(line.strip())):
        if filled:
            claim, *body = (line.strip() for line in lines)
            yield from _variants(claim, body)


def _variants(claim: str, body: list[str]) -> Iterator[Story]:
    for line in body:
        word, is_in, *values = [*line.split(), ""]
        if word.isupper() and is_in == "in":
            rest = [other for other in body if other != line]
            for value in filter(None, values):
                yield from _variants(f"{claim}: {value}", [other.replace(word, value) for other in rest])
            return
    configured = [line for line in body if line.startswith("with ")]
    config = dict(word.split("=") for line in configured for word in line.split()[1:])
    steps = [step.strip() for line in body if line[0].isdigit() for step in line.split(";")]
    becomes = [line for line in body if not line[0].isdigit() and line not in configured]
    if not steps or not becomes:
        raise ValueError(f"{claim}: a story needs steps, and what becomes of them")
    yield Story(claim, config, steps, becomes)


def number(value: float | None) -> str:
    return "none" if value is None else f"{round(value, 6):g}"
