"""What the realizer tells about a block while it runs: the feedback of BML 1.0."""

from typing import Literal

from msgspec import Struct

from engage_hri.schemas.units import Seconds, Stamp

WarningKind = Literal[
    "PARSING_FAILURE", "NO_SUCH_TARGET", "IMPOSSIBLE_TO_SCHEDULE", "BEHAVIOR_TYPE_NOT_SUPPORTED",
    "CANNOT_CREATE_BEHAVIOR", "EXECUTION_FAILURE", "LATE", "POLICY",
    "INTERRUPTED",
]  # fmt: skip
"""INTERRUPTED: somebody asked for the end of a behavior.
POLICY: generation performs a fragment otherwise than it asks, for example with a less reliable reference."""


class BlockProgress(Struct, frozen=True, kw_only=True, tag="block_progress", omit_defaults=True):
    """evt: a block has started, or ended with a status. time: since the block's start."""

    block: str | None
    progress: Literal["start", "end"]
    at: Stamp
    time: Seconds = 0.0
    status: Literal["", "done", "failed", "interrupted"] = ""
    character_id: str = ""


class SyncPointProgress(Struct, frozen=True, kw_only=True, tag="sync_point_progress", omit_defaults=True):
    """evt: a sync point as realised. Each default point of each behavior exactly once, in order.

    at, time: as measured, but never before those of an earlier message about the block.
    sync: in the spelling of the block's dialect. predicted: where the plan had it, from the block's start.
    skew: from the first to this point of its class. source: who says so.
    """

    block: str
    behavior: str
    sync: str
    at: Stamp
    time: Seconds
    predicted: Seconds | None = None
    arrived: Seconds | None = None
    skew: Seconds = 0.0
    source: Literal["body", "clock"] = "body"
    character_id: str = ""


class PlannedPoint(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """type: the BML element of its behavior."""

    behavior: str
    sync: str
    time: Seconds
    type: str = ""


class PredictionFeedback(Struct, frozen=True, kw_only=True, tag="prediction", omit_defaults=True):
    """evt: when the points that are still to come are expected, from the block's start, which was `at`.

    Once at the start, and again when an expectation has moved noticeably.
    """

    block: str
    points: tuple[PlannedPoint, ...]
    at: Stamp | None = None
    character_id: str = ""


class WarningFeedback(Struct, frozen=True, kw_only=True, tag="warning", omit_defaults=True):
    """evt: something was refused, dropped or done otherwise than asked. behavior empty: the whole block."""

    block: str | None
    kind: WarningKind
    message: str
    behavior: str = ""
    at: Stamp | None = None
    character_id: str = ""


Feedback = BlockProgress | SyncPointProgress | PredictionFeedback | WarningFeedback
