"""What lies on the table and how hands move it: smooth movements as functions of time.

Pure: `now` is an argument, and time must not go backward. A movement never jumps: position and velocity are
continuous, as the hands of people are (minimum jerk).
"""

import math
from typing import Literal

import msgspec
from msgspec import Struct

from engage_hri.schemas.units import Meters, Seconds, Vector
from engage_hri.schemas.world import Entity
from engage_hri.services.tangram.table import PiecePose, TangramTable

HandSide = Literal["left", "right"]
LIFT: Meters = 0.03
"""How high above the table's top the hand is that holds a piece."""


class Movement(Struct, frozen=True, kw_only=True):
    """A hand goes from one point to another, perhaps with a piece, which turns on the way."""

    hand: HandSide
    start: Vector
    end: Vector
    since: Seconds
    until: Seconds
    piece: str = ""
    yaw_start: float = 0.0
    yaw_end: float = 0.0

    def progress(self, now: Seconds) -> float:
        """0..1."""
        return minimum_jerk((now - self.since) / (self.until - self.since))

    def position(self, now: Seconds) -> Vector:
        done = self.progress(now)
        return _between(self.start, self.end, done)

    def velocity(self, now: Seconds) -> Vector:
        duration = self.until - self.since
        part = (now - self.since) / duration
        if not 0.0 < part < 1.0:
            return (0.0, 0.0, 0.0)
        rate = 30.0 * part**2 * (1.0 - part) ** 2 / duration
        return tuple(rate * (end - start) for start, end in zip(self.start, self.end, strict=True))  # type: ignore[return-value]


class PieceMoved(Struct, frozen=True):
    """A piece began to move, or came to rest, at `at`."""

    piece: str
    began: bool
    at: Seconds


class Table:
    """The pieces and a person's hands. One movement at a time per hand; another begins when it has ended."""

    def __init__(self, layout: TangramTable, *, hand_speed: float, shortest_movement: Seconds) -> None:
        self.layout = layout
        self.seated = False
        self._hand_speed = hand_speed
        self._shortest = shortest_movement
        self._poses: dict[str, PiecePose] = {piece.id: piece.start for piece in layout.pieces}
        self._rest: dict[HandSide, Vector] = {"left": layout.person.left_hand, "right": layout.person.right_hand}
        self._hands: dict[HandSide, Vector] = dict(self._rest)
        self._moving: dict[HandSide, Movement] = {}

    # -- what hands do ------------------------------------------------------------------------------------------

    def reach(self, piece: str, now: Seconds) -> Seconds:
        """The nearer hand goes to the piece. Returns when it is there."""
        x, y, _ = self.piece(piece, now).position
        return self._move(self._hand_for(piece, now), (x, y, self._holding_height), now).until

    def carry(self, piece: str, pose: PiecePose, now: Seconds) -> Seconds:
        """The hand at the piece (or the nearer one) takes it to `pose`. Returns when it lies there."""
        entity = self.piece(piece, now)
        x, y, _ = entity.position
        hand = self._hand_for(piece, now)
        self._hands[hand] = (x, y, self._holding_height)
        turn = math.remainder(math.radians(pose.yaw) - entity.yaw, math.tau)
        end = (pose.x, pose.y, self._holding_height)
        return self._move(hand, end, now, piece=piece, yaw=entity.yaw, turn=turn).until

    def withdraw(self, now: Seconds) -> Seconds:
        """Both hands go back to the lap. Returns when they are there."""
        return max(self._move(hand, rest, now).until for hand, rest in self._rest.items())

    def _move(
        self, hand: HandSide, end: Vector, now: Seconds, *, piece: str = "", yaw: float = 0.0, turn: float = 0.0
    ) -> Movement:
        start = self.hand(hand, now)
        duration = max(self._shortest, math.dist(start, end) / self._hand_speed)
        movement = Movement(
            hand=hand, start=start, end=end, since=now, until=now + duration,
            piece=piece, yaw_start=yaw, yaw_end=yaw + turn,
        )  # fmt: skip
        self._moving[hand] = movement
        return movement

    @property
    def _holding_height(self) -> Meters:
        return self.layout.surface.center[2] + LIFT

    def _hand_for(self, piece: str, now: Seconds) -> HandSide:
        x, y, z = self.piece(piece, now).position
        hands: tuple[HandSide, HandSide] = ("right", "left")
        return min(hands, key=lambda hand: math.dist(self.hand(hand, now), (x, y, z)))

    # -- what happens -------------------------------------------------------------------------------------------

    @property
    def moving(self) -> bool:
        return bool(self._moving)

    @property
    def carrying(self) -> bool:
        """Is a piece on its way?"""
        return any(movement.piece for movement in self._moving.values())

    @property
    def deadline(self) -> Seconds | None:
        """When the next movement ends."""
        return min((movement.until for movement in self._moving.values()), default=None)

    def settle(self, now: Seconds) -> list[PieceMoved]:
        """End the movements that are over by `now`; returns the pieces that came to rest."""
        rested = []
        for hand, movement in list(self._moving.items()):
            if movement.until <= now:
                del self._moving[hand]
                self._hands[hand] = movement.end
                if movement.piece:
                    x, y, _ = movement.end
                    yaw = math.degrees(math.remainder(movement.yaw_end, math.tau))
                    self._poses[movement.piece] = PiecePose(x, y, yaw)
                    rested.append(PieceMoved(movement.piece, False, movement.until))
        return rested

    # -- what there is ------------------------------------------------------------------------------------------

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
        """Everything there is to see: table and pieces, and the person while they sit there."""
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
    """How much of the way is done, 0..1, after `part` of the time: the way people move."""
    part = min(1.0, max(0.0, part))
    return part**3 * (10.0 - 15.0 * part + 6.0 * part**2)


def _between(start: Vector, end: Vector, part: float) -> Vector:
    return tuple(a + part * (b - a) for a, b in zip(start, end, strict=True))  # type: ignore[return-value]
