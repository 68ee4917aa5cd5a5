"""The voice `silent`: words take their time, and nobody hears them. For a body without a voice, and for tests."""

from collections.abc import AsyncGenerator, Sequence
from contextlib import aclosing

from engage_hri.schemas.behaviors import BlockBehavior, Speech
from engage_hri.schemas.body import BodyPose, Capabilities, Estimate
from engage_hri.schemas.body_faults import BodyFault
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.world import World
from engage_hri.services.control.body import (
    BehaviorRefused,
    BodyFailed,
    MovementAuthority,
    Progress,
    Reached,
)
from engage_hri.services.control.refusals import unsupported
from engage_hri.services.control.voice.estimate import speech_estimate
from engage_hri.services.control.voice.parts import unspeakable
from engage_hri.services.control.voice.speaker import Speaker, speech
from engage_hri.services.control.voice.timeline import utter

FAULTS = ("mute", "voiceless")
"""Kinds of faults that it can play."""


class SilentVoice(Speaker):
    """A voice without sound, as a body with one part."""

    def __init__(self) -> None:
        super().__init__()
        self.capabilities = Capabilities(body="silent", types=("speech",), parts=("voice",), faults=FAULTS)
        self._faults: tuple[BodyFault, ...] = ()

    def estimate(self, behavior: BlockBehavior, pose: BodyPose | None, world: World) -> Estimate:
        if not isinstance(behavior, Speech):
            return unsupported(behavior)
        if self._is_voiceless:
            return unspeakable(behavior, _fault(behavior, "the voice cannot speak"))
        return speech_estimate(behavior, utter(behavior.text), pose or BodyPose())

    async def perform(self, behavior: BlockBehavior, authority: MovementAuthority) -> AsyncGenerator[Progress, None]:
        behavior = speech(behavior)
        if self._is_voiceless:
            raise BehaviorRefused(_fault(behavior, "the voice cannot speak"))
        await self._voice.wait_for_silence(authority)
        if authority.revoked is not None:
            return
        async with aclosing(self._voice.speak(behavior, authority, 1.0)) as utterance:
            async for progress in utterance:
                yield progress
                if isinstance(progress, Reached) and progress.sync == "end":
                    return
        if self._is_voiceless:
            raise BodyFailed(_fault(behavior, "the voice cannot speak"))

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


def _fault(behavior: BlockBehavior, reason: str) -> Fault:
    return Fault(reason=reason, where=behavior.id, service="control")
