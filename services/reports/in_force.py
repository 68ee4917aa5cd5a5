"""States that hold as long as who told them is there: the world, and the condition of a study. Pure.

What a crash takes away is unknown, as at start. A world is over a grace after who told it has vanished: a link may be
back. A condition is in force as long as the life of generation that was told of it: a restarted generation has none.
"""

from typing import Self

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.fragments import StudyCondition
from engage_hri.schemas.messages import Message
from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import World
from engage_hri.services.reports.same_people import PeopleNames


class Publisher:
    """The participant that published a state last. is_there: it has published, and has not gone since.

    name: its; empty: not known. It is there again when the same life comes back, as after a cut. A new life has to
    publish first.
    """

    def __init__(self) -> None:
        self.is_there = False
        self.name = ""
        self._run = ""

    def published(self, name: str, run: str) -> None:
        """Take the news that a participant has published the state. Empty: who or which life it is, nothing tells."""
        self.is_there, self.name, self._run = True, name, run

    def feed(self, message: Message) -> bool:
        """Take any other message: only those about presence count. Returns True if it is there again."""
        before = self.is_there
        match message:
            case PeerGone(participant=name) if name == self.name:
                self.is_there = False
            case PeerAlive(participant=name, run=run) if name == self.name:
                self.is_there = run == self._run
        return self.is_there and not before


NOTHING = World(entities=())


class WorldReport:
    """The last report of the world. grace: time for which it holds after its publisher has gone.

    Each person is in it once, by the id by which recognition tells of them (`same_people.py`).
    What is taken and what passes return the world that there is from now on, or None: it is as it was.
    """

    def __init__(self, grace: Seconds) -> None:
        self._grace = grace
        self._publisher = Publisher()
        self._last: World | None = None
        """As it was published."""
        self._names = PeopleNames()
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
            return self._names.named(message)
        if self._names.take(message):
            return None if self._is_over else self._named_last
        was_there = self._publisher.is_there
        if self._publisher.feed(message):  # type: ignore[arg-type]  # any other message tells it nothing
            was_over, self._is_over, self._over_at = self._is_over, False, None
            return self._named_last if was_over else world
        if was_there and not self._publisher.is_there and isinstance(message, PeerGone):
            self._over_at = now + self._grace
        return world

    @property
    def _named_last(self) -> World | None:
        return None if self._last is None else self._names.named(self._last)

    def advance(self, now: Seconds) -> World | None:
        """Let time pass."""
        if self._over_at is None or now < self._over_at:
            return None
        self._over_at, self._is_over = None, True
        return NOTHING


class InForce(Struct, frozen=True, kw_only=True):
    """Condition in force. told: the condition; None: generation is not there, or has not told of one.

    lost: the one that somebody had set, and that went with its generation; None once somebody has set another.
    life: of the generation that was there last; empty: unknown.
    """

    told: StudyCondition | None = None
    lost: StudyCondition | None = None
    life: str = ""

    @property
    def missed(self) -> StudyCondition | None:
        """The lost condition, if something counted under it, or the robot did less for it."""
        return self.lost if self.lost is not None and (self.lost.name or self.lost.speech_only) else None

    def after(self, message: Message) -> Self:
        """Take a message; most change nothing."""
        match message:
            case StudyCondition(by=by):
                return replace(self, told=message, lost=None if by else self._left)
            case PeerGone(participant="generation"):
                return replace(self, told=None, lost=self._left)
            case PeerAlive(participant="generation", run=run):
                is_back = self.told is None and bool(run) and run == self.life
                known = replace(self, told=self.lost, lost=None) if is_back else self
                return replace(known, life=run)
        return self

    @property
    def _left(self) -> StudyCondition | None:
        """Condition that is lost if this generation has gone."""
        return self.told if self.told is not None and self.told.by else self.lost
