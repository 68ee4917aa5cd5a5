"""The policy of eyes that have met: what the robot has sought it keeps for a moment, whatever moves meanwhile.

The robot looks at somebody at the end of a turn, or to check whether they attend, and they look up: that is the
mutual facial gaze of thesis 2.2.2, and the robot has asked for it. People's last 1.8 s at the median. A hand that
moves at that instant, often one that begins to do what was asked for, would draw the robot's eyes away after a tenth
of a second, as from somebody whom it did not mean. What somebody shows the robot counts more (the response policy
comes first), and so does another one who speaks, maybe to the robot.
"""

from collections.abc import Sequence

from engage_hri.schemas.fragments import Claim
from engage_hri.schemas.recognition import ConnectionEvent
from engage_hri.schemas.units import Seconds
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.head.policy import HeadPolicy
from engage_hri.services.generation.head.scene import HeadScene, Observation

MUTUAL: Seconds = 0.8
"""Time for which the robot keeps eyes that it has met: as long as it keeps those that have sought its own. Ours."""


class MutualGazePolicy(HeadPolicy):
    """The face whose eyes the robot has sought, and met."""

    kind = "response"

    def __init__(self, scene: HeadScene, config: GenerationConfig) -> None:
        super().__init__(scene, config)
        self._person = ""
        self._until: Seconds = float("-inf")

    def feed(self, message: Observation, now: Seconds) -> None:
        match message:
            case ConnectionEvent(kind="mutual_facial_gaze", state="succeeded", initiator=self.scene.robot):
                self._person, self._until = message.responder, now + MUTUAL

    def join(self, other: str, name: str) -> None:
        self._person = name if self._person == other else self._person

    def recognition_lost(self) -> None:
        self._person = ""

    @property
    def deadline(self) -> Seconds | None:
        return self._until if self._person else None

    def claim(self, now: Seconds, weaker: Sequence[Claim]) -> Claim | None:
        is_called_away = self.scene.listens_to not in ("", self._person)
        if now >= self._until or self.scene.head_on != self._person or is_called_away:
            self._person = ""
        return self.wish(self._person, f"has met the eyes of {self._person}") if self._person else None
