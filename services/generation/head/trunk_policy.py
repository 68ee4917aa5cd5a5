"""The policy of the trunk: it turns towards whom the robot speaks with, if they are aside, and stays there.

A head turns for a look, a trunk for a conversation. Whom the lower body faces is whom one is with: those who talk
stand so that the fronts of their bodies meet (Kendon 1990, "Conducting interaction": the F-formation). A head that is
turned away from the trunk says that it will soon be back; people twist so for a side matter, not to stay (Schegloff
1998, "Body torque"). So a robot that speaks with somebody aside by its neck alone looks as if it were about to go.

When: eyes go first, then the head, then the trunk, and below 40 degrees of one gaze shift the trunk hardly moves at
all (McCluskey and Cullen 2007, "Eye, head, and body coordination during large gaze shifts", of rhesus monkeys). Here
the angle is less, since the look lasts, and the trunk is late, since who speaks with several people changes often. It
turns away from nobody: of several who are far apart it faces none.
"""

from collections.abc import Sequence
from math import atan2, radians

from engage_hri.schemas.fragments import Claim
from engage_hri.schemas.units import Radians, Seconds
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.head.policy import HeadPolicy, TrunkTurn
from engage_hri.services.generation.head.scene import HeadScene

ASIDE: Radians = radians(20.0)
"""Angle off the front of the trunk from which on somebody is aside. Half of that at which the trunk goes along with
one look. Ours."""
BESIDE: Radians = radians(50.0)
"""Angle off whom it is to face up to which all others have to be, else the trunk stays ahead: a head that turns some
70 degrees off its trunk has to reach all of them. Ours."""
LASTS: Seconds = 3.0
"""Time for which the robot has spoken with somebody who is aside before its trunk turns. Ours."""
ALONE: Seconds = 8.0
"""Time for which nobody with whom it spoke is in sight before its trunk turns back. Ours."""


class TrunkPolicy(HeadPolicy):
    """Turns the trunk towards whom the robot speaks with, and back when nobody is left."""

    def __init__(self, scene: HeadScene, config: GenerationConfig) -> None:
        super().__init__(scene, config)
        self._person = ""
        """Id of whom it is to face; "": nobody, and so ahead."""
        self._company: Sequence[str] = ()
        """Ids of those who are in sight."""
        self._since: Seconds | None = None
        """Since when they are aside; None: they are not."""
        self._seen: Seconds = float("-inf")

    @property
    def deadline(self) -> Seconds | None:
        return due if (due := self._due) is not None and due > self._seen else None

    @property
    def _due(self) -> Seconds | None:
        return None if self._since is None else self._since + (LASTS if self._company else ALONE)

    def _direction(self, id: str) -> Radians:
        """Direction of somebody, to the left; 0, ahead, of nobody."""
        place = self.scene.world.entity(id) if id and self.scene.world is not None else None
        return 0.0 if place is None else atan2(place.position[1], place.position[0])

    def claim(self, now: Seconds, weaker: Sequence[Claim]) -> None:
        self._seen, self._company = now, self.scene.sight.present(now)
        person = self.scene.listens_to or self.scene.partner
        directions = [abs(self._direction(each) - self._direction(person)) for each in self._company]
        person = person if person in self._company and max(directions) <= BESIDE else ""
        if person != self._person:
            self._person, self._since = person, None
        is_aside = abs(self._direction(person) - self.scene.facing) > (ASIDE if person else 0.0)
        self._since = (now if self._since is None else self._since) if is_aside else None

    def turn(self, now: Seconds) -> TrunkTurn | None:
        due = self._due
        return TrunkTurn(self._person, self._direction(self._person)) if due is not None and now >= due else None

    def join(self, other: str, name: str) -> None:
        self._person = name if self._person == other else self._person
