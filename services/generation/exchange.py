"""Questions and orders of generation, news of these, and the ways of fragments that wait for such news. Pure.

A fragment's way is long: the body is asked what gestures would cost, the block is planned, sent, accepted, cut short,
planned anew. Told as a coroutine, it would go on whenever the loop came to it, in a world that had changed by then,
and two ways that were due in one instant would go on in an order that nobody could tell afterwards. So each is a
generator: it yields what it waits for, and goes on in the very step that brings this.
"""

from collections.abc import Callable, Generator
from typing import Any, Literal

from msgspec import Struct

from engage_hri.schemas.body import DescribeBody, EstimateBehaviors
from engage_hri.schemas.faults import EngageError, Fault, OutcomeUnknown, RequestRefused, RunFailed
from engage_hri.schemas.messages import Message
from engage_hri.schemas.requests import Request
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.deadlines import NEVER

NAME = "generation"
Question = DescribeBody | EstimateBehaviors
_ERRORS = {"refused": RequestRefused, "unknown": OutcomeUnknown, "failed": RunFailed}


class SendRequest(Struct, frozen=True):
    """Send this request, or its update. key: the expression of its command."""

    key: str
    request: Request


class CancelRequest(Struct, frozen=True):
    """Cancel a request that was sent."""

    id: str
    why: Fault


class AskBody(Struct, frozen=True):
    """Ask the body; the answer is to come as an `AnswerCame` of this id."""

    id: str
    question: Question


class NoAnswer(Struct, frozen=True, tag="no_answer"):
    """An end without an answer. kind: refused; unknown: nobody knows what became of it; failed: any other."""

    fault: Fault
    kind: Literal["refused", "unknown", "failed"]

    @staticmethod
    def of(error: EngageError) -> "NoAnswer":
        """Make the value that stands for an exception."""
        if isinstance(error, RequestRefused):
            return NoAnswer(error.fault, "refused")
        return NoAnswer(error.fault, "unknown" if isinstance(error, OutcomeUnknown) else "failed")

    @property
    def error(self) -> EngageError:
        return _ERRORS[self.kind](self.fault)


class AnswerCame(Struct, frozen=True, tag="answer_came"):
    """News of a question or of the request for a block: of that first that it is accepted, then its outcome.

    answer: None: it was accepted, and the message that said so was lost.
    """

    id: str
    answer: Message | NoAnswer | None


class GenerationBegan(Struct, frozen=True, tag="generation_began"):
    """The first step of a life. covered_for: see `CoveredObjects`."""

    covered_for: Seconds


class OwnSight(Struct, frozen=True, tag="own_sight"):
    """Knowledge of this process of itself: others are not to blame for what it did not see. As in `Sight`."""

    woke_at: Seconds = NEVER
    asleep_at: Seconds = NEVER
    slept: Seconds = 0.0
    unlinked_at: Seconds = NEVER


Way = Generator[Question | str, Any, None]
"""Way of a fragment: it yields a question to the body, or the id of its block that there is to be news of. An end
without an answer is raised in it."""


class Ways:
    """All ways under way. tell: called with what they ask the body."""

    def __init__(self, tell: Callable[[AskBody], None]) -> None:
        self._tell = tell
        self._waiting: dict[str, Way] = {}
        """By the id of the question, or of the block, that there is to be news of."""
        self._questions = 0

    def begin(self, way: Way) -> None:
        self._go(way, None)

    def answer(self, id: str, answer: Message | NoAnswer | None) -> None:
        """Hand in the answer of this id to the way that waits for it, if one does."""
        if (way := self._waiting.pop(id, None)) is not None:
            self._go(way, answer)

    def _go(self, way: Way, answer: Message | NoAnswer | None) -> None:
        try:
            awaited = way.throw(answer.error) if isinstance(answer, NoAnswer) else way.send(answer)
        except StopIteration:
            return
        if isinstance(awaited, str):
            self._waiting[awaited] = way
        else:
            self._questions += 1
            id = f"question-{self._questions}"
            self._waiting[id] = way
            self._tell(AskBody(id, awaited))
