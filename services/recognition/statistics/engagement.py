"""Estimate of engagement: contact and pace, with reasons, and a level that does not flutter. Thesis 2.3.

Contact is what goes on: the share of the last seconds in which something was between the two (`ContactShare`). Pace
is what begins: the usual time between connection events over the recent one, or over the silence that goes on if
that is longer; times the share of recent events that did not fail. What the robot has not answered is no failure of
the person's (decision 0198). Silence is only that in which there is no contact either: who tells the robot a story
begins nothing for a minute. While the person is busy with a task nothing is concluded from silence: that explains
the 70 s gap of the canapé study. The estimate is the mean of the two, or the one that is known.

The levels are those of ROS4HRI: at the first sign of contact a person is `engaging`, and `engaged` only if they are
still, or again, in contact a while later; who drifts away is `disengaging` first.
"""

from math import exp, inf
from typing import Literal, NamedTuple

from engage_hri.schemas.recognition import EngagementLevel, Statistics
from engage_hri.schemas.units import Probability, Seconds
from engage_hri.services.recognition.config import HYSTERESIS, RecognitionConfig
from engage_hri.services.recognition.statistics.tally import EventTally

CONTACT_MEMORY: Seconds = 8.0
"""Time constant of the mean. Ours."""
SETTLED: Probability = 0.01
"""Difference from what goes on now below which the share counts as the same."""


class ContactShare:
    """Share of the last seconds in which something went on between one person and the robot: an exponential mean.

    Who looks at the robot, speaks to it, or looks with it at a thing is in contact with it, though no event begins: a
    story of a minute is one event. So the pace of beginnings alone would call the most engaged of all people
    disengaged, and somebody who only glances back now and then engaged. What went on `CONTACT_MEMORY` seconds ago
    counts for a third of what goes on now.
    """

    def __init__(self) -> None:
        self.now: Probability | None = None
        """How much of a contact there is now; None: nothing has told of it yet."""
        self._share: Probability = 0.0
        self._at: Seconds = -inf

    def change(self, now: Probability | None, at: Seconds) -> None:
        """Take how much of a contact there is from `at` on; None: that is not known any longer."""
        self._share = (now or 0.0) if self.now is None else self.share(at)
        self._at = max(at, self._at)
        self.now = now

    def resume(self, now: Probability | None, share: Probability, at: Seconds) -> None:
        """Go on from what was known at `at`."""
        self.now, self._share, self._at = now, share, at

    def share(self, at: Seconds) -> Probability:
        """Share of contact until `at`. It is 0 as long as nothing has told of contact."""
        if self.now is None:
            return 0.0
        return self.now + (self._share - self.now) * exp(-max(0.0, at - self._at) / CONTACT_MEMORY)

    def is_settled(self, at: Seconds) -> bool:
        """True if the share no longer changes by time alone."""
        return self.now is None or abs(self.share(at) - self.now) < SETTLED


LEVELS: tuple[EngagementLevel, ...] = ("unknown", "disengaged", "engaging", "disengaging", "engaged")
"""From the least engaged to the most."""
ENOUGH_EVENTS = 5
"""Number of connection events from which a person's own mean counts; at least 2, since one event has no time between
events. Ours."""
JUST_AFTER: Seconds = 0.001
"""Delay after the instant at which the estimate is on a threshold; then it has passed it."""
ENGAGES_AFTER: Seconds = 1.5
"""Time from the first sign of contact after which who is in contact is engaged: who only looks in passing has looked
away by then, and who comes can be greeted before. Ours."""
IN_CONTACT: Probability = 0.5
"""Contact from which on there is no silence."""
TOLD_AGAIN: Probability = 0.05
"""Change of an estimate by contact alone from which on it is told again."""
LOOK_AGAIN: Seconds = 1.0
"""Time after which the estimate is looked at again while it changes by itself."""


class EngagementEstimate(NamedTuple):
    value: Probability | None
    level: EngagementLevel
    reasons: tuple[str, ...]


UNKNOWN = EngagementEstimate(None, "unknown", ("no connection event yet, and nobody tells of looks",))


def pace(usual: Seconds, recent: Seconds | None, open: Seconds) -> Probability:
    """Pace: 1 while events come at least as fast as usual, falling towards 0 as they stay away."""
    longest = max(recent or 0.0, open)
    return 1.0 if longest <= usual else usual / longest


def quality(failed: int, judged: int) -> Probability:
    """Share of the decided events that did not fail; 1 while nothing has been decided."""
    return 1.0 - failed / judged if judged else 1.0


def next_level(
    level: EngagementLevel, value: Probability, config: RecognitionConfig, *, in_contact: bool, lasts: bool
) -> EngagementLevel:
    """Level of `value`; it changes only when the value has passed a threshold by the hysteresis.

    in_contact: the person is; nobody comes back by what the robot does. lasts: the contact of who is engaging has
    lasted; until then nobody becomes engaged.
    """
    margin = 0.0 if level == "unknown" else HYSTERESIS
    engaged_from = config.engaged_from + (-margin if level == "engaged" else margin)
    disengaged_below = config.disengaged_below + (margin if level == "disengaged" else -margin)
    comes = level == "engaged" or (level == "disengaging" and in_contact) or (level == "engaging" and lasts)
    if value >= engaged_from and comes:
        return "engaged"
    if value < disengaged_below or (level == "disengaged" and not in_contact):
        return "disengaged"
    return "disengaging" if level in ("engaged", "disengaging") else "engaging"


class Engagement:
    """Estimate for one actor (or all), from its tally. robot: its actor id."""

    def __init__(self, config: RecognitionConfig, tally: EventTally, robot: str) -> None:
        self.estimate = UNKNOWN
        self.busy = False
        self.contact = ContactShare()
        self._config = config
        self._tally = tally
        self._robot = robot
        self.busy_until: Seconds = -inf
        self.apart_since: Seconds = -inf
        """Time at which the last contact ended."""
        self.level_since: Seconds = -inf
        self._has_left = False

    def resume(self, former: Statistics) -> None:
        """Go on from what a former life has told: all that goes on now went on meanwhile."""
        self.estimate = EngagementEstimate(former.engagement, former.level, former.reasons)
        self.busy = former.busy
        self.contact.resume(former.contact.now, former.contact.share, former.at.seconds)
        self.busy_until, self.apart_since, self.level_since = (
            -inf if at is None else at.seconds for at in (former.busy_until, former.contact.ended, former.level_since)
        )

    def is_above(self, other: "Engagement") -> bool:
        """True if this person is more engaged. Who comes is less so than who drifts away: that one was engaged."""
        return LEVELS.index(self.estimate.level) > LEVELS.index(other.estimate.level)

    def touch(self, much: Probability | None, at: Seconds) -> None:
        """Take how much of a contact there is from `at` on; None: that is not known any longer."""
        if (self.contact.now or 0.0) >= IN_CONTACT > (much or 0.0):
            self.apart_since = at
        self.contact.change(much, at)

    def comes_or_leaves(self, at: Seconds, *, is_here: bool) -> None:
        """Take it that the person is here, or has left: who comes back begins anew with the contact of then."""
        self._has_left = not is_here
        if not is_here:
            self.touch(None, at)

    def update(self, now: Seconds, *, busy: bool) -> EngagementEstimate:
        """Update the estimate, and return it. busy: True freezes it as it was when the task began."""
        if self.busy and not busy:
            self.get_free(now)
        if not (self.busy and busy):
            before, self.estimate = self.estimate, self._estimate(now)
            if self.estimate.level != before.level:
                self.level_since = now
        if busy and not self.busy:
            reasons = ("busy with a task: estimate frozen", *self.estimate.reasons)
            self.estimate = self.estimate._replace(reasons=reasons)
        self.busy = busy
        return self.estimate

    def get_free(self, now: Seconds) -> None:
        """Take the end of the task. The estimate is the frozen one until it is updated."""
        self.busy, self.busy_until = False, now

    def news(self, now: Seconds) -> Literal["", "value", "level"]:
        """Change since it was told: of the level, or by contact alone of the value; "": neither."""
        if self.busy:
            return ""
        estimate, told = self._estimate(now), self.estimate
        if estimate.level != told.level:
            return "level"
        drifts = self.contact.now is not None and abs((estimate.value or 0.0) - (told.value or 0.0)) >= TOLD_AGAIN
        return "value" if drifts else ""

    def _estimate(self, now: Seconds) -> EngagementEstimate:
        if self._has_left:
            level = next_level(self.estimate.level, 0.0, self._config, in_contact=False, lasts=False)
            return EngagementEstimate(0.0, level, ("has left",))
        known: list[Probability] = []
        reasons: list[str] = []
        if self.contact.now is not None:
            known.append(self.contact.share(now))
            reasons.append(f"contact {known[-1]:.2f}: looks, talk and shared looks of the last {CONTACT_MEMORY:g} s")
        if self._tally.starts.last is not None:
            value, why = self._pace(now)
            known.append(value)
            reasons += why
        if not known:
            return UNKNOWN
        value = sum(known) / len(known)
        is_in_contact = self.contact.now is None or self.contact.now >= IN_CONTACT
        lasts = is_in_contact and now >= self.level_since + ENGAGES_AFTER
        level = next_level(self.estimate.level, value, self._config, in_contact=is_in_contact, lasts=lasts)
        return EngagementEstimate(value, level, tuple(reasons))

    def _pace(self, now: Seconds) -> tuple[Probability, tuple[str, str]]:
        """Pace times quality, and why."""
        usual, silent = self._usual, self._silence(now)
        window = self._tally.pace(now, self._robot)
        recent = window.mean if now >= self._recent_from else None
        failed, judged = window.failed, window.judged
        speed, good = pace(usual, recent, silent), quality(failed, judged)
        between = f"{recent:.1f} s between recent events" if recent is not None else "no recent pace"
        return speed * good, (
            f"pace {speed:.2f}: {between}, {silent:.1f} s of silence, usually {usual:.1f} s",
            f"quality {good:.2f}: {failed} of {judged} recent events failed",
        )

    def _silence(self, now: Seconds) -> Seconds:
        """Time since the last start, the end of the last task or contact, whichever was last; 0 in contact."""
        last = self._tally.starts.last
        if last is None or (self.contact.now or 0.0) >= IN_CONTACT:
            return 0.0
        return max(0.0, now - max(last, self.busy_until, self.apart_since))

    @property
    def _usual(self) -> Seconds:
        mean = self._tally.starts.mean_difference
        if mean is None or mean <= 0.0 or self._tally.starts.count < ENOUGH_EVENTS:
            return self._config.reference_mtbce
        return mean

    @property
    def _recent_from(self) -> Seconds:
        """Time from which on the recent window holds no time in which the actor was busy."""
        return self.busy_until + self._config.window

    def next_change(self, now: Seconds) -> Seconds | None:
        """Time at which to look whether the level has changed by itself; None: it does not.

        The tally's own `next_change` may come first.
        """
        if self.busy or self.estimate.level == "unknown":
            return None
        changes = [self._recent_from]
        if self.estimate.level == "engaging":
            changes.append(self.level_since + ENGAGES_AFTER)
        if self.contact.now is None:
            changes += self._level_falls(now)
        elif not self.contact.is_settled(now) or not (self.contact.now >= IN_CONTACT or self._is_low):
            changes.append(now + LOOK_AGAIN)
        return min((at for at in changes if at > now), default=None)

    @property
    def _is_low(self) -> bool:
        """True if silence changes the level no more."""
        return self.estimate.level == "disengaged" or self._tally.starts.last is None

    def _level_falls(self, now: Seconds) -> list[Seconds]:
        """Time at which silence alone has passed the next threshold, where pace is all that is known."""
        level = self.estimate.level
        threshold = (self._config.engaged_from if level == "engaged" else self._config.disengaged_below) - HYSTERESIS
        window = self._tally.pace(now, self._robot)
        good = quality(window.failed, window.judged)
        if level == "disengaged" or threshold <= 0.0 or good <= threshold:
            return []
        return [now - self._silence(now) + self._usual * good / threshold + JUST_AFTER]
