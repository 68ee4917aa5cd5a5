"""Behaviors of one block that move the same part: which takes it from which, which must wait, and until when."""

from collections.abc import Collection, Container, Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from math import inf
from typing import NamedTuple

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.behavior_types import SYNC_POINTS, TYPES
from engage_hri.schemas.behaviors import Gesture, Hand, Pointing
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.body import Estimate
from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.net.facts import NO_STOPS, Stops
from engage_hri.services.realizer.plan.phases import ARMS, Chain
from engage_hri.services.realizer.plan.relations import Classes, Relations
from engage_hri.services.realizer.plan.schedule import Circle
from engage_hri.services.realizer.points import EPSILON, ON_TARGET, SHIFTS, WITH_STROKE, Point

_OTHER: Mapping[str, tuple[str, Hand]] = {
    arm: (parts[0], hand)
    for hand, parts in ARMS.items()
    if len(parts) == 1
    for arm in ARMS["BOTH_HANDS"]
    if arm not in parts
}
"""For each arm, the other, and the hand that means it."""
_STROKE, RELAX = SYNC_POINTS.index("stroke"), SYNC_POINTS.index("relax")
"""Numbers of these points in a behavior that lasts."""
Turn = tuple[str, Point]
"""A behavior, and the point of another that it waits for before it takes its part."""


class Handover(NamedTuple):
    """The part of a behavior goes to its successor, once the points up to `kept` are passed.

    The points after that are its way home, which the handover saves.
    """

    successor: str
    kept: Point


class Arrangement(Struct, frozen=True):
    """Order in which behaviors use parts of the body.

    natural: behaviors that end when something takes their place, or with the block; lasting: those with the block.
    begun: behaviors that have begun, and come after nothing any more. early: lasting behaviors, each with a point of
    the block that it does not last for: that waits, through another block, until it has left.
    successors: for a behavior, the one that takes its part, and the first of its points that this brings about.
    handovers: for each behavior whose parts others take some time, the next on each part, and what it leaves to it.
    The first of these ends it; the others wait for it, too, or a slow one would lose its stroke to them.
    cuts: number of the first segment that is not given its time, because a successor has the part by then.
    turns: behaviors that wait for a point of another before they take its part.
    spoken: the speeches in the order in which they are said.
    takes: behaviors of other blocks, by `block:behavior`, of which one of this block takes a part over.
    ranked: behaviors in the order in which they take their parts. Of those that begin at one instant it is kept: by a
    handover the later waits for one more event, which is no reason to come first or last.
    stops: what holds have stopped of those that have begun.
    """

    natural: frozenset[str] = frozenset()
    begun: frozenset[str] = frozenset()
    lasting: tuple[str, ...] = ()
    early: frozenset[tuple[str, Point]] = frozenset()
    successors: Mapping[str, tuple[str, Point]] = {}
    handovers: Mapping[str, tuple[Handover, ...]] = {}
    cuts: Mapping[str, int] = {}
    turns: frozenset[Turn] = frozenset()
    spoken: tuple[str, ...] = ()
    takes: Mapping[str, str] = {}
    ranked: tuple[str, ...] = ()
    stops: Stops = NO_STOPS

    def lasts_for(self, id: str, other: Chain) -> Point | None:
        """The last point of another behavior that a lasting one waits for before it leaves; None: for none."""
        return next((point for point in reversed(other.points) if (id, point) not in self.early), None)

    @property
    def waits(self) -> frozenset[Turn]:
        """The handovers, as waits for one's turn."""
        return frozenset(each for takers in self.handovers.values() for each in takers)


class Conflict(NamedTuple):
    """Two behaviors that would have the same part at the same time.

    turn: the later, and the point of the earlier that it has to wait for. hand: the one that can use the other hand.
    """

    turn: Turn | None
    hand: tuple[str, Hand] | None

    def is_open(self, begun: Container[str], settled: Container[Turn]) -> bool:
        """True if it can be settled: who has begun waits no more. settled: turns that are."""
        if self.hand:
            return True
        assert self.turn is not None
        return self.turn[0] not in begun and self.turn not in settled


class Hands:
    """Arms that behaviors use at the times of a schedule, with the hands that are chosen in it.

    chains: of this block, and of others. kept: points that no handover may cost. barred: hands with which a behavior
    cannot be done.
    """

    def __init__(
        self,
        chains: dict[str, Chain],
        times: Mapping[Point, Seconds],
        kept: Container[Point],
        barred: Container[tuple[str, Hand]],
    ) -> None:
        self.chains = chains
        self._times = times
        self._kept = kept
        self._barred = barred

    def choose(self, rivals: Iterable[str]) -> tuple[str, Hand] | None:
        """Choose the other hand for the first of these that names none and need not wait for that arm, nor it for it.

        That arm may be on its way home, and a movement may do without its reserve.
        """
        for id in rivals:
            chain = self.chains[id]
            other = _OTHER.get(chain.parts[0]) if len(chain.parts) == 1 else None
            if other is None or not isinstance(chain.behavior, Pointing | Gesture) or chain.behavior.mode is not None:
                continue
            arm, hand = other
            if (id, hand) not in self._barred and self._is_free(arm, chain):
                self.chains[id] = replace(chain, behavior=replace(chain.behavior, mode=hand), parts=(arm,))
                return id, hand
        return None

    def _is_free(self, arm: str, wanting: Chain) -> bool:
        since, to = self._needed(wanting)
        windows = [self._needed(each) for each in self.chains.values() if arm in each.parts]
        return all(end <= since + EPSILON or start >= to - EPSILON for start, end in windows)

    def _needed(self, chain: Chain) -> tuple[Seconds, Seconds]:
        """Start and end of the time in which a behavior needs its arm."""
        times, points = self._times, chain.points
        kept = [number for number, point in enumerate(points) if point in self._kept]
        since, to = times[points[0]], times[points[max([least(chain), *kept])]]
        if chain.type in WITH_STROKE and points[0] not in self._kept:
            way = [each.to for each in chain.segments].index("stroke_start") + 1
            since = max(since, times[points[way]] - sum([each.natural for each in chain.segments[:way]]))
        return since, to


def arrange(
    chains: Mapping[str, Chain],
    relations: Relations,
    before: Arrangement,
    times: Mapping[Point, Seconds],
    rounds: Mapping[Point, int],
    hands: Hands,
    begun: Container[str] = (),
) -> tuple[Arrangement, list[Conflict]]:
    """The arrangement for a schedule that was made with `before`, and conflicts where it breaks what was asked for.

    rounds: order of points that come at one time. hands: those that behaviors use, and are given here. begun:
    behaviors that have begun: they wait for nobody any more, and use the arm that they have.
    """
    held, awaited = relations.held, relations.awaited
    mentioned = {point.behavior for point in relations.constrained}
    successors, cuts = dict(before.successors), dict(before.cuts)
    handovers: dict[str, tuple[Handover, ...]] = {}
    conflicts = []
    ranked = entering(chains, mentioned, times, rounds, before.ranked, begun)
    users = _users(chains, ranked)
    beneath = frozenset(_overlaid(chains, users, times))
    for id in [id for id in cuts if chains[id].type in SHIFTS and id not in successors and id not in beneath]:
        del cuts[id]  # The look that it lay beneath ends before it, by now.
    cuts.update(dict.fromkeys(beneath, 0))
    for id, takers in _takers(chains, ranked, users).items():
        chain, successor = chains[id], takers[0]
        if set(hands.chains[id].parts).isdisjoint(hands.chains[successor].parts):
            continue  # One of them uses the other arm from now on, and all is arranged anew.
        if before.successors.get(successor, ("",))[0] == id and id not in begun:
            # Either would come first if the other cut it short. So neither is cut: the one meant to be later waits.
            conflicts.append(Conflict((id, chains[successor].points[-1]), None))
            continue
        first = _first_after(chain, times[Point(successor, "start")], times)
        is_natural = id in before.natural
        # Points that the successor itself is to come after are kept: cut short, they would come at once.
        own = held.union(awaited.get(successor, ()))
        if first:
            is_asked = successor in mentioned
            last = last_kept(chain, chains[successor], first, own, is_natural=is_natural, is_asked=is_asked)
            turn = (successor, chain.points[last]) if last is not None else None
            is_anytime = id not in mentioned and id not in begun
            if turn is not None and chain.type != "speech" and is_anytime and successor in mentioned:
                # Nobody has said when the earlier one comes: it is what waits.
                number = _STROKE if successor in before.natural else len(chains[successor].points) - 1
                turn = (id, chains[successor].points[number])
            if turn is not None:
                # A behavior that has made its stroke hands over; for one that has not, a free other arm is better.
                rivals = tuple([each for each in (successor, id) if each not in begun])
                conflicts.append(Conflict(turn, hands.choose(rivals)))
        if chain.type != "speech":
            handovers[id] = tuple([_handover(chain, chains[each], relations, times) for each in takers])
        if id in successors or id in beneath:  # Who begins beneath a look ends by itself, at once.
            continue
        if is_natural:
            first = min(first or RELAX, RELAX)
        if first:
            successors[id] = (successor, chain.points[first])
            cuts[id] = first - 1
    lasting = tuple(sorted(before.natural - successors.keys()))
    arranged = replace(before, lasting=lasting, successors=successors, handovers=handovers, cuts=cuts, ranked=ranked)
    return arranged, conflicts


def _first_after(chain: Chain, taken: Seconds, times: Mapping[Point, Seconds]) -> int:
    """Number of the first point of a behavior after its part is taken; 0: it has ended by then."""
    return next((number for number, point in enumerate(chain.points) if times[point] > taken + EPSILON), 0)


def _handover(chain: Chain, successor: Chain, relations: Relations, times: Mapping[Point, Seconds]) -> Handover:
    """The handover from a behavior to one that takes a part of it in this schedule.

    A point that is kept stays so: the successor waits for it from then on. So the handovers of a schedule settle.
    """
    id = successor.behavior.id
    held, own = relations.held, relations.awaited.get(id, ())
    first = _first_after(chain, times[successor.points[0]], times)
    kept = [number for number, point in enumerate(chain.points[: first or None]) if point in held or point in own]
    return Handover(id, chain.points[max([least(chain, successor), *kept])])


_BENEATH = ("gazeShift", "headDirectionShift")
"""Types from which a look takes nothing: who takes over such a shift is another, and it did not come to its end."""


def kept_points(
    chains: Mapping[str, Chain], relations: Relations, handovers: Mapping[str, tuple[Handover, ...]]
) -> Mapping[str, Point]:
    """For each behavior, the last point that it must pass itself, whoever takes its part."""
    held = relations.held
    kept = {id: each[0].kept for id, each in handovers.items() if chains[id].type not in _BENEATH}
    for id, chain in chains.items():
        if id not in kept:
            numbers = [number for number, point in enumerate(chain.points) if point in held]
            kept[id] = chain.points[max([least(chain), *numbers])]
    return kept


def entering(
    chains: Mapping[str, Chain],
    mentioned: Collection[str],
    times: Mapping[Point, Seconds],
    rounds: Mapping[Point, int],
    ranked: Sequence[str] = (),
    begun: Container[str] = (),
) -> tuple[str, ...]:
    """Behaviors in the order in which they take parts. Of those that start together, those that have begun come first
    and unmentioned ones last.

    ranked: the order so far.
    """
    so_far = {id: number for number, id in enumerate(ranked)}
    rank = {
        id: (
            round(times[start := chain.points[0]], 6),
            id not in begun,
            so_far.get(id, 0),
            rounds[start],
            id not in mentioned,
            number,
        )
        for number, (id, chain) in enumerate(chains.items())
    }
    return tuple(sorted(chains, key=rank.__getitem__))


def last_kept(
    chain: Chain, successor: Chain, first: int, kept: Container[Point], *, is_natural: bool, is_asked: bool
) -> int | None:
    """Number of the last point, from `first` on, that a successor must wait for; None if there is none.

    Points `kept` count; all do if nothing asks for the successor now. What a look lies over loses nothing by it.
    """
    numbers = [number for number, point in enumerate(chain.points) if point in kept]
    if not is_overlaid(chain, successor):
        numbers.append(least(chain) if is_asked or is_natural else len(chain.points) - 1)
    last = max(numbers, default=-1)
    return last if last >= first else None


def least(chain: Chain, successor: Chain | None = None) -> int:
    """Number of the last point that a behavior must have passed before the successor takes its part.

    A handover may cost it its way home, never its stroke. A shift that a look lies over has set what it is to set.
    """
    if chain.type in WITH_STROKE:
        return next(number for number, point in enumerate(chain.points) if point.sync == "stroke_end")
    if chain.type in ON_TARGET:
        return _STROKE
    return 0 if successor is not None and is_overlaid(chain, successor) else len(chain.points) - 1


def leaving(chain: Chain) -> int:
    """Number of the first point of the instant in which a behavior leaves its target; of a gaze, `stroke_end`."""
    together = next((group for group in TYPES[chain.type].one_instant if "relax" in group), ("relax",))
    return next(number for number, point in enumerate(chain.points) if point.sync in together)


def is_tied(later: Chain, speech: Chain, classes: Classes) -> bool:
    """True if the block itself says that `later` begins while the speech is spoken, or after it, not before.

    Then nothing else puts it in turn; where the two would overlap, it gives up that tie.
    """
    root, begins = classes.find(later.points[0])
    first, spoken = classes.find(speech.points[0])
    if root == first and begins < spoken - EPSILON:
        return False
    return any(classes.find(point)[0] == root for point in speech.points)


def _users(chains: Mapping[str, Chain], order: Iterable[str]) -> Mapping[str, Sequence[str]]:
    """For each part, the behaviors that use it, in the order in which they take it."""
    users: dict[str, list[str]] = {}
    for id in order:
        for part in chains[id].parts:
            users.setdefault(part, []).append(id)
    return users


def _takers(
    chains: Mapping[str, Chain], ranked: Sequence[str], users: Mapping[str, Sequence[str]]
) -> dict[str, list[str]]:
    """For each behavior, the next that takes each of its parts, in the order in which they do.

    Of a shift, it is the next look, and the next shift: that waits for its end, also if the look brings that about.
    """
    rank = {id: number for number, id in enumerate(ranked)}
    found: dict[str, set[str]] = {}
    for ids in users.values():
        for earlier, later in in_series(ids, chains):
            found.setdefault(earlier, set()).add(later)
    return {id: sorted(takers, key=rank.__getitem__) for id, takers in found.items()}


def in_series(users: Sequence[str], chains: Mapping[str, Chain]) -> Iterator[tuple[str, str]]:
    """Each user of a part, in order, and the next that takes it over: a shift takes nothing from a gaze."""
    yield from pairwise([id for id in users if chains[id].type not in SHIFTS])
    yield from ((one, other) for one, other in pairwise(users) if chains[one].type in SHIFTS)
    yield from pairwise([id for id in users if chains[id].type in SHIFTS])


def is_overlaid(earlier: Chain, later: Chain) -> bool:
    """True for a shift beneath a look: that takes nothing from it, nor it from that."""
    return earlier.type in SHIFTS and later.type not in SHIFTS


def _overlaid(
    chains: Mapping[str, Chain], users: Mapping[str, Sequence[str]], times: Mapping[Point, Seconds]
) -> Iterator[str]:
    """Shifts that start during a gaze."""
    for ids in users.values():
        until = -inf
        for id in ids:
            since, to = window(chains[id], times)
            if chains[id].type not in SHIFTS:
                until = max(until, to)
            elif since < until - EPSILON:
                yield id


def window(chain: Chain, times: Mapping[Point, Seconds]) -> tuple[Seconds, Seconds]:
    """Start and end of a behavior."""
    return times[chain.points[0]], times[chain.points[-1]]


def hands_refused(block: Block, chosen: Block, estimates: Iterable[Estimate]) -> set[tuple[str, Hand]]:
    """Hands that `block` leaves open and `chosen` does not, with which the body cannot perform a behavior."""
    impossible = {each.behavior for each in estimates if not each.feasible}
    return {
        (after.id, after.mode)
        for before, after in zip(block.behaviors, chosen.behaviors, strict=True)
        if after is not before
        and isinstance(after, Pointing | Gesture)
        and after.mode is not None
        and after.id in impossible
    }


def with_hands(block: Block, hands: Mapping[str, Hand]) -> Block:
    """The block with these hands for some of its behaviors."""
    if not hands:
        return block
    chosen = [replace(each, mode=hand) if (hand := hands.get(each.id)) else each for each in block.behaviors]
    return replace(block, behaviors=tuple(chosen))


Ends = tuple[int, int]
"""Transitions of the point that is waited for, and of the start of who waits."""


def by_ends(turns: Iterable[Turn], at: Mapping[Point, int]) -> dict[Ends, Turn]:
    """Turns by where they stand in a net. at: the transition of each point."""
    return {(at[point], at[Point(id, "start")]): (id, point) for id, point in sorted(turns)}


def turns_in(ends: Mapping[Ends, Turn], *circles: Circle) -> Iterator[Turn]:
    """The turns that circles of ties go through, in their order."""
    ties = ((tie.source, tie.target) for circle in circles for tie, _ in circle if tie.kind == "series")
    yield from (ends[each] for each in ties if each in ends)
