"""Record of what has been said of the speeches of a block: the voice may never get to report its end."""

from collections.abc import Iterable

from engage_hri.schemas.behaviors import BlockBehavior, Speech
from engage_hri.schemas.blocks import SpokenText
from engage_hri.schemas.body import BehaviorOutcome
from engage_hri.schemas.speakable import has_words
from engage_hri.services.realizer.points import Point


class Spoken:
    """Words that have been said so far. behaviors: all of the block."""

    def __init__(self, behaviors: Iterable[BlockBehavior]) -> None:
        self._speeches = {each.id: each for each in behaviors if isinstance(each, Speech)}
        self._position: dict[str, int] = {}
        """Characters said of each speech that has begun."""
        self._texts: dict[str, SpokenText] = {}

    def reach(self, point: Point) -> None:
        """Take a sync point that was passed: all before a mark has been said."""
        if (speech := self._speeches.get(point.behavior)) is not None:
            self.hear(speech.id, next((mark.position for mark in speech.marks if mark.id == point.sync), 0))

    def hear(self, id: str, position: int) -> None:
        """Take a position in a speech: all before it has been said. Reports on other behaviors are ignored."""
        if id in self._speeches:
            self._position[id] = max(position, self._position.get(id, 0))

    def end(self, outcome: BehaviorOutcome) -> None:
        """Take the outcome of a speech: the voice itself tells what it has said."""
        if (speech := self._speeches.get(outcome.behavior)) is not None:
            is_done = outcome.status == "done"
            text = speech.text if is_done else outcome.spoken or speech.text[: self._position.get(speech.id, 0)]
            self._texts[speech.id] = _told(speech, text)

    def of(self, id: str) -> SpokenText | None:
        """Words of a speech that have been said; None if it has not begun."""
        if id in self._texts or id not in self._position:
            return self._texts.get(id)
        return _told(self._speeches[id], self._speeches[id].text[: self._position[id]])

    @property
    def texts(self) -> tuple[SpokenText, ...]:
        """Words that have been said of each speech that has begun, in document order."""
        return tuple(text for id in self._speeches if (text := self.of(id)) is not None)


def _told(speech: Speech, text: str) -> SpokenText:
    return SpokenText(behavior=speech.id, text=text, complete=not has_words(speech.text.removeprefix(text)))
