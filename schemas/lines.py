"""Public JSON lines of `--feedback`, `--events` and `engage watch`: one message per line.

A line is the JSON form of its message (docs/protocol.md; `Line` in exported/engage.json), made easier for a program
that knows nothing else of the bus: every key is always there, even at its default, and an instant is a number, the
seconds of the bus clock. Seconds are rounded to microseconds.
"""

from typing import Any, get_args

import msgspec
from msgspec import Struct

from engage_hri.schemas.attention import HeadOwner
from engage_hri.schemas.body_faults import BodyFaults
from engage_hri.schemas.conditions import StudyCondition
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.feedback import Feedback
from engage_hri.schemas.holds import BodyHeld, Held
from engage_hri.schemas.messages import Message
from engage_hri.schemas.nets import NetMarked, NetPlanned, NetWaiting
from engage_hri.schemas.perception import Utterance
from engage_hri.schemas.recognition import ConnectionEvent, Statistics
from engage_hri.schemas.units import Stamp

LineMessage = (
    ConnectionEvent
    | Statistics
    | Utterance
    | Feedback
    | HeadOwner
    | Held
    | BodyHeld
    | BodyFaults
    | StudyCondition
    | Fault
    | NetPlanned
    | NetMarked
    | NetWaiting
)
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
