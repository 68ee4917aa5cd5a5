"""The world as it was told last, which is over a grace after who told it has vanished. Pure."""

from engage_hri.schemas.presence import PeerGone
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import World
from engage_hri.services.reports.publisher import Publisher

NOTHING = World(entities=())


class WorldReport:
    """The last report of the world. grace: time for which it holds after its publisher has gone.

    What is taken and what passes return the world that there is from now on, or None: it is as it was.
    """

    def __init__(self, grace: Seconds) -> None:
        self._grace = grace
        self._publisher = Publisher()
        self._last: World | None = None
        self._over_at: Seconds | None = None
        self._is_over = False

    @property
    def deadline(self) -> Seconds | None:
        """Time at which `advance` has something to tell."""
        return self._over_at

    def take(self, message: object, source: str, life: str, now: Seconds) -> World | None:
        """Take any message. The same life that comes back goes on with what it told."""
        world = self.advance(now)
        if isinstance(message, World):
            self._publisher.published(source, life)
            self._last, self._over_at, self._is_over = message, None, False
            return message
        was_there = self._publisher.is_there
        if self._publisher.feed(message):  # type: ignore[arg-type]  # any other message tells it nothing
            was_over, self._is_over, self._over_at = self._is_over, False, None
            return self._last if was_over else world
        if was_there and not self._publisher.is_there and isinstance(message, PeerGone):
            self._over_at = now + self._grace
        return world

    def advance(self, now: Seconds) -> World | None:
        """Let time pass."""
        if self._over_at is None or now < self._over_at:
            return None
        self._over_at, self._is_over = None, True
        return NOTHING
