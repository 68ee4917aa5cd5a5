"""The voice `silent`: words take their time, and nobody hears them. For a body without a voice, and for tests."""

from collections.abc import AsyncGenerator

from engage_hri.schemas.behaviors import Speech
from engage_hri.services.control.contract.body import MovementAuthority, Progress
from engage_hri.services.control.voice.speaker import Speaker
from engage_hri.services.control.voice.speaking import speak
from engage_hri.services.control.voice.timeline import Utterance, uttered


class SilentVoice(Speaker):
    """A voice without sound, as a body with one part."""

    def __init__(self) -> None:
        super().__init__("silent")

    def timed(self, behavior: Speech) -> Utterance:
        return uttered(behavior)

    async def said(self, behavior: Speech, authority: MovementAuthority) -> AsyncGenerator[Progress, None]:
        return speak(behavior, authority)
