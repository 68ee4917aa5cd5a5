"""Base of the voices that are bodies of one part, with sound or without."""

from engage_hri.schemas.behaviors import BlockBehavior, Speech
from engage_hri.schemas.body import BodyPose
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.references import type_name
from engage_hri.schemas.world import World
from engage_hri.services.control.body import BehaviorRefused, Body, BodyState
from engage_hri.services.control.voice.voice import Voice


class Speaker(Body):
    """A body with the one part `voice`. A subclass says how long a speech takes, and says it."""

    def __init__(self) -> None:
        self._voice = Voice()

    async def home(self, parts: tuple[str, ...] = ()) -> None:
        if not parts or "voice" in parts:
            self._voice.hush()

    def state(self) -> BodyState:
        return BodyState(pose=BodyPose(), moving=self._voice.is_busy, speaking=self._voice.saying)

    def see(self, world: World) -> None:
        """Look at nothing: it only speaks."""


def speech(behavior: BlockBehavior) -> Speech:
    """The behavior, if it is a speech. Raises BehaviorRefused."""
    if not isinstance(behavior, Speech):
        reason = f"this voice has no {type_name(behavior)}"
        raise BehaviorRefused(Fault(reason=reason, where=behavior.id, service="control"))
    return behavior
