"""What actors are seen to do: the robot (from its sync points as realised) and people (from perception), alike."""

from msgspec import Struct

from engage_hri.schemas.behaviors import Action
from engage_hri.schemas.units import Probability, Stamp


class ActionBegan(Struct, frozen=True, kw_only=True, tag="action_began", omit_defaults=True):
    """evt: an actor has begun to do something. A new `look` ends the actor's previous one.

    targets: entity ids; an actor's id stands for its face; empty with `look`: away.
    behavior: for the robot `block:behavior`.
    """

    actor: str
    action: Action
    at: Stamp
    targets: tuple[str, ...] = ()
    confidence: Probability = 1.0
    behavior: str = ""


class ActionEnded(Struct, frozen=True, kw_only=True, tag="action_ended", omit_defaults=True):
    """evt: the end of what `ActionBegan` of the same actor, action and targets began."""

    actor: str
    action: Action
    at: Stamp
    targets: tuple[str, ...] = ()
    confidence: Probability = 1.0
    behavior: str = ""


class ActorFound(Struct, frozen=True, kw_only=True, tag="actor_found", omit_defaults=True):
    actor: str
    at: Stamp


class ActorLost(Struct, frozen=True, kw_only=True, tag="actor_lost", omit_defaults=True):
    """evt: perception no longer sees this person. Whatever was open with them closes."""

    actor: str
    at: Stamp
