"""Contact of one person with the robot: the share of the last seconds in which something went on between them. Pure.

Who looks at the robot, speaks to it, or looks with it at a thing is in contact with it, though no event begins: a
story of a minute is one event. So the pace of beginnings alone would call the most engaged of all people disengaged,
and somebody who only glances back now and then engaged. The share is an exponential mean; what went on
`CONTACT_MEMORY` seconds ago counts for a third of what goes on now.
"""

import math

from engage_hri.schemas.units import Probability, Seconds

CONTACT_MEMORY: Seconds = 8.0
"""Time constant of the mean. Ours."""
SETTLED: Probability = 0.01
"""Difference from what goes on now below which the share counts as the same."""


class ContactShare:
    """Share of contact of one person."""

    def __init__(self) -> None:
        self.now: Probability | None = None
        """How much of a contact there is now; None: nothing has told of it yet."""
        self._share: Probability = 0.0
        self._at: Seconds = -math.inf

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
        return self.now + (self._share - self.now) * math.exp(-max(0.0, at - self._at) / CONTACT_MEMORY)

    def is_settled(self, at: Seconds) -> bool:
        """True if the share no longer changes by time alone."""
        return self.now is None or abs(self.share(at) - self.now) < SETTLED
