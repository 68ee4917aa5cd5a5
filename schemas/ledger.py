"""Ledger of recognition: what it took, in the order in which it did, so that a recording can be recognized again.

What a recorder hears, it hears in an order of its own: each process is heard in order, but two of them need not come
to two listeners in the same one. Streams may reach one and not the other.
"""

from typing import Annotated, get_args

from msgspec import Meta, Struct

from engage_hri.schemas.actions import ActionBegan, ActionEnded, ActorFound, ActorLost, OngoingActions
from engage_hri.schemas.attention import HeadOwner
from engage_hri.schemas.body import RobotState
from engage_hri.schemas.feedback import BlockProgress, SyncPointProgress
from engage_hri.schemas.perception import HeadPose, Utterance, VoiceActivity
from engage_hri.schemas.presence import PeerAlive, PeerGone
from engage_hri.schemas.recognition import RequestEvent, SignalTurn
from engage_hri.schemas.requests import Cancel
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.schemas.world import World

Content = (
    ActionBegan | ActionEnded | ActorFound | ActorLost | OngoingActions | World | RobotState | HeadOwner
    | SyncPointProgress | BlockProgress | HeadPose | VoiceActivity | Utterance | RequestEvent | SignalTurn | Cancel
    | PeerAlive | PeerGone
)  # fmt: skip
"""Messages that recognition takes into account."""
TAKEN = get_args(Content)


class ReadClock(Struct, frozen=True, array_like=True):
    """A clock of another machine as a step read it: the own one is at `its instant + offset`.

    offset: None: nothing is known of the clock; then all its instants read as now. error: None: without bound.
    """

    clock: str
    offset: Seconds | None
    error: Seconds | None


class Step(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A step of recognition: it took a message, or did what was due.

    now: on the clock of recognition. life, number: of the message that it took, on any key of the classes `evt` and
    `state`; it is not repeated here. key, source, content: of any other message, whole: a request has the name that
    recognition knows it by as its id. at: local time of arrival, if it is not `now`. clocks: those that were read.
    """

    now: Seconds
    life: str = ""
    number: Annotated[int, Meta(ge=0)] = 0
    key: str = ""
    source: str = ""
    content: Content | None = None
    at: Seconds | None = None
    past: bool = False
    clocks: tuple[ReadClock, ...] = ()


class Taken(Struct, frozen=True, kw_only=True, tag="taken", omit_defaults=True):
    """evt: recognition -> recorders: steps, in order; only while somebody listens. They come before what they led to.

    session: the life of recognition, as in the ids of its events. first: number of the first step in that life, from
    1; steps before were not told. Its configuration is in its `ServiceSettings`.
    """

    session: str
    at: Stamp
    first: Annotated[int, Meta(ge=1)]
    steps: tuple[Step, ...]
