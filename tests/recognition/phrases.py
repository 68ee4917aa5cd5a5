"""Phrases that people say while somebody else speaks, and what they mean by them: by ear, not from lists of words.

`phrases.csv`: language, kind, words. Words are as a recognizer writes them; "": it writes none.
"""

import csv
from pathlib import Path
from typing import Literal, NamedTuple

Meaning = Literal["ends", "goes on", "takes the floor"]
MEANINGS: dict[str, Meaning] = {
    "stop": "ends", "content": "takes the floor", "feedback": "goes on", "noise": "goes on", "laughter": "goes on",
}  # fmt: skip


class Phrase(NamedTuple):
    language: str
    kind: str
    words: str

    @property
    def stops(self) -> bool:
        """True if the robot is to be silent: the turn ends, or the person has the floor, which is the same to it."""
        return MEANINGS[self.kind] != "goes on"


PHRASES = [
    Phrase(*row) for row in csv.reader(Path(__file__).with_suffix(".csv").read_text(encoding="utf-8").splitlines())
]
