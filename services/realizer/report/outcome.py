"""The outcome of a block that was performed: what was said, what was dropped, whether anything was done at all.

The voice may never get to report its end. So what it has said is kept with each word that it tells (`Spoken`).
"""

from collections.abc import Collection, Container, Iterable, Mapping

from msgspec.structs import replace

from engage_hri.schemas.behaviors import BlockBehavior, Speech
from engage_hri.schemas.blocks import Block, BlockOutcome, SpokenText
from engage_hri.schemas.body import BehaviorOutcome
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.text import has_words
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.plan.relations import DROPPED
from engage_hri.services.realizer.points import Point, as_told


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


_BEHAVIORS = ("BEHAVIOR_TYPE_NOT_SUPPORTED", "CUSTOM_BEHAVIOR_NOT_SUPPORTED")
"""Kinds of the notes about behaviors without an id, which no list of a block's behaviors has."""


def completed(
    ended: BlockOutcome,
    block: Block,
    spoken: tuple[SpokenText, ...],
    lost: Mapping[str, str],
    interrupted: Collection[str],
    loss: Fault,
) -> BlockOutcome:
    """Complete the outcome of a block. One that had behaviors, each of which was dropped, has failed.

    ended: how it ended. lost: behaviors that did not come to their end, each with the reason. interrupted: those of
    them that were ended on request, which is no failure. loss: the fault of one that was lost.
    """
    dropped = {id: why for id, why in lost.items() if id not in interrupted}
    nothing = _nothing_performed(block, dropped, ended.block, loss) if ended.status == "done" else None
    return replace(
        ended,
        status="failed" if nothing else ended.status,
        fault=nothing or ended.fault,
        spoken=spoken,
        dropped=tuple(dropped),
        reasons=tuple(map(as_told, dropped.values())),
        interrupted=tuple([id for id in lost if id in interrupted]),
    )


def nothing_is_left(block: Block, dropped: Container[str]) -> bool:
    """True if the block had behaviors, and each of them was dropped."""
    had_any = bool(block.behaviors) or any(each.kind in _BEHAVIORS for each in block.unread)
    return had_any and all(behavior.id in dropped for behavior in block.behaviors)


def _nothing_performed(block: Block, dropped: Mapping[str, str], id: str, loss: Fault) -> Fault | None:
    """Fault of a block of whose behaviors each was dropped; None if it had none, or another is left. id: of it."""
    if not nothing_is_left(block, dropped):
        return None
    left_out = [each.message for each in block.unread if each.kind in _BEHAVIORS]
    whys = [*(f"{id}: {why.removeprefix(f'{id}: ')}" if why else id for id, why in dropped.items()), *left_out]
    reason = as_told(f"no behavior of it came to its end ({'; '.join(whys)})")
    return replace(loss, reason=reason, where=id, line=0, advice="")


def reasons(plan: Plan) -> dict[str, str]:
    """Behaviors that a plan has dropped, each with the reason."""
    why = {each.behavior: each.message.partition(DROPPED)[0] for each in reversed(plan.problems)}
    return {id: why.get(id, "") for id in plan.dropped}
