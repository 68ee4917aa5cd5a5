"""Pieces on the table, and hands that move them: smooth movements as functions of time.

Pure: `now` is an argument, and time must not go backward. A movement never jumps: position and velocity are
continuous, as the hands of people are (minimum jerk).
"""

import math
from typing import Literal

import msgspec
from msgspec import Struct

from engage_hri.schemas.tables import PiecePose
from engage_hri.schemas.units import Meters, Seconds, Vector, between
from engage_hri.schemas.world import Entity
from engage_hri.services.tangram.table import TangramTable

HAND_SPEED: float = 0.45
"""Mean speed of a hand over a movement, in m/s. Unhurried reaching at a table is about 0.4..0.8 m/s."""
SHORTEST_MOVEMENT: Seconds = 0.6
"""Least time of a hand's movement: a short one is not quicker. Ours."""
HandSide = Literal["left", "right"]
LIFT: Meters = 0.03
"""Height above the table's top of a hand that holds a piece."""


class Movement(Struct, frozen=True, kw_only=True):
    """Movement of a hand from one point to another, perhaps with a piece, which turns on the way."""

    start: Vector
    end: Vector
    since: Seconds
    until: Seconds
    piece: str = ""
    yaw_start: float = 0.0
    yaw_end: float = 0.0

    def progress(self, now: Seconds) -> float:
        """Share of the way that is done, 0..1."""
        return minimum_jerk((now - self.since) / (self.until - self.since))

    def position(self, now: Seconds) -> Vector:
        done = self.progress(now)
        return between(self.start, self.end, done)

    def velocity(self, now: Seconds) -> Vector:
        duration = self.until - self.since
        part = (now - self.since) / duration
        if not 0.0 < part < 1.0:
            return (0.0, 0.0, 0.0)
        rate = 30.0 * part**2 * (1.0 - part) ** 2 / duration
        return tuple(rate * (end - start) for start, end in zip(self.start, self.end, strict=True))  # type: ignore[return-value]


class PieceRested(Struct, frozen=True):
    """A piece came to rest at `at`."""

    piece: str
    at: Seconds


class Table:
    """The pieces and a person's hands. Each hand makes one movement at a time; the next begins when it has ended."""

    def __init__(
        self, layout: TangramTable, *, hand_speed: float = HAND_SPEED, shortest_movement: Seconds = SHORTEST_MOVEMENT
    ) -> None:
        self._hand_speed = hand_speed
        self._shortest = shortest_movement
        self.layout = layout
        self.seated = False
        self._poses: dict[str, PiecePose] = {piece.id: piece.start for piece in layout.pieces}
        self._rest: dict[HandSide, Vector] = {"left": layout.person.left_hand, "right": layout.person.right_hand}
        self._hands: dict[HandSide, Vector] = dict(self._rest)
        self._moving: dict[HandSide, Movement] = {}

    # -- movements ----------------------------------------------------------------------------------------------

    def reach(self, piece: str, now: Seconds) -> Seconds:
        """Move the nearer hand to the piece. Returns the time at which it is there."""
        x, y, _ = self.piece(piece, now).position
        return self._move(self._hand_for(piece, now), (x, y, self._holding_height), now)

    def carry(self, piece: str, pose: PiecePose, now: Seconds, fits: Seconds = 0.0) -> Seconds:
        """Take the piece to `pose`, with the nearer hand. Returns the time at which it lies there.

        fits: time that it takes longer than the way.
        """
        entity = self.piece(piece, now)
        x, y, _ = entity.position
        hand = self._hand_for(piece, now)
        self._hands[hand] = (x, y, self._holding_height)
        turn = math.remainder(math.radians(pose.yaw) - entity.yaw, math.tau)
        end = (pose.x, pose.y, self._holding_height)
        return self._move(hand, end, now, piece=piece, yaw=entity.yaw, turn=turn, longer=fits)

    def withdraw(self, now: Seconds) -> Seconds:
        """Take both hands back to the lap. Returns the time at which they are there."""
        return max(self._move(hand, rest, now) for hand, rest in self._rest.items())

    def _move(
        self, hand: HandSide, end: Vector, now: Seconds, *, piece: str = "", yaw: float = 0.0, turn: float = 0.0,
        longer: Seconds = 0.0,
    ) -> Seconds:  # fmt: skip
        """Begin a movement. Returns the time at which it ends. longer: than at the hand's speed."""
        start = self.hand(hand, now)
        until = now + max(self._shortest, math.dist(start, end) / self._hand_speed) + longer
        self._moving[hand] = Movement(
            start=start, end=end, since=now, until=until, piece=piece, yaw_start=yaw, yaw_end=yaw + turn
        )
        return until

    @property
    def _holding_height(self) -> Meters:
        return self.layout.surface.center[2] + LIFT

    def _hand_for(self, piece: str, now: Seconds) -> HandSide:
        x, y, z = self.piece(piece, now).position
        hands: tuple[HandSide, HandSide] = ("right", "left")
        return min(hands, key=lambda hand: math.dist(self.hand(hand, now), (x, y, z)))

    # -- time ---------------------------------------------------------------------------------------------------

    @property
    def moving(self) -> bool:
        return bool(self._moving)

    @property
    def carrying(self) -> bool:
        """True while a piece is on its way."""
        return any(movement.piece for movement in self._moving.values())

    @property
    def deadline(self) -> Seconds | None:
        """Time at which the next movement ends."""
        return min((movement.until for movement in self._moving.values()), default=None)

    def settle(self, now: Seconds) -> list[PieceRested]:
        """End the movements that are over by `now`. Returns the pieces that came to rest."""
        rested = []
        for hand, movement in list(self._moving.items()):
            if movement.until <= now:
                del self._moving[hand]
                self._hands[hand] = movement.end
                if movement.piece:
                    x, y, _ = movement.end
                    yaw = math.degrees(math.remainder(movement.yaw_end, math.tau))
                    self._poses[movement.piece] = PiecePose(x, y, yaw)
                    rested.append(PieceRested(movement.piece, movement.until))
        return rested

    # -- positions ----------------------------------------------------------------------------------------------

    def hand(self, hand: HandSide, now: Seconds) -> Vector:
        movement = self._moving.get(hand)
        return movement.position(now) if movement else self._hands[hand]

    def piece(self, id: str, now: Seconds) -> Entity:
        """The piece where it is at `now`. Raises KeyError for an unknown id."""
        piece = self.layout.piece(id)
        for movement in self._moving.values():
            if movement.piece == id:
                x, y, _ = movement.position(now)
                yaw = movement.yaw_start + movement.progress(now) * (movement.yaw_end - movement.yaw_start)
                lying = self.layout.lying(piece, PiecePose(x, y, math.degrees(yaw)))
                return msgspec.structs.replace(lying, velocity=movement.velocity(now))
        return self.layout.lying(piece, self._poses[id])

    def pieces(self, now: Seconds) -> tuple[Entity, ...]:
        return tuple(self.piece(piece.id, now) for piece in self.layout.pieces)

    def entities(self, now: Seconds) -> tuple[Entity, ...]:
        """All entities to be seen: table and pieces, and the person while sitting there."""
        surface, person = self.layout.surface, self.layout.person
        top = Entity(id=surface.id, kind="surface", position=surface.center, footprint=surface.footprint)
        seen = (top, *self.pieces(now))
        if not self.seated:
            return seen
        hands = tuple(
            Entity(
                id=f"{person.id}-{side}-hand",
                kind="hand",
                owner=person.id,
                position=self.hand(side, now),
                velocity=movement.velocity(now) if (movement := self._moving.get(side)) else (0.0, 0.0, 0.0),
            )
            for side in self._rest
        )
        return (*seen, Entity(id=person.id, kind="person", position=person.face), *hands)


def minimum_jerk(part: float) -> float:
    """Share of the way that is done, 0..1, after `part` of the time: people move like this."""
    part = min(1.0, max(0.0, part))
    return part**3 * (10.0 - 15.0 * part + 6.0 * part**2)
