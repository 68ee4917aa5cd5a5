"""The policy of nods: who speaks to the robot for long sees that it listens.

Thesis 3.3.3 leaves a backchannel to the manager, for it may mean agreement. A continuer means less: go on, I listen.
It says nothing of the content, so it needs no knowledge of it (thesis 6.2 asks for just that: backchannels that a
pause of the speaker invites, off the manager's hands). Listeners give one each 6 s (143 in a quarter of an hour of a
dialogue coded by hand), where the speaker pauses: that is a good single sign of the place (Cathcart, Carletta and
Klein 2003), and soon after the beginning, or after the one before, none is given (Ward and Tsukahara 2000).

So the robot nods to who speaks to it, a little, in a pause between words, when they have spoken for a while, and in
any case a while later. Of a recognizer that tells words only when all is said no pause is known: there it nods when
the time has come: a nod may fall into words, where a word would be heard over them (`continuer_policy.py`). It is
announced to recognition as a backchannel, so that it answers nothing.
"""

from collections.abc import Sequence

from engage_hri.schemas.fragments import Claim
from engage_hri.schemas.perception import Utterance
from engage_hri.schemas.recognition import Floor
from engage_hri.schemas.units import Seconds
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.head.policy import HeadPolicy, RobotSign
from engage_hri.services.generation.head.scene import HeadScene, Observation

LISTENS: Seconds = 2.5
"""Time for which somebody has spoken before the robot nods: most phrases to a robot are shorter, and its answer would
wait for the end of the nod. Decision 0226."""
AGAIN: Seconds = 6.0
"""Least time between two nods. People's mean."""
UNINVITED: Seconds = 1.5
"""Time without a pause after which it nods all the same. Ours."""
PAUSE: Seconds = 0.6
"""Time without a new word that is a pause: words of a recognizer come in lumps of up to half a second. Ours."""


class NodPolicy(HeadPolicy):
    """Nods to who speaks to the robot."""

    def __init__(self, scene: HeadScene, config: GenerationConfig) -> None:
        super().__init__(scene, config)
        self._since: dict[str, Seconds] = {}
        """Since when each speaks to the robot."""
        self._words: dict[str, tuple[str, Seconds]] = {}
        """Last words that each has said so far, and when they came."""
        self._seen: Seconds = float("-inf")

    def feed(self, message: Observation, now: Seconds) -> None:
        match message:
            case Floor():
                speaking = {each.actor for each in message.speeches}
                listens = self.scene.robot not in speaking
                to_robot = [each.actor for each in message.speeches if listens and self.scene.robot in each.to]
                self._since = {actor: self._since.get(actor, now) for actor in to_robot}
                self._words = {actor: words for actor, words in self._words.items() if actor in speaking}
            case Utterance(final=False, actor=actor, text=text) if self._words.get(actor, ("",))[0] != text:
                self._words[actor] = text, now

    def recognition_lost(self) -> None:
        self._since, self._words = {}, {}

    @property
    def deadline(self) -> Seconds | None:
        return min((at for actor in self._since if (at := self._invited(actor)) > self._seen), default=None)

    def _invited(self, actor: str) -> Seconds:
        """Time from which on this person may be given a sign, as far as words have come."""
        due = max(self._since[actor] + LISTENS, self.scene.signed.get(actor, float("-inf")) + AGAIN)
        pause = self._words[actor][1] + PAUSE if actor in self._words else due
        return min(max(due, pause), due + UNINVITED)

    def claim(self, now: Seconds, weaker: Sequence[Claim]) -> None:
        self._seen = now

    def sign(self, now: Seconds) -> RobotSign | None:
        return next((RobotSign(actor) for actor in self._since if self._may_sign(actor, now)), None)

    def _may_sign(self, actor: str, now: Seconds) -> bool:
        return now >= self._invited(actor) and self.scene.head_on == actor
