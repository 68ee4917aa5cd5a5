"""The listening policy: while the robot is silent and people speak, it looks at the speaker, as a listener does.

Of those who speak it looks at who is not known to speak to somebody else, and looks at the robot: in groups of four,
whom a speaker looks at is in 77 of 100 looks the addressee (Vertegaal and others, CHI 2001), and to whom a short
speech is recognition knows only when it is over. Of several of these it stays with the one who has its eyes, else it
looks at who spoke first. While it waits for an answer only those whom it asked draw it, and when one of them speaks,
only that one; while somebody speaks to it nobody else does.
"""

from collections.abc import Sequence

from engage_hri.schemas.fragments import Claim
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorLost
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
        self._looking: set[str] = set()
        """Those who look at the robot."""
        self._to_others: set[str] = set()
        """Those who speak to others, as far as that is known."""
        self._speaker = ""
        self._until: Seconds | None = None
        """Time at which the robot looks at the speaker no longer; None: not before the end of the speech."""
        self._seen: Seconds = float("-inf")

    def feed(self, message: Observation, now: Seconds) -> None:
        if isinstance(message, ActionBegan | ActionEnded) and message.action == "look":
            self._looking.discard(message.actor)
            if isinstance(message, ActionBegan) and self.scene.robot in message.targets:
                self._looking.add(message.actor)
        elif isinstance(message, ActorLost):
            self._looking.discard(message.actor)
        elif isinstance(message, Floor):
            known, self._speaking = self._speaking, {each.actor: now for each in message.speeches}
            self._speaking |= {who: since for who, since in known.items() if who in self._speaking}
            self._to_others = {each.actor for each in message.speeches if each.to and self.scene.robot not in each.to}
            asked = self.scene.asked if self.scene.waits else ()
            self.scene.to_robot = tuple(
                each.actor
                for each in message.speeches
                if self.scene.robot in each.to or (each.actor in asked and not each.to)
            )

    def join(self, other: str, name: str) -> None:
        if other in self._looking:
            self._looking = self._looking - {other} | {name}

    def forget(self, person: str) -> None:
        self._looking.discard(person)

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
            # The first of the best, for `heard` is in the order in which they began, unless another has the eyes.
            likely = min(
                heard, key=lambda who: (who in self._to_others, who not in self._looking, who != self._speaker)
            )
            self._speaker, self._until = likely, None
        elif self._speaker not in draws:
            self._speaker = ""
        elif self._speaker not in self._speaking and self._until is None:
            self._until = now + STAYS
        if not self._speaker or (self._until is not None and now >= self._until):
            self._speaker, self._until = "", None
        return self._speaker
