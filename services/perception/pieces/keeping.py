"""The pieces of a table as they are told, from what is spotted in one picture after the other. Pure.

A piece is measured to a millimetre, and differently in each picture. Told so, a square that touches the top of a
rectangle would touch its top left now and then, and nothing would ever rest. So a piece that is told to lie somewhere
lies there until it is seen to be elsewhere by more than measuring errs, twice: what follows from its pose, as what it
touches, holds as long. While it rests, the median of the last seconds mends its place, in steps that are no smaller
than `NUDGE`.

A piece that is not seen is covered: it stays where it was, with little confidence. Where it lay the bare table is
seen? Then somebody holds it, and it is left out; who remembers the world takes it for covered for a while
(`CoveredObjects`).

Half of a square is a triangle. So what is spotted beside a hand, where another piece of that color lies that is not
seen, is that piece: no two lie in one place.
"""

import math
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from statistics import median

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.tables import Form, PiecePose, TaskTable
from engage_hri.schemas.units import Meters, Probability, Radians, Seconds
from engage_hri.schemas.world import Entity
from engage_hri.services.perception.pieces.spotting import HEIGHT, SpottedHand, SpottedPiece, SpottedPieces

AWAY: Meters = 0.004
"""Distance, and turn, from which on a piece is elsewhere."""
TURNED: Radians = math.radians(4.0)
WHOLE: Probability = 0.9
NEAR: Meters = 0.02
"""Share of a piece that has to be in view for it to have moved by less than this distance: what is covered in part is
measured worse."""
NUDGE: Meters = 0.001
TWIST: Radians = math.radians(1.0)
WINDOW: Seconds = 5.0
FEWEST = 3
"""Pictures of a piece at rest from which on their median counts."""
STILL = 0.03
"""Metres per second: a piece that is faster moves."""
REACH: Meters = 0.15
SWIFT = 1.5
"""Distance, and more for each second, at which a hand is the same from one picture to the next."""
HELD: Meters = 0.12
"""Distance from the middle of a hand, in this picture or the last, within which a piece goes with it, or was laid by
it: then one picture is enough."""
COVERED: Probability = 0.3
"""Confidence in where a piece lies that is not seen."""
PATIENCE: Seconds = 0.4
"""Time for which a piece may be missed before it is told as covered, and its place be bare before it is left out."""


class _Kept(Struct):
    """A piece. pose: as told; None: it is not told, or not any more. rests: what was seen of it since it rests.

    elsewhere: the last that was seen of it, if that is not where it is told to lie. seen: when it was seen last.
    bare: since when its place is.
    """

    form: Form
    rests: deque[tuple[Seconds, SpottedPiece]]
    pose: SpottedPiece | None = None
    velocity: tuple[float, float] = (0.0, 0.0)
    elsewhere: tuple[Seconds, SpottedPiece] | None = None
    seen: Seconds = -math.inf
    bare: Seconds | None = None
    is_covered: bool = False


class PieceKeeper:
    """The pieces of a table."""

    def __init__(self, table: TaskTable) -> None:
        self._table = table
        self._kept = {form.id: _Kept(form, deque()) for form in table.pieces}
        self._hands: tuple[SpottedHand, ...] = ()
        """Of the last picture: in this one they may have laid down what they held."""

    def feed(self, spotted: SpottedPieces, at: Seconds) -> tuple[Entity, ...]:
        """Take what is spotted in a picture. Returns all pieces as they are to be told."""
        seen = {piece.id: piece for piece in spotted.pieces if not self._is_half(piece, spotted)}
        for id, kept in self._kept.items():
            if id in seen:
                _see(kept, _turned_alike(kept, seen[id]), at, (*self._hands, *spotted.hands))
            else:
                _miss(kept, at, is_bare=id in spotted.bare)
        self._hands = spotted.hands
        return tuple(self._entities())

    def _is_half(self, piece: SpottedPiece, spotted: SpottedPieces) -> bool:
        """True if it is what a hand leaves in view of another piece."""
        if not any(math.dist((hand.x, hand.y), (piece.x, piece.y)) < HELD for hand in spotted.hands):
            return False
        missing = self._kept.keys() - {each.id for each in spotted.pieces} - set(spotted.bare)
        color = self._kept[piece.id].form.color
        covered = [kept.pose for id, kept in self._kept.items() if id in missing and kept.form.color == color]
        return any(pose is not None and _is_near(piece, pose) for pose in covered)

    def _entities(self) -> Iterator[Entity]:
        for kept in self._kept.values():
            if kept.pose is not None:
                pose = PiecePose(kept.pose.x, kept.pose.y, math.degrees(kept.pose.yaw))
                confidence = COVERED if kept.is_covered else _confidence(kept.pose.seen)
                lying = self._table.lying(kept.form, pose)
                yield replace(lying, confidence=confidence, velocity=(*kept.velocity, 0.0))


class HandKeeper:
    """The hands over a table: each is of the person who is nearest to where it comes over the edge.

    One that comes from the side of the robot is its own, and is not told.
    """

    def __init__(self, table: TaskTable) -> None:
        self._height = table.surface.center[2] + HEIGHT
        self._half = math.hypot(*table.surface.center[:2])
        self._hands: tuple[Entity, ...] = ()
        self._at: Seconds = -math.inf

    def feed(self, hands: Sequence[SpottedHand], people: Sequence[Entity], at: Seconds) -> tuple[Entity, ...]:
        """Take the hands of a picture. Returns them as they are to be told."""
        past, before = at - self._at, list(self._hands)
        told: list[Entity] = []
        for hand in hands:
            comes = hand.from_x, hand.from_y
            if math.hypot(*comes) < self._half:
                continue
            place = hand.x, hand.y, self._height
            near = min(before, key=lambda each: math.dist(each.position, place), default=None)
            if near is not None and math.dist(near.position, place) < REACH + SWIFT * past:
                before.remove(near)
                vx, vy, _ = ((b - a) / past for a, b in zip(near.position, place, strict=True))
                told.append(replace(near, position=place, velocity=(vx, vy, 0.0)))
            else:
                owner = min(people, key=lambda each: math.dist(each.position[:2], comes), default=None)
                told.append(Entity(id="", kind="hand", owner=owner.id if owner else "", position=place))
        self._hands, self._at = tuple(_named(told)), at
        return self._hands


def _named(hands: Iterable[Entity]) -> Iterator[Entity]:
    """Give those an id that have none: the first that nobody has."""
    hands = [*hands]
    taken = {each.id for each in hands}
    for hand in hands:
        name = f"{hand.owner}-hand" if hand.owner else "hand"
        free = (id for id in (name, *(f"{name}-{k}" for k in range(2, 9))) if id not in taken)
        named = hand if hand.id else replace(hand, id=next(free))
        taken.add(named.id)
        yield named


def _turned_alike(kept: _Kept, piece: SpottedPiece) -> SpottedPiece:
    """The piece with the turn, of those that look the same, that is nearest to how it was told."""
    about = kept.pose.yaw if kept.pose is not None else math.radians(kept.form.start.yaw)
    return replace(piece, yaw=about + math.remainder(piece.yaw - about, math.tau / kept.form.turns_alike))


def _see(kept: _Kept, piece: SpottedPiece, at: Seconds, hands: Iterable[SpottedHand]) -> None:
    then, kept.seen, kept.bare = kept.seen, at, None
    kept.is_covered = False
    before, kept.elsewhere = kept.elsewhere, None
    if kept.pose is not None and piece.seen < WHOLE and _is_near(piece, kept.pose):
        kept.velocity = (0.0, 0.0)
        return  # a hand is over it
    if kept.pose is not None and not _is_elsewhere(piece, kept.pose):
        kept.velocity = (0.0, 0.0)
        kept.rests.append((at, piece))
        while kept.rests[0][0] < at - WINDOW:
            kept.rests.popleft()
        kept.pose = _settled(kept.pose, [each for _, each in kept.rests], piece.seen)
        return
    kept.elsewhere = (at, piece)
    is_held = any(math.dist((hand.x, hand.y), (piece.x, piece.y)) < HELD for hand in hands)
    if before is None and is_held:
        before = then, kept.pose or piece  # told late, it would not have gone with the hand
    if before is None:
        return  # a picture alone may err
    since, last = before
    pace = 1 / max(at - since, 1e-3)
    vx, vy = (piece.x - last.x) * pace, (piece.y - last.y) * pace
    is_moving = math.hypot(vx, vy) > STILL
    if kept.pose is None and is_moving:
        return  # where it is first told it lies
    kept.pose, kept.velocity = piece, (vx, vy) if is_moving else (0.0, 0.0)
    kept.rests.clear()
    if not is_moving:
        kept.elsewhere = None


def _miss(kept: _Kept, at: Seconds, *, is_bare: bool) -> None:
    kept.elsewhere = None
    kept.bare = (at if kept.bare is None else kept.bare) if is_bare else None
    if at - kept.seen >= PATIENCE:
        kept.is_covered, kept.velocity = True, (0.0, 0.0)
        kept.rests.clear()
    if kept.bare is not None and at - kept.bare >= PATIENCE:
        kept.pose = None


def _is_near(piece: SpottedPiece, told: SpottedPiece) -> bool:
    return math.dist((piece.x, piece.y), (told.x, told.y)) < NEAR


def _is_elsewhere(piece: SpottedPiece, told: SpottedPiece) -> bool:
    return math.dist((piece.x, piece.y), (told.x, told.y)) > AWAY or abs(piece.yaw - told.yaw) > TURNED


def _settled(told: SpottedPiece, seen: list[SpottedPiece], share: Probability) -> SpottedPiece:
    """The pose that is told on: the median of what was seen, if that is beside it by more than a nudge."""
    told = replace(told, seen=share)
    if len(seen) < FEWEST:
        return told
    x, y, yaw = (median(getattr(each, name) for each in seen) for name in ("x", "y", "yaw"))
    if math.dist((x, y), (told.x, told.y)) <= NUDGE and abs(yaw - told.yaw) <= TWIST:
        return told
    return replace(told, x=x, y=y, yaw=yaw)


def _confidence(seen: Probability) -> Probability:
    """Confidence in a piece that is seen, in tenths: its place is known, or it would not be told as seen."""
    return round(0.6 + 0.4 * seen, 1)
