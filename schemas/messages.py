"""All messages of the bus as one tagged union, and their two encodings."""

from collections.abc import Mapping
from functools import cache, lru_cache
from typing import Any

import msgspec

from engage_hri.schemas import keys
from engage_hri.schemas.actions import ActionBegan, ActionEnded, ActorFound, ActorLost, OngoingActions
from engage_hri.schemas.attention import HeadOwner, Inhibit, InhibitionEnded
from engage_hri.schemas.blocks import (
    BehaviorInterrupted,
    BlockOutcome,
    InterruptBehavior,
    PerformanceSteered,
    PerformBlock,
    SteerPerformance,
    SteerRobot,
)
from engage_hri.schemas.body import (
    AbortBehavior,
    BehaviorAborted,
    BehaviorOutcome,
    Capabilities,
    DescribeBody,
    EstimateBehaviors,
    Estimates,
    GoHome,
    HomeReached,
    PerformBehavior,
    RobotSeen,
    RobotState,
    SyncPointArrived,
    SyncPointReached,
    WordSpoken,
)
from engage_hri.schemas.body_faults import BodyFaults, FaultsSwitched, SwitchFaults
from engage_hri.schemas.conditions import ConditionSet, SetCondition, StudyCondition
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.feedback import BlockProgress, PredictionFeedback, SyncPointProgress, WarningFeedback
from engage_hri.schemas.fragments import FragmentOutcome, PerformFragment, TurnClosed
from engage_hri.schemas.holds import BodyHeld, Held
from engage_hri.schemas.ledger import Taken
from engage_hri.schemas.limits import LARGEST, check_size
from engage_hri.schemas.nets import NetMarked, NetPlanned, NetWaiting
from engage_hri.schemas.perception import HeadPose, Utterance, VoiceActivity
from engage_hri.schemas.presence import PeerAlive, PeerGone
from engage_hri.schemas.recognition import (
    ConnectionEvent,
    EventOutcome,
    OpenEvents,
    RequestEvent,
    SignalTurn,
    Statistics,
    TurnOutcome,
)
from engage_hri.schemas.requests import Accepted, Cancel, Heard, KeepAlive, Outdated, Refused, Request, Unreadable
from engage_hri.schemas.settings import ServiceSettings
from engage_hri.schemas.status import AskStatus, Status
from engage_hri.schemas.world import World

MAJOR = 1

Message = (
    Heard | Accepted | Outdated | Refused | Cancel | KeepAlive | Unreadable | Fault
    | PerformFragment | FragmentOutcome | TurnClosed | Inhibit | InhibitionEnded | HeadOwner
    | SetCondition | ConditionSet | StudyCondition
    | PerformBlock | BlockOutcome | InterruptBehavior | BehaviorInterrupted | SteerPerformance | SteerRobot
    | PerformanceSteered | Held | BodyHeld | NetPlanned | NetMarked | NetWaiting
    | BlockProgress | SyncPointProgress | PredictionFeedback | WarningFeedback
    | PerformBehavior | AbortBehavior | BehaviorAborted | GoHome | HomeReached | BehaviorOutcome
    | SyncPointArrived | SyncPointReached | WordSpoken | RobotState | RobotSeen
    | SwitchFaults | FaultsSwitched | BodyFaults | DescribeBody | Capabilities | EstimateBehaviors | Estimates
    | ActionBegan | ActionEnded | ActorFound | ActorLost | OngoingActions | Utterance
    | World | HeadPose | VoiceActivity
    | RequestEvent | EventOutcome | SignalTurn | TurnOutcome | ConnectionEvent | OpenEvents | Statistics | Taken
    | AskStatus | Status | ServiceSettings | PeerAlive | PeerGone
)  # fmt: skip
"""Union of all messages. The field `type` of the encoded form says which one it is."""

COMMANDS: Mapping[str, tuple[type[Request], ...]] = {
    keys.FRAGMENT: (PerformFragment,),
    keys.INHIBIT: (Inhibit,),
    keys.CONDITION: (SetCondition,),
    keys.BLOCK: (PerformBlock, InterruptBehavior, SteerPerformance),
    keys.ROBOT: (SteerRobot,),
    keys.EVENT: (RequestEvent,),
    keys.TURN: (SignalTurn,),
    keys.BEHAVIOR: (PerformBehavior, AbortBehavior, GoHome),
    keys.FAULTS: (SwitchFaults,),
}
"""Commands on each key; besides, `keys.cancel` takes `Cancel`, and `keys.keep_alive` takes `KeepAlive`."""

OUTWARD = (ConnectionEvent, OpenEvents, Statistics, Utterance)
"""Messages for programs of others, a few a second at most: published as JSON, which every language reads. All others
are MessagePack."""

_msgpack_encoder = msgspec.msgpack.Encoder()
_json_encoder = msgspec.json.Encoder()
_msgpack_decoder: msgspec.msgpack.Decoder[Any] = msgspec.msgpack.Decoder(Message)
_json_decoder: msgspec.json.Decoder[Any] = msgspec.json.Decoder(Message)


def encoding_of(message: Message, form: str = "msgpack") -> str:
    """Name the encoding of a message: `application/msgpack;engage.SyncPointReached/1`."""
    return _encoding_of(type(message), form)


@cache  # asked for every message
def _encoding_of(kind: type, form: str) -> str:
    return f"application/{form};engage.{kind.__name__}/{MAJOR}"


def encode(message: Message) -> bytes:
    return _msgpack_encoder.encode(message)


def encode_json(message: Message) -> bytes:
    return _json_encoder.encode(message)


def in_form(key: str, message: Message, form: str) -> tuple[bytes, str]:
    """Encode a message that is sent on this key. Returns payload and encoding. Raises InputRefused: it is too large.

    form: `json` or `msgpack`.
    """
    payload, encoding = (encode_json if form == "json" else encode)(message), encoding_of(message, form)
    check_size(key, payload, encoding)
    return payload, encoding


def published(key: str, message: Message) -> tuple[bytes, str]:
    """Encode a message as it is published on this key. Returns and raises as `in_form` does."""
    return in_form(key, message, "json" if isinstance(message, OUTWARD) else "msgpack")


def decode(payload: bytes, encoding: str = "application/msgpack") -> Message:
    """Decode a payload. Raises InputRefused: another major version, an unknown form, too large, or bad content."""
    decoder = _decoder_of(encoding)
    form, _, schema = encoding.partition(";")
    if len(payload) > LARGEST:
        reason = f"{len(payload)} bytes; at most {LARGEST} are read"
        raise InputRefused(Fault(reason=reason, where=schema or form, advice="split it into several"))
    try:
        return decoder.decode(payload)  # type: ignore[no-any-return]
    except (msgspec.DecodeError, RecursionError, UnicodeDecodeError) as error:
        reason = f"a text that is not UTF-8 ({error.reason})" if isinstance(error, UnicodeDecodeError) else str(error)
        raise InputRefused(Fault(reason=reason, where=schema or form)) from error


@lru_cache(1024)  # asked for every message; a bound, because foreign programs may send any text
def _decoder_of(encoding: str) -> "msgspec.msgpack.Decoder[Any] | msgspec.json.Decoder[Any]":
    form, _, schema = encoding.partition(";")
    if schema and schema.rpartition("/")[2] not in ("", str(MAJOR)):
        raise InputRefused(Fault(reason=f"{schema} is not version {MAJOR}", advice="run the same engage everywhere"))
    if form == "application/json":
        return _json_decoder
    if form == "application/msgpack":
        return _msgpack_decoder
    raise InputRefused(Fault(reason=f"encoding {form!r}", advice="application/msgpack or application/json"))
