"""Steps of control, which its intake takes, and their effects, which its service carries out. Pure.

Control decides by these alone (`intake.py`), so that it can be done again from a recording. The world, and
who is the same, come by the bus. The others stand in the ledger of control, whole.
"""

from typing import Literal

from msgspec import Struct

from engage_hri.schemas.behaviors import BlockBehavior
from engage_hri.schemas.body import AbortBehavior, Capabilities, GoHome, PerformBehavior, PlannedInstant
from engage_hri.schemas.body_faults import BodyFault, SwitchFaults
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.recognition import SamePeople
from engage_hri.schemas.requests import Cancel
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import World
from engage_hri.services.control.contract.body import Progress, Revocation
from engage_hri.services.requests.serving import HoldRequest
from engage_hri.services.runtime.intake import AnswerRequest, PublishMessage


class Nonsense(Struct, frozen=True, tag="nonsense"):
    """A driver has told what has no meaning. what: in words."""

    what: str


class RequestHanded(Struct, frozen=True, kw_only=True, tag="request_handed", omit_defaults=True):
    """The desk hands over a request, new or changed, or the end of one. Its id is its name at control.

    asked: the id as it was asked with. is_orphaned: of a `Cancel`, true if nobody has sent it:
    the requester is lost.
    """

    request: PerformBehavior | AbortBehavior | GoHome | SwitchFaults | Cancel
    asked: str
    is_orphaned: bool = False


class ControlBegan(Struct, frozen=True, kw_only=True, tag="control_began", omit_defaults=True):
    """The service begins; always the first step.

    able: what the body can do. faults: those that it plays. covered_for: see `CoveredObjects`; it is no setting of
    control alone.
    """

    able: Capabilities
    covered_for: Seconds
    faults: tuple[BodyFault, ...] = ()


class BodyTold(Struct, frozen=True, kw_only=True, tag="body_told", omit_defaults=True):
    """The driver tells of a behavior. request: name of the request for it."""

    request: str
    progress: Progress | Nonsense


class StreamEnded(Struct, frozen=True, kw_only=True, tag="stream_ended", omit_defaults=True):
    """The driver has ended a behavior, or what it told of it is over.

    request: name of the request for it. how: `refused`: nothing has moved; `failed`: what has moved goes home by
    itself; `broken`: nobody knows where its parts are. fault: why; None: known already, or nothing was wrong.
    """

    request: str
    how: Literal["ended", "refused", "failed", "broken"] = "ended"
    fault: Fault | None = None


class AuthorityRevoked(Struct, frozen=True, kw_only=True, tag="authority_revoked", omit_defaults=True):
    """The body itself has revoked the authority of a behavior, as it gives one of its parts to another.

    request: name of the request for it.
    """

    request: str
    how: Revocation = "taken_over"


class EyesMoved(Struct, frozen=True, kw_only=True, tag="eyes_moved", omit_defaults=True):
    """The eyes rest on something else.

    on: id of the entity; empty: none. at: loop time. request: name of the request for a behavior that has told
    of its progress just then; empty: there is none.
    """

    at: Seconds
    on: str = ""
    request: str = ""


class HomeEnded(Struct, frozen=True, kw_only=True, tag="home_ended", omit_defaults=True):
    """A way home has ended.

    request: name of the request for it; empty: control itself has begun it. parts: those that went; empty: all.
    fault: why they are not at home. is_told: true if that has been told already, as the bug that it is.
    """

    request: str = ""
    parts: tuple[str, ...] = ()
    fault: Fault | None = None
    is_told: bool = False


class FaultsPlayed(Struct, frozen=True, kw_only=True, tag="faults_played", omit_defaults=True):
    """The body plays the faults that it was told to play, or refuses. It changes them by nothing else.

    request: name of the request for it. by: participant that has asked. faults: all that it plays now. fault: why it
    refuses.
    """

    request: str
    by: str
    faults: tuple[BodyFault, ...]
    fault: Fault | None = None


class BodyComplained(Struct, frozen=True, tag="body_complained"):
    """The driver tells what goes wrong outside of any behavior."""

    fault: Fault


ControlStep = (
    World | RequestHanded | HoldRequest | ControlBegan | BodyTold | StreamEnded | AuthorityRevoked | EyesMoved
    | HomeEnded | FaultsPlayed | BodyComplained | SamePeople
)  # fmt: skip
"""Everything by which control decides, but for the time."""


# -- effects ---------------------------------------------------------------------------------------------------------


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
