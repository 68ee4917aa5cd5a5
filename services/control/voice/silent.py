"""The voice `silent`: words take their time, and nobody hears them. For a body without a voice, and for tests."""

from collections.abc import AsyncGenerator
from contextlib import aclosing

from engage_hri.schemas.behaviors import BlockBehavior, Speech
from engage_hri.schemas.body import BodyPose, Capabilities, Estimate
from engage_hri.schemas.world import World
from engage_hri.services.control.contract.body import (
    BehaviorRefused,
    BodyFailed,
    MovementAuthority,
    Progress,
    Reached,
)
from engage_hri.services.control.contract.refusals import unsupported
from engage_hri.services.control.voice.estimate import speech_estimate
from engage_hri.services.control.voice.parts import unspeakable
from engage_hri.services.control.voice.speaker import FAULTS, Speaker, speech, voiceless
from engage_hri.services.control.voice.timeline import uttered


class SilentVoice(Speaker):
    """A voice without sound, as a body with one part."""

    def __init__(self) -> None:
        super().__init__()
        self.capabilities = Capabilities(body="silent", types=("speech",), parts=("voice",), faults=FAULTS)

    def estimate(self, behavior: BlockBehavior, pose: BodyPose | None, world: World) -> Estimate:
        if not isinstance(behavior, Speech):
            return unsupported(behavior)
        if self._is_voiceless:
            return unspeakable(behavior, voiceless(behavior))
        return speech_estimate(behavior, uttered(behavior), pose or BodyPose())

    async def perform(self, behavior: BlockBehavior, authority: MovementAuthority) -> AsyncGenerator[Progress, None]:
        behavior = speech(behavior)
        if self._is_voiceless:
            raise BehaviorRefused(voiceless(behavior))
        await self._voice.wait_for_silence(authority)
        if authority.revoked is not None:
            return
        async with aclosing(self._voice.speak(behavior, authority, 1.0)) as utterance:
            async for progress in utterance:
                yield progress
                if isinstance(progress, Reached) and progress.sync == "end":
                    return
        if self._is_voiceless:
            raise BodyFailed(voiceless(behavior))
