"""A policy of turns: a reason to say a fragment otherwise, to wait within a turn, or to end it early. Pure.

The robot has a turn until it gives it away, and others have a say in that: they leave, speak into it, or fall silent.
Each such reason is a policy. It is told what happens, and knows nothing of the others: `robot_turns.py` asks all of
them. So a new reason is a new class, and a line in the order of `policies.py`; a package of others adds its own by an
entry point:

    [project.entry-points."engage.turn_policies"]
    bell = "my_package.bell:BellPolicy"

Of several that end a turn at one instant the first one in the order says why.
"""

from collections.abc import Callable, Collection, Hashable, Mapping
from typing import ClassVar, NamedTuple

from engage_hri.schemas.faults import Fault
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.perception import ActionEnded, Utterance
from engage_hri.schemas.recognition import Interjection
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import World
from engage_hri.services.bus.deadlines import Sight
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.turns.interjections import Interjections
from engage_hri.services.generation.turns.plan import TurnPlan

News = World | Interjection | Utterance | ActionEnded
"""What people do, as far as policies of turns are told of it."""


class EarlyEnd(NamedTuple):
    """An early end of a turn. why: what it is told to be."""

    plan: TurnPlan
    why: Fault


class TurnScene:
    """Knowledge that the policies share: whose turn it is, as far as it was accepted. Each may read it.

    robot: id of the robot. sight: how to tell whether others are late, or this process.
    """

    def __init__(self, robot: str, sight: Sight) -> None:
        self.robot, self.sight = robot, sight
        self.interjections = Interjections()
        self.open: TurnPlan | None = None
        """The turn that the next fragment would continue."""
        self.speaker = self.life = ""
        """The client that has begun the open turn: nobody else goes on with it, or ends it."""
        self.live: dict[str, TurnPlan] = {}
        """Fragments accepted and not ended, in order."""
        self.begun: dict[str, bool] = {}
        """Turns of which a block was sent, and whether their end was signalled."""
        self.silent_since: Seconds | None = None
        """Time since which the open turn has nothing to say."""

    @property
    def under_way(self) -> tuple[TurnPlan, ...]:
        """Fragments that have not ended, and the turn that is open."""
        return (*self.live.values(), *([self.open] if self.open else []))

    @property
    def current(self) -> TurnPlan | None:
        """The turn that the robot has, until its end is signalled. A backchannel is said in the other's turn."""
        plans = self.under_way
        return next((plan for plan in plans if not plan.backchannel and not self.begun.get(plan.turn)), None)


class TurnPolicy:
    """A policy that changes nothing. name: its own. scene: what it shares with all others."""

    before: ClassVar[str] = "silence"
    """Name of the policy before which one of others comes. Ours come in the order of `policies.OWN`."""

    def __init__(self, name: str, scene: TurnScene, config: GenerationConfig) -> None:
        self.name, self.scene, self.config = name, scene, config

    def feed(self, message: News, now: Seconds) -> None:
        """Take what people do.

        message: who is in sight, what they say into the robot's turns, their words, the ends of what they do.
        now: in seconds.
        """

    def amended(self, plan: TurnPlan, fragment: TurnFragment) -> TurnPlan:
        """Return what a fragment adds to the conversation; its words are its manager's.

        plan: what it adds by Table 3.1 and the policies that come after.
        fragment: as its manager has sent it.
        """
        return plan

    @property
    def limits(self) -> Mapping[Hashable, Seconds]:
        """Times until which others may go on as they do, by names of its own."""
        return {}

    def ending(self, now: Seconds, due: Collection[Hashable]) -> EarlyEnd | None:
        """Return a turn that ends early now; None: there is none.

        now: in seconds.
        due: names of limits that have passed, in order.
        """
        return None

    def ends(self, plan: TurnPlan, reason: str) -> EarlyEnd:
        """Return the end of a turn.

        plan: what it was accepted as.
        reason: in words, for people.
        """
        return EarlyEnd(plan, Fault(reason=reason))

    @property
    def held(self) -> str:
        """The turn that is to wait between two words; "": there is none."""
        return ""

    def rename(self, name: Callable[[str], str]) -> None:
        """Know people by other ids from now on. name: the new one of each."""
