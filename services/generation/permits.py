"""Permissions of the moment: the behaviors that inhibitions and the study's condition leave to fragments."""

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.behaviors import (
    Behavior,
    Emit,
    Event,
    Gaze,
    GazeShift,
    Hand,
    HeadDirectionShift,
    Pointing,
    Reference,
    Speech,
    TurnSignal,
    Wait,
)

HANDS: tuple[Hand, ...] = ("LEFT_HAND", "RIGHT_HAND")


class Permits(Struct, frozen=True, kw_only=True):
    """The behaviors that fragments may have now. hands: those to point with. speech_only: words, and nothing else."""

    gaze: bool = True
    hands: tuple[Hand, ...] = HANDS
    speech_only: bool = False

    def allows(self, behavior: Behavior) -> bool:
        if isinstance(behavior, Gaze | GazeShift | HeadDirectionShift):
            return self.looks
        if isinstance(behavior, Pointing):
            wanted = HANDS if behavior.mode == "BOTH_HANDS" else (behavior.mode,) if behavior.mode else ()
            return bool(self.hands) and set(wanted) <= set(self.hands) and not self.speech_only
        return not self.speech_only or isinstance(behavior, Speech | Reference | Event | TurnSignal | Emit | Wait)

    def stops(self, running: Behavior) -> bool:
        """True if a behavior under way must be aborted. A point without `mode` may be made by either arm."""
        if isinstance(running, Pointing):
            return not self.allows(running if running.mode else replace(running, mode="BOTH_HANDS"))
        return isinstance(running, Gaze | GazeShift | HeadDirectionShift) and not self.looks

    @property
    def looks(self) -> bool:
        return self.gaze and not self.speech_only

    @property
    def only_hand(self) -> Hand | None:
        """The hand to name in a block when only one is left; None: the body may choose, or there is none."""
        return self.hands[0] if len(self.hands) == 1 else None

    @property
    def no_gaze(self) -> str:
        """Reason why references are made without gaze; empty when gaze is permitted."""
        return "speech only" if self.speech_only else "" if self.gaze else "gaze is inhibited"

    @property
    def no_point(self) -> str:
        """Reason why references are made without pointing; empty when a hand is permitted."""
        return "speech only" if self.speech_only else "" if self.hands else "pointing is inhibited"
