"""Manipulations from the places of hands and pieces: a piece leaves its place together with a hand.

Vision trembles, so places are averaged, and a piece within the tremor of its place rests. A covered piece begins and
ends nothing: while it is being moved it goes where the hand goes, and if it reappears elsewhere, the hand that had
been at its place has moved it.
"""

import math
from collections import deque
from typing import NamedTuple

from msgspec import Struct, field

from engage_hri.schemas.units import Meters, Probability, Seconds, Vector, between, minus, plus
from engage_hri.schemas.world import Entity, World
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.events.scene import Covering
from engage_hri.services.recognition.perceive.gaze_targets import MEMORY
from engage_hri.services.recognition.perceive.onsets import ROUNDING, Change

HAND_REACH: Meters = 0.1
"""Greatest distance from the center of a hand to that of a piece that it moves. Ours."""
MOVED: Meters = 0.025
"""Distance that a piece goes from its place, with a hand, before it counts as manipulated. Above the tremor. Ours."""
TREMOR: Meters = 0.01
"""Distance from its place within which a piece rests: the noise of vision, of which 0.005 is the deviation. Ours."""
SMOOTHING: Seconds = 0.15
"""Time over which places of pieces are averaged: two or three frames of a camera. Ours."""
REST: Seconds = 0.3
"""Time for which a piece rests before its manipulation is over: people stop for shorter times on the way. Ours."""
STILL = 0.05
"""Metres a second up to which what is told to move may rest: hands tremble, and are measured anew each time."""
ALONG = 0.5
"""Share of the piece's way that a hand must have gone meanwhile, to have moved it."""
FOLLOW = 0.1
"""Share of the difference by which the place of a resting piece follows each sight of it."""

HANDS_KEPT = 16
"""Number of hands, the latest, that are kept as possible movers of a hidden piece."""


class _Piece(Struct):
    """State of one piece."""

    place: Vector
    """Place where the piece rests, or has rested last."""
    still_at: Seconds
    """Time when it was last seen there."""
    hands_then: dict[str, Entity]
    """The hands at that time."""
    pause: Vector
    """Place where it may be coming to rest, from `moved_at` until `paused_at` at least."""
    moved_at: Seconds
    paused_at: Seconds
    velocity: Vector = (0.0, 0.0, 0.0)
    """As it was told when it was seen last."""
    holder: str = ""
    """Hand that moves the piece; empty while it rests."""
    grip: Vector = (0.0, 0.0, 0.0)
    """Vector from that hand to the piece."""
    hidden: bool = False
    touched: dict[str, Seconds] = field(default_factory=dict)
    """Hands that have been at its place since it was hidden, each with the end of its first stay so far."""
    sights: deque[tuple[Seconds, Vector]] = field(default_factory=deque)


class _Act(Struct):
    """Manipulation by one person, of one or more pieces. first: the piece with which it began."""

    first: str
    confidence: Probability
    pieces: set[str]


class PersonChanges(NamedTuple):
    """Beginnings and ends of one person's manipulations."""

    actor: str
    changes: list[Change]


class Manipulation:
    """Manipulations of all pieces by all hands. A robot's hand, or one without an owner, causes no action."""

    def __init__(self, robot: str, config: RecognitionConfig) -> None:
        self._robot = robot
        self._least = config.least_confidence
        self._pieces: dict[str, _Piece] = {}
        self._hands: dict[str, Entity] = {}
        self._acts: dict[str, _Act] = {}
        self._before: Seconds = float("-inf")
        """Time when the world was last seen."""

    def is_acting(self, actor: str) -> bool:
        return actor in self._acts

    @property
    def covering(self) -> frozenset[Covering]:
        """Pieces that hands hide and may have taken, as long as that is credible (`memory`)."""
        return frozenset(
            Covering(self._hands[hand].owner, id, until < self._before)
            for id, piece in self._pieces.items()
            if piece.hidden and not piece.holder
            for hand, until in piece.touched.items()
            if hand in self._hands and self._before - until < MEMORY
        )

    @property
    def deadline(self) -> Seconds | None:
        """Time at which a piece has come to rest, if nothing is seen to change."""
        return min((self._rests_at(piece) for piece in self._pieces.values() if piece.holder), default=None)

    def _rests_at(self, piece: _Piece) -> Seconds:
        """Time at which the moving piece rests.

        It is later if piece and hand are both out of sight, and if what is in sight was told to move: a camera of two
        pictures a second has not looked again when `REST` is over.
        """
        lost = piece.hidden and piece.holder not in self._hands
        return piece.moved_at + (MEMORY if lost or self._speed(piece) > STILL else REST)

    def _speed(self, piece: _Piece) -> float:
        """Metres a second, as told last, of the moving piece; of the hand that hides it."""
        hand = self._hands.get(piece.holder)
        return math.hypot(*(hand.velocity if piece.hidden and hand is not None else piece.velocity))

    def feed(self, world: World, at: Seconds) -> list[PersonChanges]:
        """Take the world at `at`, later than the last. Returns the manipulations that began and ended."""
        found = self.advance(at)
        seen = {one.id: one for one in world.entities if one.confidence >= self._least}
        self._hands = {
            id: one for id, one in seen.items() if one.kind == "hand" and one.owner not in ("", self._robot)
        }
        for id, entity in seen.items():
            if entity.kind == "object":
                found += self._see(id, entity, at)
        for id, piece in self._pieces.items():
            if id not in seen:
                self._miss(piece, at)
        self._before = at
        return found

    def advance(self, now: Seconds) -> list[PersonChanges]:
        found = []
        for id, piece in self._pieces.items():
            if piece.holder and now >= self._rests_at(piece) - ROUNDING:
                found += self._end(id, piece)
        return found

    def first_piece(self, actor: str) -> tuple[str, ...]:
        """Piece with which the person's manipulation began; empty if there is none."""
        return (self._acts[actor].first,) if actor in self._acts else ()

    def lose(self, actor: str) -> None:
        """End the person's manipulation, for the person has gone."""
        act = self._acts.pop(actor, None)
        for id in act.pieces if act else ():
            self._rest(self._pieces[id])

    # -- one piece ----------------------------------------------------------------------------------------------

    def _see(self, id: str, entity: Entity, at: Seconds) -> list[PersonChanges]:
        piece = self._pieces.get(id)
        if piece is None:
            place = entity.position
            self._pieces[id] = piece = _Piece(place, at, self._hands, pause=place, moved_at=at, paused_at=at)
        piece.velocity = entity.velocity
        place = self._averaged(piece, entity.position, at)
        self._pause(piece, place, at)
        found = []
        if piece.holder:
            self._grip(piece, entity.position)
        elif piece.hidden:
            found = self._reappears(id, piece, entity, at)
        elif math.dist(place, piece.place) <= TREMOR:
            piece.still_at, piece.hands_then = at, self._hands
            piece.place = between(piece.place, place, FOLLOW)
        elif math.dist(place, piece.place) >= MOVED:
            if hand := self._moving_along(piece, entity.position):
                found = self._begin(id, piece, entity, hand, piece.still_at)
            else:
                self._rest(piece)
        elif at - piece.moved_at >= REST:
            self._rest(piece)  # nudged
        piece.hidden = False
        piece.touched.clear()
        return found

    def _miss(self, piece: _Piece, at: Seconds) -> None:
        if not piece.hidden:
            piece.hidden = True
            piece.sights.clear()
            # Between two pictures a hand may take it away: it was there in the one before.
            piece.touched |= {
                hand: self._before
                for hand, then in piece.hands_then.items()
                if hand in self._hands and piece.still_at == self._before and self._reaches(then, piece.place)
            }
        if not piece.holder:
            for hand, entity in self._hands.items():
                here_before = piece.touched.get(hand, self._before) == self._before
                if here_before and self._reaches(entity, piece.place):
                    piece.touched[hand] = at
            if len(piece.touched) > HANDS_KEPT:
                del piece.touched[min(piece.touched, key=lambda hand: piece.touched[hand])]
        elif piece.holder in self._hands:
            palm = self._hands[piece.holder].position
            self._pause(piece, plus(palm, piece.grip), at)

    def _averaged(self, piece: _Piece, place: Vector, at: Seconds) -> Vector:
        piece.sights.append((at, place))
        while piece.sights[0][0] < at - SMOOTHING:
            piece.sights.popleft()
        x, y, z = (sum(part) / len(piece.sights) for part in zip(*(place for _, place in piece.sights), strict=True))
        return (x, y, z)

    def _pause(self, piece: _Piece, place: Vector, at: Seconds) -> None:
        if math.dist(place, piece.pause) > TREMOR:
            piece.pause, piece.moved_at = place, at
        piece.paused_at = at

    def _grip(self, piece: _Piece, place: Vector) -> None:
        if piece.holder in self._hands:
            piece.grip = minus(place, self._hands[piece.holder].position)

    def _rest(self, piece: _Piece) -> None:
        """Let the piece rest where it is."""
        piece.holder, piece.place = "", piece.pause
        piece.still_at, piece.hands_then = piece.paused_at, self._hands

    def _reappears(self, id: str, piece: _Piece, entity: Entity, at: Seconds) -> list[PersonChanges]:
        if math.dist(entity.position, piece.place) < MOVED:
            return []
        hands = [hand for hand in piece.touched if hand in self._hands]
        if not hands:
            self._rest(piece)
            return []
        hand = max(
            hands, key=lambda hand: (piece.touched[hand], -math.dist(self._hands[hand].position, entity.position))
        )
        piece.moved_at = at
        return self._begin(id, piece, entity, hand, piece.touched[hand])

    def _reaches(self, hand: Entity, place: Vector) -> bool:
        return math.dist(hand.position, place) <= HAND_REACH

    def _moving_along(self, piece: _Piece, place: Vector) -> str:
        """Id of the nearest hand at `place` that has moved `ALONG` with the piece; empty if there is none."""
        way = ALONG * math.dist(place, piece.place)
        hands = [
            hand
            for hand, entity in self._hands.items()
            if self._reaches(entity, place)
            and hand in piece.hands_then
            and math.dist(entity.position, piece.hands_then[hand].position) >= way
        ]
        return min(hands, key=lambda hand: math.dist(self._hands[hand].position, place), default="")

    # -- one person ---------------------------------------------------------------------------------------------

    def _begin(self, id: str, piece: _Piece, entity: Entity, hand: str, at: Seconds) -> list[PersonChanges]:
        piece.holder = hand
        self._grip(piece, entity.position)
        owner = self._hands[hand].owner
        if owner in self._acts:
            self._acts[owner].pieces.add(id)
            return []
        confidence = min(entity.confidence, self._hands[hand].confidence)
        self._acts[owner] = _Act(id, confidence, {id})
        return [PersonChanges(owner, [Change(True, "act", at, (id,), confidence)])]

    def _end(self, id: str, piece: _Piece) -> list[PersonChanges]:
        """Let the piece rest; the person's manipulation ends when all its pieces rest."""
        at = piece.moved_at
        self._rest(piece)
        owner, act = next((owner, act) for owner, act in self._acts.items() if id in act.pieces)
        act.pieces.discard(id)
        if act.pieces:
            return []
        del self._acts[owner]
        return [PersonChanges(owner, [Change(False, "act", at, (act.first,), act.confidence)])]
