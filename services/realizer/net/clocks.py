"""Clocks of the places with a delay: each runs from a measured instant, and can be stopped and let go on."""

from collections.abc import Callable, Mapping

from engage_hri.schemas.units import Seconds
from engage_hri.services.requests.deadlines import Deadlines


class Clocks:
    """The time at which the token in each place will be ripe, for tokens that are not."""

    def __init__(self) -> None:
        self._due: Deadlines[int] = Deadlines(int)
        self._left: dict[int, Seconds] = {}

    @property
    def stopped(self) -> Mapping[int, Seconds]:
        """Places whose clocks are stopped, with the seconds that are left."""
        return self._left

    @property
    def next(self) -> Seconds | None:
        """Time at which the next token is ripe; None: no clock runs."""
        return self._due.earliest

    def set(self, place: int, at: Seconds, now: Seconds, *, is_stopped: bool) -> None:
        """Let the token in `place` be ripe at `at`; later by as long as the clock is stopped, from `now` on."""
        if is_stopped:
            self._left[place] = at - now
        else:
            self._due.set(place, at)

    def ripe(self, now: Seconds) -> tuple[int, Seconds] | None:
        """Remove the first token that is ripe by `now`; returns its place, and since when. None: there is none."""
        at = self._due.earliest
        if at is None or at > now or (place := self._due.due(now)) is None:
            return None
        return place, at

    def stop(self, is_held: Callable[[int], bool], now: Seconds) -> dict[int, Seconds]:
        """Stop the clocks of the places that are held now, and let all others run.

        Returns the places whose clocks go on, each with the time at which its token is ripe now.
        """
        for place in [each for each in self._due if is_held(each)]:
            at = self._due[place]
            assert at is not None
            self._due.clear(place)
            self._left[place] = at - now
        going_on = {place: now + left for place, left in self._left.items() if not is_held(place)}
        for place, at in going_on.items():
            del self._left[place]
            self.set(place, at, now, is_stopped=False)
        return going_on
