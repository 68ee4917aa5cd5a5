"""Estimate of engagement: pace times quality, with reasons, and a level that does not flutter. Thesis 2.3.

Pace compares the usual time between connection events with the recent one, or with the interval that is still
open if that is longer. Quality is the share of recent events that did not fail. While the person is busy with a
task nothing is concluded from silence: that explains the 70 s gap of the canapé study.
"""

from typing import Literal, NamedTuple

from engage_hri.schemas.units import Probability, Seconds
from engage_hri.services.recognition.config import HYSTERESIS, RecognitionConfig
from engage_hri.services.recognition.statistics.tally import Tally

ENOUGH_EVENTS = 5
"""Number of connection events from which a person's own mean counts; at least 2, since one event has no time between
events. Ours."""
Level = Literal["engaged", "weakening", "disengaged", "unknown"]

JUST_AFTER: Seconds = 0.001
"""Delay after the instant at which the estimate is on a threshold; then it has passed it."""


class EngagementEstimate(NamedTuple):
    value: Probability | None
    level: Level
    reasons: tuple[str, ...]


UNKNOWN = EngagementEstimate(None, "unknown", ("no connection event yet",))


def pace(usual: Seconds, recent: Seconds | None, open: Seconds) -> Probability:
    """Pace: 1 while events come at least as fast as usual, falling towards 0 as they stay away."""
    longest = max(recent or 0.0, open)
    return 1.0 if longest <= usual else usual / longest


def quality(failed: int, judged: int) -> Probability:
    """Share of the decided events that did not fail; 1 while nothing has been decided."""
    return 1.0 - failed / judged if judged else 1.0


def next_level(level: Level, value: Probability, config: RecognitionConfig) -> Level:
    """Level of `value`; it changes only when the value has passed a threshold by the hysteresis."""
    margin = HYSTERESIS
    engaged_from = config.engaged_from + {"engaged": -margin, "unknown": 0.0}.get(level, margin)
    disengaged_below = config.disengaged_below + {"disengaged": margin, "unknown": 0.0}.get(level, -margin)
    if value >= engaged_from:
        return "engaged"
    return "disengaged" if value < disengaged_below else "weakening"


class Engagement:
    """Estimate for one actor (or all), from its tally."""

    def __init__(self, config: RecognitionConfig, tally: Tally) -> None:
        self.estimate = UNKNOWN
        self.busy = False
        self._config = config
        self._tally = tally
        self._busy_until: Seconds = float("-inf")

    def update(self, now: Seconds, *, busy: bool) -> EngagementEstimate:
        """Update the estimate, and return it. busy: True freezes it as it was when the task began."""
        if self.busy and not busy:
            self._busy_until = now
        if not (self.busy and busy) and self._tally.starts.last is not None:
            self.estimate = self._estimate(now, max(0.0, now - self._silent_since))
        if busy and not self.busy:
            reasons = ("busy with a task: estimate frozen", *self.estimate.reasons)
            self.estimate = self.estimate._replace(reasons=reasons)
        self.busy = busy
        return self.estimate

    @property
    def _silent_since(self) -> Seconds:
        """Time of the last start or of the end of the last task, whichever was later."""
        last = self._tally.starts.last
        return self._busy_until if last is None else max(last, self._busy_until)

    def _estimate(self, now: Seconds, open: Seconds) -> EngagementEstimate:
        usual = self._usual
        recent = self._tally.recent_mean(now) if now >= self._recent_from else None
        failed, judged = self._tally.judged(now)
        speed, good = pace(usual, recent, open), quality(failed, judged)
        value = speed * good
        between = f"{recent:.1f} s between recent events" if recent is not None else "no recent pace"
        return EngagementEstimate(
            value,
            next_level(self.estimate.level, value, self._config),
            (
                f"pace {speed:.2f}: {between}, {open:.1f} s since the last, usually {usual:.1f} s",
                f"quality {good:.2f}: {failed} of {judged} recent events failed",
            ),
        )

    @property
    def _usual(self) -> Seconds:
        mean = self._tally.starts.mean_difference
        if mean is None or mean <= 0.0 or self._tally.starts.count < ENOUGH_EVENTS:
            return self._config.reference_mtbce
        return mean

    @property
    def _recent_from(self) -> Seconds:
        """Time from which on the recent window holds no time in which the actor was busy."""
        return self._busy_until + self._config.window

    def next_change(self, now: Seconds) -> Seconds | None:
        """Time of the next change by silence alone that matters: the level falls, or recent pace counts again.

        None if there is none, or if the estimate is frozen. The tally's own `next_change` may come first.
        """
        if self.busy or self._tally.starts.last is None:
            return None
        changes = (self._recent_from, self._level_falls(now))
        return min((at for at in changes if at is not None and at > now), default=None)

    def _level_falls(self, now: Seconds) -> Seconds | None:
        """Time at which silence alone has passed the next threshold; None if it never does."""
        level = self.estimate.level
        if level not in ("engaged", "weakening"):
            return None
        threshold = self._config.engaged_from if level == "engaged" else self._config.disengaged_below
        threshold -= HYSTERESIS
        good = quality(*self._tally.judged(now))
        if threshold <= 0.0 or good <= threshold:
            return None
        return self._silent_since + self._usual * good / threshold + JUST_AFTER
