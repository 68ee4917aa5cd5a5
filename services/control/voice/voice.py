"""The voice of the simulated body: it says one text at a time."""

from collections.abc import AsyncGenerator
from contextlib import aclosing
from math import inf

from engage_hri.schemas.behaviors import Speech
from engage_hri.schemas.faults import Fault
from engage_hri.services.control.contract.bell import Bell
from engage_hri.services.control.contract.body import BehaviorRefused, MovementAuthority, Progress, Reached
from engage_hri.services.control.voice import speaking


class Voice:
    """A voice that refuses a text while it says another.

    is_mute: it makes no sound, and reports its words all the same; may be changed while it speaks.
    """

    def __init__(self, *, is_mute: bool = False) -> None:
        self.is_mute = is_mute
        self._text = ""
        self._utterance: MovementAuthority | None = None
        self._waiting: list[Bell] = []

    @property
    def saying(self) -> str:
        """The text that is being said; empty: silence."""
        return "" if self.is_mute else self._text

    @property
    def is_busy(self) -> bool:
        return self._utterance is not None

    def hush(self) -> None:
        """End what is being said, at a word."""
        if self._utterance is not None:
            self._utterance.revoke()

    async def wait_for_silence(self, authority: MovementAuthority) -> None:
        """Wait until an aborted speech has finished its current word; return at once if `authority` is revoked."""
        bell = Bell()
        unwatch = authority.watch(bell.ring)
        self._waiting.append(bell)
        try:
            while self._utterance is not None and self._utterance.revoked is not None and authority.revoked is None:
                await bell.wait(inf)
        finally:
            self._waiting.remove(bell)
            unwatch()

    async def speak(
        self, behavior: Speech, authority: MovementAuthority, pace: float
    ) -> AsyncGenerator[Progress, None]:
        """Say a text in silence. pace: 2 takes twice as long. Raises BehaviorRefused: it says another."""
        async with aclosing(self.say(behavior, authority, speaking.speak(behavior, authority, pace))) as utterance:
            async for progress in utterance:
                yield progress

    async def say(
        self, behavior: Speech, authority: MovementAuthority, words: AsyncGenerator[Progress, None]
    ) -> AsyncGenerator[Progress, None]:
        """Say a text. words: what is told of it as it is said. Raises BehaviorRefused: it says another."""
        if self._utterance is not None:
            reason = f"the voice is busy with {self._text!r}"
            raise BehaviorRefused(Fault(reason=reason, where=behavior.id, service="control"))
        self._utterance, self._text = authority, behavior.text
        try:
            async with aclosing(words) as utterance:
                async for progress in utterance:
                    if isinstance(progress, Reached) and progress.sync == "end":
                        self._utterance, self._text = None, ""
                    yield progress
        finally:
            if self._utterance is authority:
                self._utterance, self._text = None, ""
            for bell in self._waiting:
                bell.ring()
