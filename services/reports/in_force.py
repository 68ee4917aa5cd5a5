"""The condition of a study that is in force, as its messages and the presence of generation tell it. Pure.

A condition is in force as long as the life of generation that was told of it: a restarted generation has none.
"""

from typing import Self

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.conditions import StudyCondition
from engage_hri.schemas.messages import Message
from engage_hri.schemas.presence import PeerAlive, PeerGone


class InForce(Struct, frozen=True, kw_only=True):
    """Condition in force. told: the condition; None: generation is not there, or has not told of one.

    lost: the one that somebody had set, and that went with its generation; None once somebody has set another.
    life: of the generation that was there last; empty: unknown.
    """

    told: StudyCondition | None = None
    lost: StudyCondition | None = None
    life: str = ""

    @property
    def missed(self) -> StudyCondition | None:
        """The lost condition, if something counted under it, or the robot did less for it."""
        return self.lost if self.lost is not None and (self.lost.name or self.lost.speech_only) else None

    def after(self, message: Message) -> Self:
        """Take a message; most change nothing."""
        match message:
            case StudyCondition(by=by):
                return replace(self, told=message, lost=None if by else self._left)
            case PeerGone(participant="generation"):
                return replace(self, told=None, lost=self._left)
            case PeerAlive(participant="generation", run=run):
                is_back = self.told is None and bool(run) and run == self.life
                known = replace(self, told=self.lost, lost=None) if is_back else self
                return replace(known, life=run)
        return self

    @property
    def _left(self) -> StudyCondition | None:
        """Condition that is lost if this generation has gone."""
        return self.told if self.told is not None and self.told.by else self.lost
