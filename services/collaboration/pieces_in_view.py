"""What lies where, judged from many frames: a single one may be wrong, and hands cover pieces (thesis 5.4.2).

Pure. A piece lies in the middle, over the last second, of where it was seen while it rested and no hand was over it.
A piece that is not in view lies where it was last, and has no confidence.
"""

import math
from collections import deque
from collections.abc import Callable, Iterable

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.units import Meters, Seconds
from engage_hri.schemas.world import Entity, World
from engage_hri.services.collaboration.placement import TRUSTED, is_moving

HAND_OVER: Meters = 0.08
"""How near to a piece's center, seen from above, a hand's center covers some of it: half a hand and half a piece."""
WINDOW: Seconds = 1.0
"""Of the frames that are judged."""


class _View(Struct):
    """A piece in view without interruption. samples: when it was seen how; each holds until the next."""

    since: Seconds
    samples: deque[tuple[Seconds, Entity]]

    def add(self, piece: Entity, now: Seconds) -> None:
        self.samples.append((now, piece))
        while len(self.samples) > 1 and self.samples[1][0] <= now - WINDOW:
            self.samples.popleft()

    def middle(self, now: Seconds) -> Entity:
        """The piece where it was seen on either side of for equally long, in each coordinate."""
        times = [max(at, now - WINDOW) for at, _ in self.samples]
        held = [end - at for at, end in zip(times, [*times[1:], now], strict=True)]
        pieces = [piece for _, piece in self.samples]
        last = pieces[-1]

        def of(value: Callable[[Entity], float]) -> float:
            return _middle(list(zip(map(value, pieces), held, strict=True)))

        place = (of(lambda it: it.position[0]), of(lambda it: it.position[1]), of(lambda it: it.position[2]))
        turned = of(lambda it: math.remainder(it.yaw - last.yaw, math.tau))
        return replace(last, position=place, yaw=last.yaw + turned)


class PiecesInView:
    """steady: how long a piece must have been in view before its place is believed."""

    def __init__(self, steady: Seconds) -> None:
        self._steady = steady
        self._views: dict[str, _View] = {}
        self._known: dict[str, Entity] = {}
        self._people: dict[str, Seconds] = {}
        """When each was seen last."""
        self._present: tuple[str, ...] = ()
        self._last: Seconds = -math.inf

    def see(self, world: World, now: Seconds) -> None:
        """A frame."""
        self._people |= dict.fromkeys(self._present, now)
        self._present = tuple(person.id for person in world.people)
        self._last = now
        hands = [entity for entity in world.entities if entity.kind == "hand"]
        in_view = {piece.id: piece for piece in world.objects if _is_clear(piece, hands)}
        for id in self._views.keys() - in_view.keys():
            self._known[id] = self._views.pop(id).middle(now)
        for piece in world.objects:
            self._known.setdefault(piece.id, piece)
        for id, piece in in_view.items():
            self._views.setdefault(id, _View(now, deque())).add(piece, now)

    def pieces(self, now: Seconds) -> tuple[Entity, ...]:
        """Every piece ever seen, where it lies as far as one can tell."""
        return tuple(
            self._views[id].middle(now) if self._is_steady(id, now) else replace(known, confidence=0.0)
            for id, known in self._known.items()
        )

    def is_steady(self, now: Seconds) -> bool:
        """Is the place of every piece certain?"""
        return all(self._is_steady(id, now) for id in self._known)

    def person(self, now: Seconds) -> str | None:
        """Who is there, or was a moment ago."""
        recent = (id for id, at in self._people.items() if now < at + self._steady)
        return next(iter(self._present), None) or next(recent, None)

    def deadline(self, now: Seconds) -> Seconds | None:
        """When any of this changes by itself, without another frame."""
        times = [*(view.since + self._steady for view in self._views.values()), self._last + WINDOW / 2]
        times += [at + self._steady for at in self._people.values()]
        return min((at for at in times if at > now), default=None)

    def _is_steady(self, id: str, now: Seconds) -> bool:
        return id in self._views and now >= self._views[id].since + self._steady


def _is_clear(piece: Entity, hands: Iterable[Entity]) -> bool:
    covered = any(math.dist(hand.position[:2], piece.position[:2]) < HAND_OVER for hand in hands)
    return piece.confidence >= TRUSTED and not covered and not is_moving(piece)


def _middle(weighted: list[tuple[float, float]]) -> float:
    """The value with half of the weight on either side; the last one if nothing has weight."""
    half = sum(weight for _, weight in weighted) / 2
    if half == 0.0:
        return weighted[-1][0]
    reached = 0.0
    for value, weight in sorted(weighted):
        reached += weight
        if reached >= half:
            return value
    raise AssertionError("half of the whole is reached before its end")
