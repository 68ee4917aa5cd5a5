"""Feedback of BML 1.0: the realizer's messages about a block while it runs."""

from typing import Literal

from msgspec import Struct

from engage_hri.schemas.units import Seconds, Stamp

WarningKind = Literal[
    "PARSING_FAILURE", "NO_SUCH_TARGET", "IMPOSSIBLE_TO_SCHEDULE", "BEHAVIOR_TYPE_NOT_SUPPORTED",
    "CUSTOM_BEHAVIOR_NOT_SUPPORTED", "CUSTOM_ATTRIBUTE_NOT_SUPPORTED",
    "CANNOT_CREATE_BEHAVIOR", "EXECUTION_FAILURE", "LATE", "POLICY",
    "INTERRUPTED", "DEGRADED",
]  # fmt: skip
"""CUSTOM_BEHAVIOR_NOT_SUPPORTED, CUSTOM_ATTRIBUTE_NOT_SUPPORTED: it is of a namespace that is not BML's.
DEGRADED: a behavior is performed with the nearest that the body has, or without a detail; nothing is dropped.
INTERRUPTED: a behavior was ended on request, or was held for too long; without a behavior: its block or all was.
POLICY: generation performs a fragment otherwise than it asks, for example with a less reliable reference."""


class BlockProgress(Struct, frozen=True, kw_only=True, tag="block_progress", omit_defaults=True):
    """evt: a block has started, or ended with a status.

    block: its id. time: seconds since the block's start. status: empty at its start.
    """

    block: str | None
    progress: Literal["start", "end"]
    at: Stamp
    time: Seconds = 0.0
    status: Literal["", "done", "failed", "interrupted"] = ""
    character_id: str = ""


class SyncPointProgress(Struct, frozen=True, kw_only=True, tag="sync_point_progress", omit_defaults=True):
    """evt: a sync point was realised. Each default point of each behavior exactly once, in order.

    sync: in the spelling of the block's dialect.
    at: instant as measured, but never before that of an earlier message about the block.
    time: the same in seconds since the block's start.
    predicted: time at which the last prediction had it. arrived: time at which the body came to it.
    skew: seconds after the first of the sync points that should be the same instant.
    source: `body`: the body reported it; `clock`: the realizer itself realised it.
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
    """A sync point with the time at which it is expected.

    time: seconds since the block's start. type: the BML element of its behavior.
    """

    behavior: str
    sync: str
    time: Seconds
    type: str = ""


class PredictionFeedback(Struct, frozen=True, kw_only=True, tag="prediction", omit_defaults=True):
    """evt: the expected times of a block's coming sync points.

    Sent when the block starts, and again when an expectation has moved noticeably.

    at: when the block started.
    """

    block: str
    points: tuple[PlannedPoint, ...]
    at: Stamp | None = None
    character_id: str = ""


class WarningFeedback(Struct, frozen=True, kw_only=True, tag="warning", omit_defaults=True):
    """evt: something was refused, dropped or done otherwise than asked.

    block: its id; null if it could not be read. behavior: id; empty: the warning is about the whole block.
    """

    block: str | None
    kind: WarningKind
    message: str
    behavior: str = ""
    at: Stamp | None = None
    character_id: str = ""

    @property
    def place(self) -> str:
        """Name of the thing that the warning is about: `block:behavior`, or the block alone."""
        return ":".join(part for part in (self.block, self.behavior) if part)


Feedback = BlockProgress | SyncPointProgress | PredictionFeedback | WarningFeedback
