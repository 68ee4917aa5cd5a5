"""The policy of looks away: when the robot's eyes leave a face for a moment, and when they do not.

A face is not stared at, neither in long listening nor where a long utterance begins.

Who listens looks at the speaker nearly always (91 to 96 % of the time in a dialogue coded by hand) and yet not
without a break: 5 to 9 times a minute the eyes leave the face, for 0.74 to 1.0 s at the median, nine of ten times for
less than 2 to 3 s. Who begins a long utterance looks away, in 68 to 80 % of them, and up before its end (Kendon
1967): planning takes the eyes off the face, and says that the turn will be long. A robot that never does so stares.

The eyes leave only a face, and only where all weaker policies would stay on one: nothing is shown to the robot then,
and no hand moves. So looks away cost no answer to what somebody directs to. While the robot waits for an answer, and
while somebody has just met its eyes, it does not look away, and it looks back when somebody begins to speak. The look
away while a turn pauses for thought is a fragment's (`orders.py`).
"""

from collections.abc import Sequence
from itertools import cycle

from engage_hri.schemas.fragments import Claim
from engage_hri.schemas.recognition import Floor
from engage_hri.schemas.units import Seconds
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.head.policy import HeadPolicy
from engage_hri.services.generation.head.scene import HeadScene, Observation

LENGTHS: tuple[Seconds, ...] = (0.6, 1.2, 0.7, 0.9, 1.6)
"""Lengths of the looks away, one after the other, in which people's median and upper fifth are kept."""
PAUSES: tuple[Seconds, ...] = (5.5, 4.0, 7.0, 4.5, 6.0, 5.0)
"""Times on faces between them, in another rhythm than the lengths: at most 9 looks away a minute, where
nothing else happens, and fewer in talk."""
ATTENDED: Seconds = 1.5
"""Time for which a face is looked at before, and any speech has gone on: who begins has the robot's eyes. Ours."""
PLANNING: Seconds = 1.0
"""Length of the look away at the beginning of a long utterance."""
LONG_UTTERANCE = 10
"""Number of words from which on an utterance is a long one: some 4 s. Ours."""


class AversionPolicy(HeadPolicy):
    """Looks away from a face."""

    def __init__(self, scene: HeadScene, config: GenerationConfig) -> None:
        super().__init__(scene, config)
        self._lengths, self._pauses = cycle(LENGTHS), cycle(PAUSES)
        self._due: Seconds | None = None
        """Time of the next look away; None: the head is on no face."""
        self._until: Seconds | None = None
        self._speaking: set[str] = set()
        self._face = ""
        self._attends_until: Seconds = 0.0
        """Time until which the eyes do not leave this face."""
        self._plans = False
        """A long utterance of the robot has just begun."""

    def feed(self, message: Observation, now: Seconds) -> None:
        if isinstance(message, Floor):
            speaking = {each.actor for each in message.speeches}
            begin = speaking - self._speaking
            self._plans = self.scene.robot in begin and self.scene.words >= LONG_UTTERANCE
            if begin - {self.scene.robot}:
                self._attends_until = now + ATTENDED
                self._until = self._until and now
            self._speaking = speaking

    def recognition_lost(self) -> None:
        self._speaking, self._plans = set(), False

    @property
    def deadline(self) -> Seconds | None:
        return self._until if self._until is not None else self._next

    @property
    def _next(self) -> Seconds | None:
        return max(self._due, self._attends_until) if self._due is not None else None

    def claim(self, now: Seconds, weaker: Sequence[Claim]) -> Claim | None:
        face = weaker[0].target if weaker else ""
        place = self.scene.landmark
        awaits = self.scene.waits and self.scene.asked
        may = place and self.scene.sight.is_face(face) and not awaits
        if self._until is not None and (not may or now >= self._until):
            self._until, self._due = None, None
        elif self._until is None and may and self.scene.head_on == face:
            if self._plans:
                self._until = now + PLANNING
            elif self._next is not None and now >= self._next:
                self._until = now + next(self._lengths)
        self._plans = False
        return self.wish(place, f"looks away from {face}") if self._until is not None else None

    def has_head(self, has: bool, now: Seconds) -> None:
        on = self.scene.head_on
        if on != self._face:
            self._face, self._attends_until = on, max(self._attends_until, now + ATTENDED)
        if not self.scene.sight.is_face(on):
            self._due = None
        elif self._due is None:
            self._due = now + next(self._pauses)
