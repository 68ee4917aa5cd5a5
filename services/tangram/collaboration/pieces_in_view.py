"""Places of the pieces, judged from many frames: a single one may be wrong, and hands cover pieces (thesis 5.4.2).

Pure. The place of a piece is the median, over the last second, of where it was seen while it rested and no hand was
over it. A piece that is not in view keeps its last place, with confidence 0.
"""

import math
from collections import Counter, deque
from collections.abc import Callable, Iterable
from itertools import accumulate

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorLost
from engage_hri.schemas.units import Meters, Radians, Seconds
from engage_hri.schemas.world import Entity, World
from engage_hri.services.reports.ongoing_actions import ActionEvent

MOVED: Meters = 0.015
TURNED: Radians = math.radians(10.0)
RESTING = 0.01
"""Metres per second: a piece that is faster is moving."""
TRUSTED = 0.5
"""Least confidence of a piece that counts as seen."""


def is_moving(piece: Entity) -> bool:
    return math.hypot(*piece.velocity) > RESTING


def has_been_placed(piece: str, before: Iterable[Entity], now: Iterable[Entity]) -> bool:
    """True if the piece rests at another place, or turned otherwise, than `before`. False while it is not seen."""
    old = next((entity for entity in before if entity.id == piece), None)
    new = next((entity for entity in now if entity.id == piece), None)
    if new is None or is_moving(new) or new.confidence < TRUSTED:
        return False
    if old is None:
        return True
    turned = abs(math.remainder(new.yaw - old.yaw, math.tau))
    return math.dist(new.position, old.position) > MOVED or turned > TURNED


STEADY: Seconds = 0.5
"""Time that a piece must rest in view, with no hand over it, before its place is believed. Ours."""
HAND_OVER: Meters = 0.08
"""Distance of their centers, seen from above, below which a hand covers a piece: half a hand and half a piece."""
AWAY: Seconds = 5.0
"""Time for which somebody must have been out of sight to have gone: who is seen again has come anew. Ours."""
WINDOW: Seconds = 1.0
"""Age of the oldest frame that is judged."""


LONGEST_HOLD: Seconds = 70.0
"""Time for which a piece in a hand counts as being laid: a hand may rest on one. The longest time without any event
in Table 2.1 of the thesis, when people were busy with what lay before them."""


class HeldPieces:
    """The time for which anybody has had a piece in their hand so far: while it runs, they are at what was asked."""

    def __init__(self) -> None:
        self._held: set[tuple[str, tuple[str, ...]]] = set()
        self._since: Seconds = 0.0
        self._before: Seconds = 0.0
        """Seconds of the holds that are over."""

    def feed(self, action: ActionEvent, now: Seconds) -> None:
        """Take what somebody has begun to do or done."""
        so_far, held = self.seconds(now), set(self._held)
        match action:
            case ActionBegan(actor=actor, action="act", targets=targets):
                held.add((actor, targets))
            case ActionEnded(actor=actor, action="act", targets=targets):
                held.discard((actor, targets))
            case ActorLost(actor=actor):
                held = {each for each in held if each[0] != actor}
        if held != self._held:
            self._held, self._before, self._since = held, so_far, now

    def seconds(self, now: Seconds) -> Seconds:
        """Seconds until now."""
        return self._before + (min(now - self._since, LONGEST_HOLD) if self._held else 0.0)


class _View(Struct):
    """A piece in view without interruption. samples: what was seen from which time on, each until the next."""

    since: Seconds
    samples: deque[tuple[Seconds, Entity]]

    def add(self, piece: Entity, now: Seconds) -> None:
        self.samples.append((now, piece))
        while len(self.samples) > 1 and self.samples[1][0] <= now - WINDOW:
            self.samples.popleft()

    def median(self, now: Seconds) -> Entity:
        """The piece at the median of where it was seen in the window, coordinate by coordinate, weighted by time."""
        pieces = [piece for _, piece in self.samples]
        last = pieces[-1]
        times = [max(at, now - WINDOW) for at, _ in self.samples]
        held = [end - at for at, end in zip(times, [*times[1:], now], strict=True)]

        def of(value: Callable[[Entity], float]) -> float:
            return _median(list(zip(map(value, pieces), held, strict=True)))

        place = (of(lambda it: it.position[0]), of(lambda it: it.position[1]), of(lambda it: it.position[2]))
        turned = of(lambda it: math.remainder(it.yaw - last.yaw, math.tau))
        return replace(last, position=place, yaw=last.yaw + turned)


class PiecesInView:
    """The pieces and people seen so far."""

    def __init__(self) -> None:
        self._views: dict[str, _View] = {}
        self._known: dict[str, Entity] = {}
        self._people: dict[str, Seconds] = {}
        """Time at which each person was last seen."""
        self.visits: Counter[str] = Counter()
        """How often each person has come."""
        self._present: tuple[str, ...] = ()
        self._last: Seconds = -math.inf

    def see(self, world: World, now: Seconds) -> None:
        """Take in a frame."""
        self._people |= dict.fromkeys(self._present, now)
        self._present = tuple(person.id for person in world.people)
        self.visits.update(id for id in self._present if now > self._people.get(id, -math.inf) + AWAY)
        self._last = now
        hands = [entity for entity in world.entities if entity.kind == "hand"]
        in_view = {piece.id: piece for piece in world.objects if _is_clear(piece, hands)}
        for id in self._views.keys() - in_view.keys():
            self._known[id] = self._views.pop(id).median(now)
        for piece in world.objects:
            self._known.setdefault(piece.id, piece)
        for id, piece in in_view.items():
            self._views.setdefault(id, _View(now, deque())).add(piece, now)

    def pieces(self, now: Seconds) -> tuple[Entity, ...]:
        """Every piece seen so far, at its last known place; with confidence 0 while that is uncertain."""
        return tuple(
            self._views[id].median(now) if self._is_steady(id, now) else replace(known, confidence=0.0)
            for id, known in self._known.items()
        )

    def is_steady(self, now: Seconds) -> bool:
        """True if the place of every piece is certain."""
        return all(self._is_steady(id, now) for id in self._known)

    def people(self, now: Seconds) -> tuple[str, ...]:
        """Ids of all who are there, or were a moment ago."""
        return tuple(dict.fromkeys((*self._present, *(id for id, at in self._people.items() if now < at + STEADY))))

    def person(self, now: Seconds, known: str = "") -> str | None:
        """Id of a person who is there, or was a moment ago, of `known` rather than of another; None: nobody."""
        there = self.people(now)
        return known if known in there else next(iter(there), None)

    def deadline(self, now: Seconds) -> Seconds | None:
        """Next time at which any of this changes by itself, without another frame; None: never."""
        times = [*(view.since + STEADY for view in self._views.values()), self._last + WINDOW / 2]
        times += [at + STEADY for at in self._people.values()]
        return min((at for at in times if at > now), default=None)

    def _is_steady(self, id: str, now: Seconds) -> bool:
        return id in self._views and now >= self._views[id].since + STEADY


def _is_clear(piece: Entity, hands: Iterable[Entity]) -> bool:
    covered = any(math.dist(hand.position[:2], piece.position[:2]) < HAND_OVER for hand in hands)
    return piece.confidence >= TRUSTED and not covered and not is_moving(piece)


def _median(weighted: list[tuple[float, float]]) -> float:
    """The median of values with weights; the last value if nothing has weight."""
    half = sum(weight for _, weight in weighted) / 2
    if half == 0.0:
        return weighted[-1][0]
    ordered = sorted(weighted)
    reached = accumulate(weight for _, weight in ordered)
    return next(value for (value, _), share in zip(ordered, reached, strict=True) if share >= half)
