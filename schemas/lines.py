"""The public JSON lines of `--feedback` and `--events`: one line per message, every key always there.

Described in docs/protocol.md; anyone may build on them, so keys are added but never renamed or removed.
Times are seconds, rounded to microseconds; what is not known is null.
"""

from typing import Any

import msgspec

from schemas.feedback import BlockProgress, PlannedPoint, PredictionFeedback, SyncPointProgress, WarningFeedback
from schemas.messages import Message
from schemas.recognition import ConnectionEvent
from schemas.units import Seconds

_encoder = msgspec.json.Encoder()


def line(message: Message) -> str | None:
    """The message as one line, without the line end; None for a message that neither stream carries."""
    match message:
        case BlockProgress():
            return _line(block_progress(message))
        case SyncPointProgress():
            return _line(sync_point_progress(message))
        case PredictionFeedback():
            return _line(prediction(message))
        case WarningFeedback():
            return _line(warning(message))
        case ConnectionEvent():
            return _line(connection_event(message))
    return None


def block_progress(message: BlockProgress) -> dict[str, Any]:
    return {
        "type": "block_progress",
        "block": message.block,
        "progress": message.progress,
        "status": message.status or None,
        "time": _rounded(message.time),
        "global_time": _rounded(message.at.seconds),
    }


def sync_point_progress(message: SyncPointProgress) -> dict[str, Any]:
    return {
        "type": "sync_point_progress",
        "block": message.block,
        "behavior": message.behavior,
        "sync": message.sync,
        "time": _rounded(message.time),
        "global_time": _rounded(message.at.seconds),
        "predicted": _rounded(message.predicted),
        "source": message.source,
        "arrived": _rounded(message.arrived),
        "skew": _rounded(message.skew),
    }


def prediction(message: PredictionFeedback) -> dict[str, Any]:
    return {"type": "prediction", "block": message.block, "points": [_planned(point) for point in message.points]}


def _planned(point: PlannedPoint) -> dict[str, Any]:
    return {"behavior": point.behavior, "sync": point.sync, "time": _rounded(point.time)}


def warning(message: WarningFeedback) -> dict[str, Any]:
    return {
        "type": "warning",
        "block": message.block,
        "behavior": message.behavior or None,
        "kind": message.kind,
        "message": message.message,
    }


def connection_event(message: ConnectionEvent) -> dict[str, Any]:
    return {
        "type": "connection_event",
        "id": message.id,
        "kind": message.kind,
        "initiator": message.initiator,
        "responder": message.responder,
        "objects": list(message.objects),
        "cause": message.cause,
        "state": message.state,
        "optional": message.optional,
        "delay": _rounded(message.delay),
        "time": _rounded(message.at.seconds),
        "started": _rounded(message.started.seconds),
        "duration": _rounded(message.duration),
        "response": message.response,
        "block": message.block or None,
        "behavior": message.behavior or None,
        "turn": message.turn or None,
    }


def _rounded(time: Seconds | None) -> Seconds | None:
    return None if time is None else round(time, 6) + 0.0  # + 0.0: no negative zero


def _line(fields: dict[str, Any]) -> str:
    return _encoder.encode(fields).decode()
