"""What was seen of a story: feedback, reports of the body, outcomes, and where every joint was at every time."""

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from itertools import pairwise

from msgspec import Struct, field

from engage_hri.schemas.blocks import (
    BlockOutcome,
    BlockProgress,
    Feedback,
    PredictionFeedback,
    SyncPointProgress,
    WarningFeedback,
)
from engage_hri.schemas.body import Ray, SyncPointReached, WordSpoken


class Told(Struct):
    """A message of feedback, and when it came."""

    at: float
    message: Feedback


class End(Struct):
    """How a request for a block ended. status: of its outcome; `refused`; `lost`: an answer that cannot be."""

    at: float
    status: str
    outcome: BlockOutcome | None = None
    reason: str = ""


class Sample(Struct, frozen=True):
    """The body at one instant. arms: left, right."""

    at: float
    joints: tuple[float, ...]
    gaze: Ray
    arms: tuple[Ray, Ray]
    is_moving: bool


class Steered(Struct, frozen=True):
    """A hold, or its end (`is_held` is false), once it was answered. Names as of `story.Deed`."""

    at: float
    is_held: bool
    block: str
    behavior: str

    def covers(self, other: "Steered") -> bool:
        """True if the other is of the same thing, or of a part of it."""
        is_within = not self.behavior or self.behavior == other.behavior
        return not self.block or (self.block == other.block and is_within)


class Record(Struct):
    """Everything seen. ends: of each block. asked: when each block was asked for.

    late_anyhow: behaviors that are late without holds, too; by block. refused_anyhow: blocks that are refused then:
    those that they name have ended.
    """

    joints: tuple[str, ...] = ()
    samples: list[Sample] = field(default_factory=list)
    told: list[Told] = field(default_factory=list)
    reported: list[SyncPointReached] = field(default_factory=list)
    words: list[WordSpoken] = field(default_factory=list)
    asked: dict[str, float] = field(default_factory=dict)
    ends: dict[str, list[End]] = field(default_factory=dict)
    errors: list[str] = field(default_factory=list)
    steered: list[Steered] = field(default_factory=list)
    late_anyhow: set[tuple[str, str]] = field(default_factory=set)
    refused_anyhow: set[str] = field(default_factory=set)
    natural: dict[tuple[str, str], tuple[tuple[str, str, float, bool], ...]] = field(default_factory=dict)
    """What the body says of a behavior, asked before the story began: phases as (since, to, seconds, may wait)."""

    # -- feedback of a block -----------------------------------------------------------------------------------------

    def points(self, block: str) -> list[SyncPointProgress]:
        return [
            each.message
            for each in self.told
            if isinstance(each.message, SyncPointProgress) and each.message.block == block
        ]

    def warnings(self, block: str) -> list[WarningFeedback]:
        return [
            each.message
            for each in self.told
            if isinstance(each.message, WarningFeedback) and each.message.block == block
        ]

    def late(self, block: str) -> list[WarningFeedback]:
        return [each for each in self.warnings(block) if each.kind == "LATE"]

    def progress(self, block: str, which: str) -> list[BlockProgress]:
        return [
            each.message
            for each in self.told
            if isinstance(each.message, BlockProgress)
            and each.message.block == block
            and each.message.progress == which
        ]

    def predictions(self, block: str) -> list[tuple[float, PredictionFeedback]]:
        return [
            (each.at, each.message)
            for each in self.told
            if isinstance(each.message, PredictionFeedback) and each.message.block == block
        ]

    def began(self, block: str) -> float | None:
        starts = self.progress(block, "start")
        return starts[0].at.seconds if starts else None

    def status(self, block: str) -> str:
        """Status of its only end; empty if there is none or more than one."""
        ends = self.ends.get(block, [])
        return ends[0].status if len(ends) == 1 else ""

    def outcome(self, block: str) -> BlockOutcome | None:
        ends = self.ends.get(block, [])
        return ends[0].outcome if len(ends) == 1 else None

    # -- the body ----------------------------------------------------------------------------------------------------

    def sample(self, at: float) -> Sample:
        """The body at an instant: as measured, or between the two measurements beside it."""
        index = bisect_left(self.samples, at, key=_at)
        if index == 0:
            return self.samples[0]
        if index == len(self.samples):
            return self.samples[-1]
        one, other = self.samples[index - 1], self.samples[index]
        share = (at - one.at) / (other.at - one.at) if other.at > one.at else 1.0
        if share > 1.0 - 1e-9:
            return other
        return Sample(
            at,
            _between(one.joints, other.joints, share),
            _ray_between(one.gaze, other.gaze, share),
            (_ray_between(one.arms[0], other.arms[0], share), _ray_between(one.arms[1], other.arms[1], share)),
            one.is_moving,
        )

    def during(self, since: float, until: float) -> list[Sample]:
        """All measurements from one instant to another, and what was at these two."""
        first = bisect_right(self.samples, since, key=_at)
        last = bisect_left(self.samples, until, key=_at)
        return [self.sample(since), *self.samples[first:last], self.sample(until)]

    def columns(self, *prefixes: str) -> tuple[int, ...]:
        """Numbers of the joints whose names begin so."""
        return tuple(number for number, name in enumerate(self.joints) if name.startswith(prefixes))

    def way(self, columns: Sequence[int], since: float, until: float) -> float:
        """Rotations of some joints from one instant to another, to and fro, added up."""
        seen = [[sample.joints[column] for column in columns] for sample in self.during(since, until)]
        return sum(abs(b - a) for one, other in pairwise(seen) for a, b in zip(one, other, strict=True))

    def away(self, columns: Sequence[int], at: float) -> float:
        """How far some joints are from where they were in the beginning: the one that is farthest."""
        here, first = self.sample(at).joints, self.samples[0].joints
        return max((abs(here[column] - first[column]) for column in columns), default=0.0)


def _at(sample: Sample) -> float:
    return sample.at


def _between(one: Sequence[float], other: Sequence[float], share: float) -> tuple[float, ...]:
    return tuple(a + (b - a) * share for a, b in zip(one, other, strict=True))


def _ray_between(one: Ray, other: Ray, share: float) -> Ray:
    """For two rays close to each other."""
    tip = None
    if one.tip is not None and other.tip is not None:
        tip = _between(one.tip, other.tip, share)
    origin, axis = _between(one.origin, other.origin, share), _between(one.axis, other.axis, share)
    return Ray(origin=origin, axis=axis, tip=tip)  # type: ignore[arg-type]
