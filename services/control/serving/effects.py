"""Effects of a step of control, besides messages and answers: what its service is to carry out. Pure."""

from msgspec import Struct

from engage_hri.schemas.behaviors import BlockBehavior
from engage_hri.schemas.body import PerformBehavior, PlannedInstant
from engage_hri.schemas.body_faults import BodyFault, SwitchFaults
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.world import World
from engage_hri.services.control.contract.body import Revocation
from engage_hri.services.runtime.intake import AnswerRequest, PublishMessage


class Alert(Struct, frozen=True):
    """Tell of something that is wrong with the body, and not with a request: a person has to see to it."""

    fault: Fault


class Reassure(Struct, frozen=True):
    """Tell whoever sees the log that something is over of which there was an `Alert`."""

    text: str


class ShowWorld(Struct, frozen=True):
    """Let the body see the world."""

    world: World


class PlayFaults(Struct, frozen=True):
    """Let the body play exactly these faults. A `FaultsPlayed` follows."""

    request: SwitchFaults
    faults: tuple[BodyFault, ...]


class BeginBehavior(Struct, frozen=True):
    """Let the driver perform a behavior, as it is given it. What it tells comes back, and a `StreamEnded` at last."""

    request: PerformBehavior
    behavior: BlockBehavior


class GiveAuthority(Struct, frozen=True):
    """Let a behavior go on through this sync point, at this pace. request: name of the one for it."""

    request: str
    through: str
    pace: tuple[PlannedInstant, ...]


class HoldBehavior(Struct, frozen=True):
    """Let a behavior wait at the next place where it can, or go on."""

    request: str
    is_held: bool


class RevokeAuthority(Struct, frozen=True):
    """Tell the driver to end a behavior."""

    request: str
    how: Revocation


class LeaveStream(Struct, frozen=True):
    """Listen to what the driver tells of this behavior no more, and close its stream.

    is_cut_off: the task in which it performs the behavior is cancelled: it does not end it by itself.
    """

    request: str
    is_cut_off: bool = False


class TakeHome(Struct, frozen=True):
    """Take parts home; empty: all. A `HomeEnded` follows. request: empty: nobody has asked for it. why: in words."""

    request: str
    parts: tuple[str, ...]
    why: str


class StopHome(Struct, frozen=True):
    """Give up the way home of this request."""

    request: str


Effect = (
    PublishMessage | AnswerRequest | Alert | Reassure | ShowWorld | PlayFaults | BeginBehavior | GiveAuthority
    | HoldBehavior | RevokeAuthority | LeaveStream | TakeHome | StopHome
)  # fmt: skip
