"""A person at the table, with the pieces: exact messages of all that happens.

Pure. A look is reported while the person sits at the table, `act` while a piece really moves. `cameras.py` turns them
into messages of perception. What the robot points at is what its arms really are on, as people see them (`SeenArms`):
it may believe them elsewhere.
"""

import math
from collections.abc import Callable, Iterable, Iterator

from engage_hri.schemas.body import Ray, RobotSeen
from engage_hri.schemas.messages import Message
from engage_hri.schemas.tables import PiecePose, overlap, poses_touching
from engage_hri.schemas.units import Seconds, Stamp, Vector
from engage_hri.schemas.world import Entity, World
from engage_hri.services.client.people.actions import PersonActions
from engage_hri.services.simulation.human import (
    FACE,
    Act,
    Ears,
    Grab,
    Human,
    Lay,
    Leave,
    LookAt,
    Pause,
    Sit,
    SpokenWords,
    Start,
    Stop,
    Understood,
    Withdraw,
)
from engage_hri.services.tangram.people.table import Table

STILL = math.radians(0.3)
"""Radians that a forearm that is on its target turns from one message to the next at most."""
PATIENCE: Seconds = 2.0
"""Longest time for which people wait for an arm to come to rest."""


class SeenArms:
    """The forearms, as they were last seen. Without a message they are where the robot says."""

    def __init__(self) -> None:
        self._rays: tuple[Ray, ...] = ()
        self._turned = 0.0
        self._waiting_since: Seconds | None = None

    def see(self, seen: RobotSeen) -> None:
        rays = tuple(ray for ray in (seen.left_arm, seen.right_arm) if ray is not None)
        pairs = zip(rays, self._rays, strict=False)
        self._turned = max((_between(one.axis, other.axis) for one, other in pairs), default=0.0)
        self._rays = rays

    def are_moving(self, now: Seconds) -> bool:
        """True while it cannot be told yet what an arm points at."""
        if not self._rays or self._turned < STILL:
            self._waiting_since = None
            return False
        since = self._waiting_since = now if self._waiting_since is None else self._waiting_since
        return now < since + PATIENCE

    def meant(self, target: str, things: Iterable[Entity]) -> str:
        """Id of the thing that seems to be pointed at, while the robot means `target`."""
        places = {thing.id: thing.position for thing in things}
        if not self._rays or target not in places:
            return target
        arm = min(self._rays, key=lambda ray: _off(ray, places[target]))
        return min(places, key=lambda id: _off(arm, places[id]))


def _off(ray: Ray, place: Vector) -> float:
    return _between(ray.axis, tuple(there - here for here, there in zip(ray.origin, place, strict=True)))  # type: ignore[arg-type]


def _between(one: Vector, other: Vector) -> float:
    dot, lengths = sum(a * b for a, b in zip(one, other, strict=True)), math.hypot(*one) * math.hypot(*other)
    return math.acos(max(-1.0, min(1.0, dot / lengths))) if lengths else math.pi


Stamper = Callable[[Seconds], Stamp]


class PersonAtTable:
    """A person at the table. `feed` takes messages about the robot; `advance` yields what has happened by `now`.

    frame: seconds between two reports of the world while something moves. life: of the program that tells of the
    person.
    """

    def __init__(
        self, human: Human, table: Table, *, robot: str, frame: Seconds, stamp: Stamper, life: str = ""
    ) -> None:
        self._human = human
        self._table = table
        self._robot = robot
        self._frame = frame
        self._stamp = stamp
        self._actions = PersonActions(table.layout.person.id)
        self._words = SpokenWords(table.layout.person.id, life)
        self._arms, self._ears = SeenArms(), Ears()
        self._last_world: Seconds | None = None

    @property
    def deadline(self) -> Seconds | None:
        """Time at which `advance` has something to do; None: not before the robot does something."""
        times = [self._human.deadline, self._table.deadline]
        if self._table.moving and self._last_world is not None:
            times.append(self._last_world + self._frame)
        return min((time for time in times if time is not None), default=None)

    def enter(self, now: Seconds) -> None:
        self._human.enter(now)

    def feed(self, message: Message, now: Seconds) -> None:
        if isinstance(message, RobotSeen):
            self._arms.see(message)
        elif self._ears.hear(message):
            self._human.feed(message, now)

    def world(self, now: Seconds) -> World:
        self._last_world = now
        return World(entities=self._table.entities(now), at=self._stamp(now))

    def advance(self, now: Seconds) -> Iterator[Message]:
        """Yield the reports that are due: first the person's actions, then the world if it has changed."""
        changed = self._table.moving and self._last_world is not None and now >= self._last_world + self._frame
        for rested in self._table.settle(now):
            changed = True
            yield from self._actions.ends("act", (rested.piece,), self._stamp(rested.at))
        while acts := self._human.due(now):
            changed = changed or not isinstance(acts[0], LookAt | Pause | Start | Stop | Understood)
            yield from self._do(acts[0], acts[1:], now)
        if changed:
            yield self.world(now)

    def _do(self, act: Act, then: tuple[Act, ...], now: Seconds) -> Iterator[Message]:
        following = now
        # Before the speech: whoever waits for that knows then that its words will come.
        yield from self._words.does(act, self._stamp(now))
        match act:
            case LookAt(pointed=True) if self._arms.are_moving(now):
                self._human.schedule((act, *then), now + self._frame)
                return
            case LookAt(target=target, pointed=True):
                yield from self._looks_at(self._arms.meant(target, self._table.pieces(now)), now)
            case LookAt(target=target):
                yield from self._looks_at(self._robot if target == FACE else target, now)
            case Sit():
                self._table.seated = True
                yield from self._actions.comes(self._stamp(now))
            case Leave():
                self._table.seated = False
                yield from self._actions.leaves(self._stamp(now))
            case Grab() | Lay() if self._table.carrying:
                # The hands are busy with another piece: this act comes after it.
                self._human.schedule((act, *then), self._table.deadline or now)
                return
            case Grab(piece=piece):
                following = self._table.reach(piece, now)
            case Lay(piece=piece) as lay:
                if pose := self._place_for(lay, now):
                    following = self._table.carry(piece, pose, now, lay.fits)
                    yield from self._actions.begins("act", (piece,), self._stamp(now))
            case Withdraw():
                self._table.withdraw(now)
            case Pause(seconds=seconds):
                following = now + seconds
            case Start(action=action, target=target):
                yield from self._actions.begins(action, (target,) if target else (), self._stamp(now))
            case Stop(action=action, target=target):
                yield from self._actions.ends(action, (target,) if target else (), self._stamp(now))
        self._human.schedule(then, following)

    def _looks_at(self, target: str, now: Seconds) -> Iterator[Message]:
        yield from self._actions.looks((target,) if target else (), self._stamp(now))

    def _place_for(self, lay: Lay, now: Seconds) -> PiecePose | None:
        """First pose with room, or simply the first if none has room; None if no edges fit."""
        piece = self._table.piece(lay.piece, now)
        others = [other for other in self._table.pieces(now) if other.id != lay.piece]
        places = sorted(
            poses_touching(piece, self._table.piece(lay.landmark, now), lay.side), key=lambda pose: abs(pose.yaw)
        )
        return next(
            (pose for pose in places if self._has_room(lay.piece, pose, others)), places[0] if places else None
        )

    def _has_room(self, piece: str, pose: PiecePose, others: list[Entity]) -> bool:
        lying = self._table.layout.lying(self._table.layout.piece(piece), pose)
        return not any(overlap(lying, other) for other in others)
