"""The policy of continuers: "mm-hmm", with a nod, to who tells the robot something long.

Which: a word that means "go on" and nothing else. When: where the speaker pauses, and the words before the pause do
not say that more of the sentence must follow. A pause alone is a fair sign of the place, what kind of word stands
before it is another, and both together are the best of them (Cathcart, Carletta and Klein 2003, "A shallow model of
backchannel continuers in spoken dialogue"; theirs were three parts of speech, for which the words stand here after
which nobody ends). Where no words are known, or no pause comes, the robot only nods: nods fit more places than voices
do, and too many signs are worse than few (Poppe, Truong and Heylen 2011, "Backchannels: quantity, type and timing
matters"). So at most every second sign is said. After a question there is none: an answer is due.

How loud: as the robot's other words, and higher. People's are no softer than the same words elsewhere, but higher
(Benus, Gravano and Hirschberg 2007, "The prosody of backchannels in American English").

A word of the robot may come back by the speaker's microphone, into the midst of their own: it is taken for the
robot's own (`own_words.py`). Recognition, which has been told of the sign, takes it for no speech.
"""

from itertools import cycle

from engage_hri.schemas.units import Seconds
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.head.nod_policy import AGAIN, PAUSE, NodPolicy
from engage_hri.services.generation.head.policy import RobotSign
from engage_hri.services.generation.head.scene import HeadScene
from engage_hri.services.text.ends import leaves_open

ROOM: Seconds = 0.6
"""Time in the pause within which the word has to begin: later the speaker is about to go on, or is done. Ours."""

NEVER = float("-inf")


class ContinuerPolicy(NodPolicy):
    """Says a listener's word to who speaks to the robot."""

    def __init__(self, scene: HeadScene, config: GenerationConfig) -> None:
        super().__init__(scene, config)
        self._continuers = cycle(config.continuers)
        self._said: dict[str, Seconds] = {}
        """When each was given the last one."""

    def forget(self, person: str) -> None:
        self._said.pop(person, None)

    def sign(self, now: Seconds) -> RobotSign | None:
        for actor in self._since:
            if self._may_sign(actor, now) and self._is_invited(actor, now):
                self._said[actor] = now
                return RobotSign(actor, next(self._continuers, ""))
        return None

    def _is_invited(self, actor: str, now: Seconds) -> bool:
        """True if the person has had a sign in this speech, none of words lately, and pauses where one may end."""
        text, since = self._words.get(actor, ("", now))
        is_second = self.scene.signed.get(actor, NEVER) >= self._since[actor]
        is_second &= now >= self._said.get(actor, NEVER) + 2 * AGAIN
        is_pause = since + PAUSE <= now < since + PAUSE + ROOM
        return is_second and is_pause and not text.endswith("?") and not leaves_open(text)
