"""Statistics and engagement by their definitions, from a complete log of connection events: slow, and kept nothing.

Written without a look at how recognition does it; the tests of random streams compare the two.
"""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import msgspec

from engage_hri.schemas.behaviors import EVENT_KINDS
from engage_hri.schemas.recognition import ConnectionEvent, KindStatistics, WindowStatistics
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.statistics.engagement import ENOUGH_EVENTS
from tests.recognition.observations import ROBOT

Life = list[ConnectionEvent]


def lives(log: Sequence[ConnectionEvent], actor: str) -> list[Life]:
    """All changes of each event that `actor` takes part in (empty: of every event)."""
    found: dict[str, Life] = {}
    for change in log:
        if actor in ("", change.initiator, change.responder):
            found.setdefault(change.id, []).append(change)
    return list(found.values())


def of_window(lives: list[Life], now: Seconds, window: Seconds) -> list[Life]:
    return [life for life in lives if life[0].started.seconds + window > now]


def started(life: Life) -> Seconds:
    return life[0].started.seconds


def statistics(lives: list[Life]) -> WindowStatistics:
    """Table 2.1 of these events."""
    starts = sorted(map(started, lives))
    own = sorted(started(life) for life in lives if life[0].cause != "maintenance")
    gaps = [later - earlier for earlier, later in pairwise(starts)]
    return WindowStatistics(
        kinds=tuple(_of_kind(kind, [life for life in lives if life[0].kind == kind]) for kind in EVENT_KINDS),
        mtbce=mean(gaps), mtbce_without_maintenance=mean([b - a for a, b in pairwise(own)]),
        max_gap=max(gaps, default=None), events=len(starts),
        last_start=Stamp("loop", starts[-1]) if starts else None,
        last_start_without_maintenance=Stamp("loop", own[-1]) if own else None,
    )  # fmt: skip


def _of_kind(kind: Any, lives: list[Life]) -> KindStatistics:
    decided = [change for life in lives for change in life]
    good = [change for change in decided if change.state == "succeeded"]
    bad = [change for change in decided if change.state == "failed" and not change.optional]
    delays = [change.delay for change in good if change.delay is not None]
    failed = [change.at.seconds - change.started.seconds for change in bad]
    return KindStatistics(
        kind=kind, count=len(lives), succeeded=len(good), failed=len(bad),
        delay_min=min(delays, default=None), delay_mean=mean(delays), delay_max=max(delays, default=None),
        failure_rate=len(bad) / (len(good) + len(bad)) if good or bad else None,
        failed_delay_min=min(failed, default=None), failed_delay_mean=mean(failed),
        failed_delay_max=max(failed, default=None),
    )  # fmt: skip


def mean(values: Sequence[float]) -> float | None:
    return math.fsum(values) / len(values) if values else None


def engagement(lives: list[Life], now: Seconds, busy_until: Seconds, config: RecognitionConfig) -> float | None:
    """Pace times quality at `now`, of somebody who was last busy until `busy_until`, and is not now."""
    if not lives:
        return None
    starts = sorted(map(started, lives))
    recent = sorted(map(started, of_window(lives, now, config.window)))
    usual = config.reference_mtbce
    if len(starts) >= ENOUGH_EVENTS and starts[-1] > starts[0]:
        usual = (starts[-1] - starts[0]) / (len(starts) - 1)
    longest = max(0.0, now - max(starts[-1], busy_until))
    if len(recent) > 1 and now >= busy_until + config.window:
        longest = max(longest, (recent[-1] - recent[0]) / (len(recent) - 1))
    judged = [
        change.state
        for life in of_window(lives, now, config.window)
        for change in life
        if not change.optional
        and (change.state == "succeeded" or (change.state == "failed" and change.initiator == ROBOT))
    ]
    quality = judged.count("succeeded") / len(judged) if judged else 1.0
    return min(1.0, usual / longest if longest else 1.0) * quality


def alike(one: Any, other: Any) -> bool:
    """The same, but for rounding."""
    if isinstance(one, float) and isinstance(other, float):
        return math.isclose(one, other, rel_tol=1e-9, abs_tol=1e-9)
    if isinstance(one, msgspec.Struct):
        one, other = msgspec.structs.asdict(one), msgspec.structs.asdict(other)
        return one.keys() == other.keys() and all(alike(one[name], other[name]) for name in one)
    if isinstance(one, tuple):
        return len(one) == len(other) and all(map(alike, one, other))
    return bool(one == other)
