"""Inhibition of gaze and of pointing, and what it leaves to fragments.

Inhibitions are leases, which end when their request does (`schemas/requests.py`). Permits are what these, and the
study's condition, allow at the moment.
"""

from math import inf
from typing import Literal

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.behaviors import (
    Behavior,
    Emit,
    Event,
    Hand,
    Looks,
    Pointing,
    Reference,
    Speech,
    TurnSignal,
    Wait,
)
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.fragments import Inhibit
from engage_hri.schemas.units import Seconds
from engage_hri.services.generation.config import GenerationConfig

HANDS: tuple[Hand, ...] = ("LEFT_HAND", "RIGHT_HAND")


class Permits(Struct, frozen=True, kw_only=True):
    """The behaviors that fragments may have now. hands: those to point with. speech_only: words, and nothing else."""

    gaze: bool = True
    hands: tuple[Hand, ...] = HANDS
    speech_only: bool = False

    def allows(self, behavior: Behavior) -> bool:
        if isinstance(behavior, Looks):
            return self.looks
        if isinstance(behavior, Pointing):
            wanted = HANDS if behavior.mode == "BOTH_HANDS" else (behavior.mode,) if behavior.mode else ()
            return bool(self.hands) and set(wanted) <= set(self.hands) and not self.speech_only
        return not self.speech_only or isinstance(behavior, Speech | Reference | Event | TurnSignal | Emit | Wait)

    def stops(self, running: Behavior) -> bool:
        """True if a behavior under way must be aborted. A point without `mode` may be made by either arm."""
        if isinstance(running, Pointing):
            return not self.allows(running if running.mode else replace(running, mode="BOTH_HANDS"))
        return isinstance(running, Looks) and not self.looks

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


_HAND_OF: dict[str, Hand] = {"point-left": "LEFT_HAND", "point-right": "RIGHT_HAND"}


SHORTEST: Seconds = 0.1
"""Least `ttl` of a lease: it is renewed three times as often."""


class Inhibition(Struct, frozen=True):
    """A claim on the head. mode `hold`: stay on the present target; `stare`: past everything, to the upper right."""

    target: str
    reason: str
    mode: Literal["release", "hold", "target", "stare"]


SPEECH_ONLY = Inhibition("", "speech only: head up right", "stare")
"""Inhibition in degraded generation: the study had the head there, so that nobody takes it for a look. Thesis 5.3."""


class Leases:
    """The leases in force, newest last."""

    def __init__(self, config: GenerationConfig) -> None:
        self.speech_only = config.speech_only
        """True if the study's condition leaves the robot words alone, and its head to the upper right."""
        self._leases: dict[str, Inhibit] = {}

    def take(self, request: Inhibit) -> None:
        """Take a new lease, or replace the one of the same id. Raises InputRefused."""
        if not SHORTEST <= request.ttl < inf:
            reason = f"ttl {request.ttl} is not a number of seconds, {SHORTEST} or more"
            raise InputRefused(Fault(reason=reason, where=f"{request.id}: ttl"))
        if request.mode == "target" and not request.target:
            raise InputRefused(Fault(reason="mode 'target' without a target", where=f"{request.id}: target"))
        self._leases[request.id] = request

    def release(self, id: str) -> bool:
        """End a lease early. False if there is none of this id."""
        return self._leases.pop(id, None) is not None

    @property
    def inhibition(self) -> Inhibition | None:
        """The inhibition by the newest lease on gaze; None: there is none. The study's condition goes before."""
        if self.speech_only:
            return SPEECH_ONLY
        for request in reversed(self._leases.values()):
            if request.part == "gaze":
                target = request.target if request.mode == "target" else ""
                reason = f"{request.requester}: {request.mode}"
                return Inhibition(target, reason, request.mode)
        return None

    @property
    def holds_head(self) -> bool:
        """True if the head is to stay on its target: an aborted gaze must not even start to go back."""
        return self.inhibition is not None and self.inhibition.mode == "hold"

    def permits(self) -> Permits:
        """The permits of fragments under the leases in force."""
        inhibited = {request.part for request in self._leases.values()}
        return Permits(
            gaze="gaze" not in inhibited,
            hands=tuple(hand for hand in HANDS if hand not in {_HAND_OF.get(part) for part in inhibited}),
            speech_only=self.speech_only,
        )
