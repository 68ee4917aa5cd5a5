"""Is a person there? Faces get lost and found again, and reports of it may come late or twice."""

from engage_hri.schemas.units import Seconds

NEVER: Seconds = float("-inf")


class Presence:
    """Of one person. grace: a face that is lost for less has not gone."""

    def __init__(self, grace: Seconds) -> None:
        self.here = True
        self.told = False
        """Perception has said that the person is there, and will say when that is over."""
        self._grace = grace
        self._lost_at: Seconds | None = None
        self._found_last = self._seen_last = self._lost_last = self.left_at = NEVER

    @property
    def deadline(self) -> Seconds | None:
        """When the person will have gone, unless it is seen again; then `leave`."""
        return None if self._lost_at is None else self._lost_at + self._grace

    def seen(self, at: Seconds) -> bool:
        """There is an observation of the person, so it is there; False if that is from before it left."""
        if at < self.left_at:
            return False
        self._seen_last = max(self._seen_last, at)
        if self._lost_at is None or at >= self._lost_at:
            self.here, self._lost_at = True, None
        return True

    def found(self, at: Seconds) -> None:
        if at > self._found_last:
            self._found_last = at
            self.told = self.seen(at) or self.told

    def lost(self, at: Seconds) -> None:
        """The face is lost. Nothing new if that was known, or if the person has been seen since."""
        if at < self._seen_last or at <= self._lost_last:
            return
        self._lost_last = at
        if self.here and self._lost_at is None:
            self._lost_at = at

    def leave(self) -> Seconds:
        """The person has gone; when it was last there."""
        assert self._lost_at is not None
        self.here, self.told, self.left_at, self._lost_at = False, False, self._lost_at, None
        return self.left_at

    def vanish(self, at: Seconds) -> None:
        """Nobody has told of the person since `at`: it has gone then, and is to `leave`."""
        self._lost_at = at
