"""All messages of the bus as one tagged union, their two encodings, and the lines that people and programs read.

A line of `--feedback`, `--events` and `engage watch` is the JSON form of its message (docs/protocol.md; `Line` in
exported/engage.json), made easier for a program that knows nothing else of the bus: every key is always there, even
at its default, and an instant is a number, the seconds of the bus clock. Seconds are rounded to microseconds.
"""

from collections.abc import Mapping
from functools import cache, lru_cache
from typing import Any, get_args

import msgspec
from msgspec import Struct

from engage_hri.schemas import (
    blocks,
    body,
    body_faults,
    fragments,
    keys,
    participants,
    perception,
    recognition,
    requests,
    world,
)
from engage_hri.schemas.access import LARGEST, check_size
from engage_hri.schemas.blocks import Feedback
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.units import Stamp

MAJOR = 1

Message = (
    requests.Heard | requests.Accepted | requests.Outdated | requests.Refused | requests.Cancel
    | requests.KeepAlive | requests.Unreadable
    | Fault
    | fragments.PerformFragment | fragments.FragmentOutcome | fragments.TurnClosed | fragments.Inhibit
    | fragments.InhibitionEnded | fragments.HeadOwner | fragments.SetCondition | fragments.ConditionSet
    | fragments.StudyCondition
    | blocks.PerformBlock | blocks.BlockOutcome | blocks.InterruptBehavior | blocks.BehaviorInterrupted
    | blocks.SteerPerformance | blocks.SteerRobot | blocks.PerformanceSteered | blocks.Held | blocks.BodyHeld
    | blocks.NetPlanned | blocks.NetMarked | blocks.NetWaiting | blocks.BlockProgress | blocks.SyncPointProgress
    | blocks.PredictionFeedback | blocks.WarningFeedback
    | body.PerformBehavior | body.AbortBehavior | body.BehaviorAborted | body.GoHome | body.HomeReached
    | body.BehaviorOutcome | body.SyncPointArrived | body.SyncPointReached | body.WordSpoken | body.RobotState
    | body.RobotSeen | body.DescribeBody | body.Capabilities | body.EstimateBehaviors | body.Estimates
    | body_faults.SwitchFaults | body_faults.FaultsSwitched | body_faults.BodyFaults
    | perception.ActionBegan | perception.ActionEnded | perception.ActorFound | perception.ActorLost
    | perception.OngoingActions | perception.Utterance | perception.HeadPose | perception.Looked
    | perception.VoiceActivity
    | perception.SoundFrame
    | perception.FaceLandmarks
    | world.World
    | recognition.RequestEvent | recognition.EventOutcome | recognition.SignalTurn | recognition.TurnOutcome
    | recognition.ConnectionEvent | recognition.OpenEvents | recognition.Statistics
    | recognition.Interjection | recognition.Floor | recognition.SamePeople
    | participants.Taken | participants.AskStatus | participants.Status | participants.ServiceSettings
    | participants.PeerAlive | participants.PeerGone
)  # fmt: skip
"""Union of all messages. The field `type` of the encoded form says which one it is."""

COMMANDS: Mapping[str, tuple[type[requests.Request], ...]] = {
    keys.FRAGMENT: (fragments.PerformFragment,),
    keys.INHIBIT: (fragments.Inhibit,),
    keys.CONDITION: (fragments.SetCondition,),
    keys.BLOCK: (blocks.PerformBlock, blocks.InterruptBehavior, blocks.SteerPerformance),
    keys.ROBOT: (blocks.SteerRobot,),
    keys.EVENT: (recognition.RequestEvent,),
    keys.TURN: (recognition.SignalTurn,),
    keys.BEHAVIOR: (body.PerformBehavior, body.AbortBehavior, body.GoHome),
    keys.FAULTS: (body_faults.SwitchFaults,),
}
"""Commands on each key; besides, `keys.cancel` takes `Cancel`, and `keys.keep_alive` takes `KeepAlive`."""

OUTWARD = (
    recognition.ConnectionEvent, recognition.OpenEvents, recognition.Statistics, recognition.Interjection,
    recognition.Floor, recognition.SamePeople, perception.Utterance,
)  # fmt: skip
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


LineMessage = (
    recognition.ConnectionEvent | recognition.Interjection | recognition.Floor | recognition.Statistics
    | perception.Utterance | Fault
    | fragments.HeadOwner | fragments.StudyCondition | body_faults.BodyFaults
    | Feedback | blocks.Held | blocks.BodyHeld | blocks.NetPlanned | blocks.NetMarked | blocks.NetWaiting
)  # fmt: skip
"""Messages that have a line."""
_KINDS = get_args(LineMessage)
_DECIMALS = 6
INSTANT = {"type": "number", "description": "seconds of the bus clock"}
"""JSON Schema of an instant in a line."""


def line(message: Message) -> str | None:
    """Write a message as one line, without the line end; None for a message that has no line."""
    return msgspec.json.encode(_plain(message)).decode() if isinstance(message, _KINDS) else None


def _plain(value: Any) -> Any:
    match value:
        case Stamp():
            return _plain(float(value.seconds))
        case Struct():
            tag = value.__struct_config__.tag
            fields = {name: _plain(getattr(value, name)) for name in value.__struct_fields__}
            return {"type": tag, **fields} if tag else fields
        case tuple():
            return [_plain(item) for item in value]
        case float():
            return round(value, _DECIMALS) + 0.0  # no negative zero
    return value
