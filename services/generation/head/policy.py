"""A policy of the head: a reason to look somewhere. Pure.

Each policy is told all that happens, and claims the head for a target as long as its reason holds. It knows nothing
of the other policies: the arbiter asks all of them and gives the head to one. So a new reason is a new class, and a
line in the order of `policies.py`; a package of others adds its own by an entry point:

    [project.entry-points."engage.head_policies"]
    startled = "my_package.startled:Startled"

The order decides who is stronger. A policy of others names the one before which it comes, and the priorities are
counted from the order. Thesis 3.3.4 has six of them.
"""

from collections.abc import Sequence
from typing import ClassVar, NamedTuple

from engage_hri.schemas.fragments import Claim
from engage_hri.schemas.units import Radians, Seconds
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.head.scene import HeadScene, Observation


class RobotSign(NamedTuple):
    """A sign of a listener: a nod, on top of the gaze. person: id of whom it is for. words: said with it, if any."""

    person: str
    words: str = ""


class TrunkTurn(NamedTuple):
    """A turn of the trunk. person: id of whom it is towards; "": back ahead. direction: radians to the left."""

    person: str
    direction: Radians


class HeadPolicy:
    """A policy without any claim. scene: what it shares with all others."""

    kind: str = ""
    """Kind of its claims; "": its name. Policies of one kind share a place: of their claims the first one counts."""
    before: ClassVar[str] = "face"
    """Name of the policy before which one of others comes. Ours come in the order of `policies.OWN`."""

    def __init__(self, scene: HeadScene, config: GenerationConfig) -> None:
        self.scene, self.config = scene, config
        self.name, self.priority = "", 0
        """Name, and place in the order, from 1: the strongest. The arbiter sets both."""

    def feed(self, message: Observation, now: Seconds) -> None:
        """Take what has happened.

        message: what is perceived, recognised, or told of the body; the scene has taken it before. now: in seconds.
        """

    @property
    def deadline(self) -> Seconds | None:
        """Time of the next change of the claim without a message; None, or one that has passed: there is none."""
        return None

    def claim(self, now: Seconds, weaker: Sequence[Claim]) -> Claim | None:
        """Tell what the head is claimed for; None: for nothing.

        now: in seconds. weaker: claims of policies that come after.
        """
        return None

    def sign(self, now: Seconds) -> RobotSign | None:
        """Return the sign that the robot is to give now, as a listener; None: it gives none.

        It is asked after the ruling, and neither while somebody's order holds the head nor in a turn of the robot.
        now: in seconds.
        """
        return None

    def turn(self, now: Seconds) -> TrunkTurn | None:
        """Return where the trunk is to turn now; None: it stays.

        It is asked after the ruling, of a body that has a trunk, until the trunk has turned: the eyes have to rest on
        that person, and nobody's order to have the head. now: in seconds.
        """
        return None

    def has_head(self, has: bool, now: Seconds) -> None:
        """Note after each ruling who has the head.

        has: True if it is given to claims of this kind. now: in seconds.
        """

    def join(self, other: str, name: str) -> None:
        """Take two ids for one person. other: the id that is used no more. name: the id from now on."""
        self.forget(other)

    def forget(self, person: str) -> None:
        """Drop what is known of somebody who has been gone for long. person: their id."""

    def recognition_lost(self) -> None:
        """Drop what recognition has told: the ends of its events and speeches will never come."""

    def wish(self, target: str, reason: str) -> Claim:
        """Return a claim of this policy. target: entity id; "": hold the direction. reason: in words, for people."""
        return Claim(kind=self.kind, priority=self.priority, target=target, reason=reason)
