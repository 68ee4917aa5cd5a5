"""Actions that are seen: those of the robot (from its sync points as realised) and of people (from perception).

They are told twice: each change as an event, and after it, as a state, what goes on now. The state is for readers
that come late, or have missed an event.
"""

from msgspec import Struct

from engage_hri.schemas.behaviors import Action
from engage_hri.schemas.units import Probability, Stamp


class ActionBegan(Struct, frozen=True, kw_only=True, tag="action_began", omit_defaults=True):
    """evt: an actor has begun an action. A new `look` ends the actor's previous one.

    targets: entity ids; an actor's id means the face; empty: `look` goes away from everything, others have no target.
    behavior: of the robot, `block:behavior`; empty for people.
    """

    actor: str
    action: Action
    at: Stamp
    targets: tuple[str, ...] = ()
    confidence: Probability = 1.0
    behavior: str = ""


class ActionEnded(Struct, frozen=True, kw_only=True, tag="action_ended", omit_defaults=True):
    """evt: the action that `ActionBegan` told of, with the same actor, action and targets, has ended."""

    actor: str
    action: Action
    at: Stamp
    targets: tuple[str, ...] = ()
    confidence: Probability = 1.0
    behavior: str = ""


class ActorFound(Struct, frozen=True, kw_only=True, tag="actor_found", omit_defaults=True):
    """evt: perception sees this person, for the first time or again."""

    actor: str
    at: Stamp


class ActorLost(Struct, frozen=True, kw_only=True, tag="actor_lost", omit_defaults=True):
    """evt: perception no longer sees this person. Connection events that are open with them end."""

    actor: str
    at: Stamp


class OngoingActions(Struct, frozen=True, kw_only=True, tag="ongoing_actions", omit_defaults=True):
    """state: all that an actor does now, as one reporter knows it: perception of a person, control of the robot.

    Published after each event of the actor, so that its reader knows all earlier ones.

    at: the instant of the last change; what is missing here has ended by then.
    """

    actor: str
    at: Stamp
    actions: tuple[ActionBegan, ...] = ()
    """The actions that go on, each as its `ActionBegan` was told, the oldest first."""
    seen: bool | None = None
    """True: perception sees the person, as by `ActorFound`; False: it has lost the person; None: this reporter does
    not tell. Of somebody who is lost, `actions` are those that go on if the person is found again."""
