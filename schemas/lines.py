"""The public JSON lines of `--feedback`, `--events` and `engage watch`: one line per message, every key always there.

Described in docs/protocol.md, as `Line` in exported/engage.json; anyone may build on them, so keys are added but
never renamed or removed. Times are seconds, rounded to microseconds; what is not known is null.
"""

from typing import Any, TypeVar

import msgspec
from msgspec import Struct

from engage_hri.schemas.attention import HeadOwner
from engage_hri.schemas.behaviors import Action, Cause, EventKind
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.feedback import (
    BlockProgress,
    PlannedPoint,
    PredictionFeedback,
    SyncPointProgress,
    WarningFeedback,
)
from engage_hri.schemas.messages import Message
from engage_hri.schemas.recognition import ConnectionEvent, EventState, KindStatistics, Statistics, WindowStatistics
from engage_hri.schemas.units import Probability, Seconds

_encoder = msgspec.json.Encoder()


class BlockProgressLine(Struct, frozen=True, kw_only=True, tag="block_progress"):
    block: str | None
    progress: str
    status: str | None
    time: Seconds
    global_time: Seconds


class SyncPointLine(Struct, frozen=True, kw_only=True, tag="sync_point_progress"):
    block: str
    behavior: str
    sync: str
    time: Seconds
    global_time: Seconds
    predicted: Seconds | None
    source: str
    arrived: Seconds | None
    skew: Seconds | None


class PointLine(Struct, frozen=True, kw_only=True):
    behavior: str
    sync: str
    time: Seconds


class PredictionLine(Struct, frozen=True, kw_only=True, tag="prediction"):
    block: str
    points: tuple[PointLine, ...]


class WarningLine(Struct, frozen=True, kw_only=True, tag="warning"):
    block: str | None
    behavior: str | None
    kind: str
    message: str


class ConnectionEventLine(Struct, frozen=True, kw_only=True, tag="connection_event"):
    id: str
    kind: EventKind
    initiator: str
    responder: str
    objects: tuple[str, ...]
    cause: Cause
    state: EventState
    optional: bool
    delay: Seconds | None
    time: Seconds
    started: Seconds
    duration: Seconds | None
    response: Action | None
    block: str | None
    behavior: str | None
    turn: str | None


class KindLine(Struct, frozen=True, kw_only=True):
    kind: EventKind
    count: int
    succeeded: int
    failed: int
    failure_rate: Probability | None
    delay_min: Seconds | None
    delay_mean: Seconds | None
    delay_max: Seconds | None
    failed_delay_min: Seconds | None
    failed_delay_mean: Seconds | None
    failed_delay_max: Seconds | None


class WindowLine(Struct, frozen=True, kw_only=True):
    events: int
    mtbce: Seconds | None
    mtbce_without_maintenance: Seconds | None
    max_gap: Seconds | None
    kinds: tuple[KindLine, ...]


class StatisticsLine(Struct, frozen=True, kw_only=True, tag="statistics"):
    """actor: a person's id; null: of all together."""

    actor: str | None
    time: Seconds
    engagement: Probability | None
    level: str
    reasons: tuple[str, ...]
    busy: bool
    session: WindowLine
    recent: WindowLine


Line = (
    ConnectionEventLine | StatisticsLine | BlockProgressLine | SyncPointLine | PredictionLine | WarningLine
    | HeadOwner | Fault
)  # fmt: skip
"""What one line holds; the last two are as they travel, so without what is at its default."""


def line(message: Message) -> str | None:
    """The message as one line, without the line end; None for a message that has none."""
    made = _line(message)
    return None if made is None else _encoder.encode(made).decode()


def _line(message: Message) -> Line | None:
    match message:
        case BlockProgress():
            return BlockProgressLine(
                block=message.block, progress=message.progress, status=message.status or None,
                time=_rounded(message.time), global_time=_rounded(message.at.seconds),
            )  # fmt: skip
        case SyncPointProgress():
            return SyncPointLine(
                block=message.block, behavior=message.behavior, sync=message.sync, time=_rounded(message.time),
                global_time=_rounded(message.at.seconds), predicted=_rounded(message.predicted),
                source=message.source, arrived=_rounded(message.arrived), skew=_rounded(message.skew),
            )  # fmt: skip
        case PredictionFeedback():
            return PredictionLine(block=message.block, points=tuple(map(_point, message.points)))
        case WarningFeedback():
            return WarningLine(
                block=message.block, behavior=message.behavior or None, kind=message.kind, message=message.message
            )
        case ConnectionEvent():
            return ConnectionEventLine(
                id=message.id, kind=message.kind, initiator=message.initiator, responder=message.responder,
                objects=message.objects, cause=message.cause, state=message.state, optional=message.optional,
                delay=_rounded(message.delay), time=_rounded(message.at.seconds),
                started=_rounded(message.started.seconds), duration=_rounded(message.duration),
                response=message.response, block=message.block or None, behavior=message.behavior or None,
                turn=message.turn or None,
            )  # fmt: skip
        case Statistics():
            return StatisticsLine(
                actor=message.actor or None, time=_rounded(message.at.seconds),
                engagement=_rounded(message.engagement), level=message.level, reasons=message.reasons,
                busy=message.busy, session=_window(message.session), recent=_window(message.recent),
            )  # fmt: skip
        case HeadOwner() | Fault():
            return message
    return None


def _point(point: PlannedPoint) -> PointLine:
    return PointLine(behavior=point.behavior, sync=point.sync, time=_rounded(point.time))


def _window(window: WindowStatistics) -> WindowLine:
    return WindowLine(
        events=window.events, mtbce=_rounded(window.mtbce),
        mtbce_without_maintenance=_rounded(window.mtbce_without_maintenance), max_gap=_rounded(window.max_gap),
        kinds=tuple(map(_kind, window.kinds)),
    )  # fmt: skip


def _kind(kind: KindStatistics) -> KindLine:
    known = {name: getattr(kind, name) for name in KindLine.__struct_fields__}
    fields: dict[str, Any] = {
        name: _rounded(each) if isinstance(each, float) else each for name, each in known.items()
    }
    return KindLine(**fields)


T = TypeVar("T", Seconds, Seconds | None)


def _rounded(time: T) -> T:
    return time if time is None else round(time, 6) + 0.0  # + 0.0: no negative zero
