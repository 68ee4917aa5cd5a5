"""What recognition knows besides the events: where everybody looks, who speaks, what is on the table."""

from typing import NamedTuple

from msgspec import Struct

from engage_hri.schemas.attention import Claim
from engage_hri.schemas.units import Probability, Seconds
from engage_hri.schemas.world import World
from engage_hri.services.recognition.config import GazeResolution

SAME_INSTANT: Seconds = 0.001
"""A look that ends and begins again at the same target within this has not been interrupted."""


class Covering(NamedTuple):
    """A person's hand hides a piece, and may be moving it. left: it has gone on, maybe with the piece."""

    actor: str
    piece: str
    left: bool


class Covered(Struct, frozen=True):
    """All pieces under hands: an observation, from raw perception alone."""

    by: frozenset[Covering]


class GazeState(Struct):
    """Where an actor looks, and since when. ended: it has looked away at that instant, unless it is still there."""

    targets: tuple[str, ...] = ()
    since: Seconds = 0.0
    ended: Seconds | None = None
    confidence: Probability = 1.0
    spent: bool = False
    """This look answers the robot, or has directed it already: it directs nothing (any more)."""

    def begin(self, targets: tuple[str, ...], at: Seconds, confidence: Probability = 1.0) -> bool:
        """A look at `targets`; True if that is a change. What is older than the present look is ignored."""
        if at < self.since:
            return False
        if targets == self.targets and (self.ended is None or at - self.ended <= SAME_INSTANT):
            self.ended = None
            return False
        self.targets, self.since, self.ended, self.spent = targets, at, None, False
        self.confidence = confidence
        return True

    def end(self, targets: tuple[str, ...], at: Seconds) -> None:
        """The end of the look at `targets`: takes effect only if it does not begin again at once."""
        if self.targets and targets in ((), self.targets) and at >= self.since:
            self.ended = at

    @property
    def deadline(self) -> Seconds | None:
        return None if self.ended is None else self.ended + SAME_INSTANT

    def expire(self) -> Seconds:
        """The look is over; when it was."""
        assert self.ended is not None
        at = self.ended
        self.targets, self.since, self.ended, self.spent = (), at, None, False
        return at


class SessionScene:
    """The robot and the world, shared by all persons of a session."""

    def __init__(self, robot: str, resolution: GazeResolution) -> None:
        self.robot = robot
        self.resolution = resolution
        self.gaze = GazeState()
        self.robot_speaks_since: Seconds | None = None
        self.head_owner = Claim(kind="none", priority=0)
        self.people_in_world: frozenset[str] = frozenset()
        self.covered = Covered(frozenset())
        self.acting: set[str] = set()
        """People with a manipulation in hand."""
        self._objects: set[str] = set()
        self._surfaces: set[str] = {"table"}
        self._others: dict[str, Seconds] = {}
        """People and hands that have been seen, and when last; the longest ago first."""
        self._speakers: set[str] = set()
        self.speech = 0
        """Counts how often somebody has begun or ended to speak."""
        self._fell_silent: list[tuple[Seconds, str]] = []
        """The two people who fell silent last, for whoever asks is one of them at most."""

    def see(self, world: World, at: Seconds) -> None:
        """Objects once seen stay known: a covered piece has not gone (thesis 5.4.2)."""
        self._objects.update(entity.id for entity in world.objects)
        self._surfaces.update(entity.id for entity in world.entities if entity.kind == "surface")
        for entity in world.entities:
            if entity.kind in ("person", "hand"):
                self._others.pop(entity.id, None)
                self._others[entity.id] = at
        self.people_in_world = frozenset(person.id for person in world.people) - {self.robot}

    def forget_others(self, before: Seconds) -> None:
        """Forget the people and hands that nobody has seen since."""
        while self._others and (oldest := next(iter(self._others))) and self._others[oldest] < before:
            del self._others[oldest]

    def speaks(self, actor: str) -> None:
        self._speakers.add(actor)
        self.speech += 1

    def falls_silent(self, actor: str, at: Seconds) -> None:
        if actor in self._speakers:
            self._speakers.discard(actor)
            others = [one for one in self._fell_silent if one[1] != actor]
            self._fell_silent = sorted((*others, (at, actor)))[-2:]
            self.speech += 1

    def stops(self, actor: str, at: Seconds) -> None:
        """A person has gone, or is not followed any longer."""
        self.acting.discard(actor)
        self.falls_silent(actor, at)

    def others_silent_since(self, actor: str) -> Seconds | None:
        """Since when nobody but `actor` speaks; None while somebody does."""
        if self._speakers - {actor}:
            return None
        return max((at for at, other in self._fell_silent if other != actor), default=float("-inf"))

    def knows(self, entity: str) -> bool:
        """Has it ever been seen? Without any world nobody can tell, so yes."""
        return not self._objects or entity in self._objects or self._is_no_object(entity)

    def _is_no_object(self, entity: str) -> bool:
        return entity in self._surfaces or entity in self._others

    def is_object(self, entity: str) -> bool:
        if entity in self._objects:
            return True
        return not self._objects and entity != self.robot and not self._is_no_object(entity)

    def person_looks_at(self, gaze: GazeState, objects: tuple[str, ...]) -> bool:
        """Does a person's look count as one at `objects`? At resolution `table` anything on the table will do."""
        if any(target in objects for target in gaze.targets):
            return True
        if self.resolution == "object":
            return False
        on_table = any(target in self._surfaces or self.is_object(target) for target in gaze.targets)
        return on_table and any(map(self.is_object, objects))

    def goes_with_hand(self, actor: str, targets: tuple[str, ...]) -> bool:
        """Does a look at these accompany the person's own hand, that may be moving what it hides?"""
        return any(one.actor == actor and (one.left or one.piece in targets) for one in self.covered.by)

    def robot_looks_at(self, entities: tuple[str, ...]) -> bool:
        return any(target in entities for target in self.gaze.targets)

    def robot_since(self, entities: tuple[str, ...]) -> Seconds | None:
        """Since when the robot looks at one of these; None if it does not."""
        return self.gaze.since if self.robot_looks_at(entities) else None

    def fragment_looks_elsewhere(self, entities: tuple[str, ...]) -> bool:
        """A fragment's own gaze holds the head, and not for one of these."""
        return self.head_owner.kind == "fragment" and self.head_owner.target not in entities
