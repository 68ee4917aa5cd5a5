"""Base of the voices that are bodies of one part, with sound or without."""

from collections.abc import Sequence

from engage_hri.schemas.behaviors import BlockBehavior, Speech
from engage_hri.schemas.body import BodyPose
from engage_hri.schemas.body_faults import BodyFault
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.references import type_name
from engage_hri.schemas.world import World
from engage_hri.services.control.contract.body import BehaviorRefused, Body, BodyState
from engage_hri.services.control.voice.voice import Voice

FAULTS = ("mute", "voiceless")
"""Kinds of faults that it can play."""


class Speaker(Body):
    """A body with the one part `voice`. A subclass says how long a speech takes, and says it."""

    def __init__(self) -> None:
        self._voice = Voice()
        self._faults: tuple[BodyFault, ...] = ()

    @property
    def faults(self) -> tuple[BodyFault, ...]:
        return self._faults

    def switch_faults(self, faults: Sequence[BodyFault]) -> None:
        for fault in faults:
            if fault.kind not in FAULTS:
                reason = f"this voice cannot play {fault.kind!r}; it can play {', '.join(FAULTS)}"
                raise InputRefused(Fault(reason=reason, where=fault.kind, service="control"))
        self._faults = tuple(faults)
        self._voice.is_mute = any(fault.kind == "mute" for fault in faults)
        if self._is_voiceless:
            self._voice.hush()

    @property
    def _is_voiceless(self) -> bool:
        return any(fault.kind == "voiceless" for fault in self._faults)

    async def home(self, parts: tuple[str, ...] = ()) -> None:
        if not parts or "voice" in parts:
            self._voice.hush()

    def state(self) -> BodyState:
        return BodyState(pose=BodyPose(), moving=self._voice.is_busy, speaking=self._voice.saying)

    def see(self, world: World) -> None:
        """Look at nothing: it only speaks."""


def voiceless(behavior: BlockBehavior) -> Fault:
    """Say why a voice that knows that it is mute does not speak."""
    return Fault(reason="the voice cannot speak", where=behavior.id, service="control")


def speech(behavior: BlockBehavior) -> Speech:
    """The behavior, if it is a speech. Raises BehaviorRefused."""
    if not isinstance(behavior, Speech):
        reason = f"this voice has no {type_name(behavior)}"
        raise BehaviorRefused(Fault(reason=reason, where=behavior.id, service="control"))
    return behavior
