"""The listening policy: while the robot is silent and people speak, it looks at the speaker, as a listener does.

It looks at who spoke first of those who speak. While it waits for an answer only those whom it asked draw it, and
when one of them speaks, only that one; while somebody speaks to it nobody else does.
"""

from collections.abc import Sequence

from engage_hri.schemas.fragments import Claim
from engage_hri.schemas.recognition import Floor
from engage_hri.schemas.units import Seconds
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.head.policy import HeadPolicy
from engage_hri.services.generation.head.scene import HeadScene, Observation

ONSET: Seconds = 0.2
"""Time for which somebody has to speak until the robot looks there: people react after 0.2 to 0.4 s, and a speech to
the robot is short. What is said into the speech of another, as most of "uh-huh" is, draws nobody's look anyway."""
STAYS: Seconds = 1.0
"""Time after a speech for which the robot still looks at the speaker: most who pause go on. Ours."""


class ListeningPolicy(HeadPolicy):
    """People who speak."""

    kind = "response"

    def __init__(self, scene: HeadScene, config: GenerationConfig) -> None:
        super().__init__(scene, config)
        self._speaking: dict[str, Seconds] = {}
        """Since when each speaks, as it was heard here; the first first."""
        self._to_others: set[str] = set()
        """Those who speak to others, as far as that is known."""
        self._speaker = ""
        self._until: Seconds | None = None
        """Time at which the robot looks at the speaker no longer; None: not before the end of the speech."""
        self._seen: Seconds = float("-inf")

    def feed(self, message: Observation, now: Seconds) -> None:
        if isinstance(message, Floor):
            known, self._speaking = self._speaking, {each.actor: now for each in message.speeches}
            self._speaking |= {who: since for who, since in known.items() if who in self._speaking}
            self._to_others = {each.actor for each in message.speeches if each.to and self.scene.robot not in each.to}
            asked = self.scene.asked if self.scene.waits else ()
            self.scene.to_robot = tuple(
                each.actor
                for each in message.speeches
                if self.scene.robot in each.to or (each.actor in asked and not each.to)
            )

    def recognition_lost(self) -> None:
        self._speaking, self._speaker, self._until = {}, "", None

    @property
    def deadline(self) -> Seconds | None:
        """Time of the next change of the claim without a message."""
        due = [since + ONSET for since in self._speaking.values()]
        due += [self._until] if self._until is not None else []
        return min((each for each in due if each > self._seen), default=None)

    def claim(self, now: Seconds, weaker: Sequence[Claim]) -> Claim | None:
        self._seen = now
        speaker = self._attended(now)
        self.scene.listens_to = speaker if speaker in self._speaking.keys() - self._to_others else ""
        return self.wish(speaker, f"speech of {speaker}") if speaker else None

    def _attended(self, now: Seconds) -> str:
        """Id of the person who speaks, or has until just now; "": nobody does."""
        if self.scene.robot in self._speaking:
            self._speaker, self._until = "", None
            return ""
        draws = self.scene.drawing(now)
        heard = [who for who, since in self._speaking.items() if who in draws and now >= since + ONSET]
        if heard:
            self._speaker, self._until = heard[0], None
        elif self._speaker not in draws:
            self._speaker = ""
        elif self._speaker not in self._speaking and self._until is None:
            self._until = now + STAYS
        if not self._speaker or (self._until is not None and now >= self._until):
            self._speaker, self._until = "", None
        return self._speaker
