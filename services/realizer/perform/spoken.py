"""What has been said of the speeches of a block, as far as anybody has told: the voice may never get to say."""

from collections.abc import Iterable

from engage_hri.schemas.behaviors import BlockBehavior, Speech
from engage_hri.schemas.blocks import SpokenText
from engage_hri.schemas.body import BehaviorOutcome
from engage_hri.services.realizer.points import Point


class Spoken:
    """behaviors: of the block."""

    def __init__(self, behaviors: Iterable[BlockBehavior]) -> None:
        self._speeches = {each.id: each for each in behaviors if isinstance(each, Speech)}
        self._position: dict[str, int] = {}
        """How far those have come that have begun, in characters."""
        self._texts: dict[str, SpokenText] = {}

    def reach(self, point: Point) -> None:
        """A sync point was passed: all before a mark has been said."""
        if (speech := self._speeches.get(point.behavior)) is not None:
            self.hear(speech.id, next((mark.position for mark in speech.marks if mark.id == point.sync), 0))

    def hear(self, id: str, position: int) -> None:
        """So much has been said. What is no speech of the block says nothing, whatever its body tells."""
        if id in self._speeches:
            self._position[id] = max(position, self._position.get(id, 0))

    def end(self, outcome: BehaviorOutcome) -> None:
        """The voice says itself what it has said."""
        if (speech := self._speeches.get(outcome.behavior)) is not None:
            is_done = outcome.status == "done"
            text = speech.text if is_done else outcome.spoken or speech.text[: self._position.get(speech.id, 0)]
            self._texts[speech.id] = SpokenText(behavior=speech.id, text=text, complete=is_done)

    def of(self, id: str) -> SpokenText | None:
        """Of a speech, if it has begun."""
        if id in self._texts or id not in self._position:
            return self._texts.get(id)
        return SpokenText(behavior=id, text=self._speeches[id].text[: self._position[id]], complete=False)

    @property
    def texts(self) -> tuple[SpokenText, ...]:
        """Of each that has begun, in document order."""
        return tuple(text for id in self._speeches if (text := self.of(id)) is not None)
