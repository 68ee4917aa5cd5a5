"""Conditions of a study, set while the robot runs: one person may meet several. Thesis, chapter 5."""

from typing import Annotated

from msgspec import Meta, Struct

from engage_hri.schemas.requests import Outcome, Request
from engage_hri.schemas.units import Stamp

LONGEST_NAME = 80
"""Characters of a condition's name, and of the name of who set it."""
Named = Annotated[str, Meta(max_length=LONGEST_NAME)]


class SetCondition(Request, frozen=True, kw_only=True, tag="set_condition", omit_defaults=True):
    """cmd: operator or wizard -> generation: this condition begins now. Ends in `ConditionSet`.

    name: any name, by which `engage analyse` tells the conditions apart; empty: what comes belongs to none.
    speech_only: the robot says the words of the task and does nothing else, its head to the upper right, as in the
        condition `degraded-generation`. What is under way of looks and points is broken off, as by an inhibition.
    by: who sets it, for the record; empty: the requester.
    """

    name: Named = ""
    speech_only: bool = False
    by: Named = ""


class ConditionSet(Outcome, frozen=True, kw_only=True, tag="condition_set", omit_defaults=True):
    """evt: terminal state of `SetCondition`: this is in force."""

    name: str = ""
    speech_only: bool = False


class StudyCondition(Struct, frozen=True, kw_only=True, tag="study_condition", omit_defaults=True):
    """state: generation. The condition in force.

    Published at the start, with what the configuration says of `speech_only`, and whenever one is set; a late
    subscriber gets the last one.

    at: when it began. name: empty: none has been set. by: who set it; empty: the configuration.
    """

    at: Stamp
    name: str = ""
    speech_only: bool = False
    by: str = ""

    @property
    def is_told(self) -> bool:
        """True if people are to hear of it: somebody set it, or the configuration leaves the robot words alone."""
        return bool(self.by) or self.speech_only

    @property
    def sentence(self) -> str:
        """Words for people: which it is, and who set it."""
        by = f", set by {self.by}" if self.by else ""
        return f"condition of the study: {words(self.name, self.speech_only)}{by}"

    @property
    def lost_sentence(self) -> str:
        """Words for people when it went with its generation, and is in force no more."""
        was = f"{words(self.name, self.speech_only)!r}, set by {self.by}"
        return f"condition of the study: none, for generation has gone, and with it {was}: begin it again"


def words(name: str, speech_only: bool) -> str:
    """A condition in words, for people."""
    return f"{name or 'none'}{', speech only' if speech_only else ''}"
