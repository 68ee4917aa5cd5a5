"""Values between generation and its shell: what it asks of others and what comes of that, besides messages."""

from typing import Literal

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
