"""Inputs of the realizer that come by no message: for its ledger."""

from msgspec import Struct

from engage_hri.schemas.body import EstimateBehaviors, Estimates
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.messages import Message
from engage_hri.services.runtime.intake import fingerprint


class BodyAnswered(Struct, frozen=True, kw_only=True, tag="body_answered", omit_defaults=True):
    """The body answered a question for estimates.

    asked: fingerprint of the behaviors. refused: fault with which it was answered, in place of estimates.
    """

    asked: str
    answer: Estimates | None = None
    refused: Fault | None = None


RealizerInput = Message | BodyAnswered


def behaviors_asked(question: EstimateBehaviors) -> str:
    """Fingerprint of the behaviors that a question is about, whatever the times at which they are to come."""
    return fingerprint([item.behavior for item in question.items])
