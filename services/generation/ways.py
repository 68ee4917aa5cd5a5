"""Ways of fragments: long stories of questions and answers, each told from its beginning to its end. Pure.

A fragment's way is long: the body is asked what gestures would cost, the block is planned, sent, accepted, cut short,
planned anew. Told as a coroutine, it would go on whenever the loop came to it, in a world that had changed by then,
and two ways that were due in one instant would go on in an order that nobody could tell afterwards. So each is a
generator: it yields what it waits for, and goes on in the very step that brings this.
"""

from collections.abc import Callable, Generator
from typing import Any

from engage_hri.schemas.messages import Message
from engage_hri.services.generation.exchange import AskBody, NoAnswer, Question

Way = Generator[Question | str | None, Any, None]
"""Way of a fragment: it yields a question to the body, the id of its block that there is to be news of, or None for a
pause until the next step, in which others may go on. An end without an answer is raised in it."""


class Ways:
    """All ways under way. tell: called with what they ask the body."""

    def __init__(self, tell: Callable[[AskBody], None]) -> None:
        self._tell = tell
        self._waiting: dict[str, Way] = {}
        """By the id of the question, or of the block, that there is to be news of."""
        self._paused: list[Way] = []
        self._questions = 0

    @property
    def is_any_paused(self) -> bool:
        return bool(self._paused)

    def begin(self, way: Way) -> None:
        self._go(way, None)

    def answer(self, id: str, answer: Message | NoAnswer | None) -> None:
        """Hand in the answer of this id to the way that waits for it, if one does."""
        if (way := self._waiting.pop(id, None)) is not None:
            self._go(way, answer)

    def go_on(self) -> None:
        """Let those go on that have paused."""
        paused, self._paused = self._paused, []
        for way in paused:
            self._go(way, None)

    def _go(self, way: Way, answer: Message | NoAnswer | None) -> None:
        try:
            awaited = way.throw(answer.error) if isinstance(answer, NoAnswer) else way.send(answer)
        except StopIteration:
            return
        if awaited is None:
            self._paused.append(way)
        elif isinstance(awaited, str):
            self._waiting[awaited] = way
        else:
            self._questions += 1
            id = f"question-{self._questions}"
            self._waiting[id] = way
            self._tell(AskBody(id, awaited))
