"""Relations between points, assembled into a Petri net: the middle part of planning.

The transitions are numbered in an order in which they can fire, the same for any order of elements: two blocks that
say the same get the same net. Points that wait for each other in a circle come last; these circles are the strongly
connected components of the ties.
"""

import heapq
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from math import inf
from typing import TypeVar

from msgspec import Struct

from engage_hri.schemas.behavior_types import SERIES, TYPES
from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.net.petri_net import Bound, PetriNet, Place, PlaceKind, Transition
from engage_hri.services.realizer.plan.handover import Arrangement, is_tied
from engage_hri.services.realizer.plan.phases import RESERVE, Chain, prolonged
from engage_hri.services.realizer.plan.relations import Classes, Instant, Order, Relations, instants
from engage_hri.services.realizer.points import (
    EPSILON,
    ORIGIN,
    WITH_STROKE,
    Gate,
    Member,
    Point,
    gate,
    gate_point,
    performer,
)


def components(size: int, out: Mapping[int, Sequence[int]]) -> list[list[int]]:
    """The strongly connected components of a graph of `size` nodes. Kosaraju, without recursion."""
    into: dict[int, list[int]] = {}
    for source, targets in out.items():
        for target in targets:
            into.setdefault(target, []).append(source)
    groups = []
    taken = bytearray(size)
    for root in reversed(_left(size, out)):
        if taken[root]:
            continue
        taken[root] = 1
        group = [root]
        for here in group:  # which grows meanwhile
            for source in into.get(here, ()):
                if not taken[source]:
                    taken[source] = 1
                    group.append(source)
        groups.append(sorted(group))
    return groups


def _left(size: int, out: Mapping[int, Sequence[int]]) -> list[int]:
    """Nodes in the order in which a depth-first search leaves them."""
    finished: list[int] = []
    seen = bytearray(size)
    for root in range(size):
        stack = [] if seen[root] else [(root, iter(out.get(root, ())))]
        seen[root] = 1
        while stack:
            here, rest = stack[-1]
            for step in rest:
                if not seen[step]:
                    seen[step] = 1
                    stack.append((step, iter(out.get(step, ()))))
                    break
            else:
                finished.append(here)
                stack.pop()
    return finished


_Tie = TypeVar("_Tie", bound=tuple[object, ...])


def numbered(
    transitions: Sequence[Transition], places: Sequence[Place], bounds: Sequence[Bound]
) -> tuple[PetriNet, list[int], set[int]]:
    """The net, the former number of each transition, and the former numbers of those that wait for each other.

    Those come last, before the end.
    """
    ranked = _firing_order(len(transitions), places)
    unfired = {*range(len(transitions))}.difference(ranked)
    ranked += sorted(unfired)
    number = [0] * len(ranked)
    for new, old in enumerate(ranked):
        number[old] = new
    ties = _in_order(
        [(number[it.source], number[it.target], it.kind, it.lag, it.behavior, it.lines, it.shortest, it.after)
         for it in places]
    )  # fmt: skip
    limits = _in_order(
        [(number[it.source], number[it.target], it.kind, it.lag, it.behavior, it.lines,
          inf if it.stretch is None else it.stretch) for it in bounds]
    )  # fmt: skip
    placed = [
        Place(kind, source, target, lag, shortest, behavior, lines, after)
        for source, target, kind, lag, behavior, lines, shortest, after in ties
    ]
    bounded = [
        Bound(kind, source, target, lag, None if stretch == inf else stretch, behavior, lines)
        for source, target, kind, lag, behavior, lines, stretch in limits
    ]
    net = PetriNet(tuple([transitions[each] for each in ranked]), tuple(placed), tuple(bounded))
    return net, ranked, unfired


def _firing_order(size: int, places: Sequence[Place]) -> list[int]:
    """The transitions as they can fire, but the last one and those that wait for each other."""
    out: list[list[int]] = [[] for _ in range(size)]
    missing = [0] * size
    for place in places:
        if place.kind != "idle":
            out[place.source].append(place.target)
            missing[place.target] += 1
    ready = [each for each in range(size - 1) if not missing[each]]
    found: list[int] = []
    while ready:
        found.append(here := heapq.heappop(ready))
        for target in out[here]:
            missing[target] -= 1
            if not missing[target]:
                heapq.heappush(ready, target)
    return found


def _in_order(ties: list[_Tie]) -> list[_Tie]:
    """The ties in order, without repetitions."""
    ties.sort()
    return ties[:1] + [tie for before, tie in pairwise(ties) if tie != before]


class Assembly(Struct, frozen=True):
    """A net. is_ordered: its transitions are numbered as they can fire; otherwise some wait for each other."""

    net: PetriNet
    is_ordered: bool
    at: Mapping[Point, int]
    """The transition of each point."""
    members: tuple[tuple[Member, ...], ...]
    """The behaviors' parts in each transition."""

    def waits(self, ties: Iterable[Place | Bound]) -> set[tuple[str, str]]:
        """Waits among `ties` that only make sure of an order, or are mere custom: pairs of names of transitions."""
        names = [each.name for each in self.net.transitions]
        return {(names[tie.source], names[tie.target]) for tie in ties if self.is_dispensable(tie)}

    def is_dispensable(self, tie: Place | Bound) -> bool:
        """True for a wait that only makes sure of an order, or is mere custom."""
        if tie.kind == "order":
            return bool(tie.behavior and tie.source and tie.target != len(self.net.transitions) - 1)
        return tie.kind == "series" and not tie.behavior

    def rounds(self, times: Sequence[Seconds]) -> dict[Point, int]:
        """Number of measured events in a row that each point waits for at its own time: an order of equal times."""
        rounds = [0] * len(times)
        for place in sorted(self.net.places, key=lambda place: place.source):  # numbered in firing order
            if place.kind != "idle" and place.source and times[place.target] - times[place.source] < EPSILON:
                rounds[place.target] = max(rounds[place.target], rounds[place.source] + 1)
        return {point: rounds[transition] for point, transition in self.at.items()}


class Assembler:
    """Makes the net of a block.

    chains: in document order. waited_for: behaviors that the end of the block waits for.
    """

    def __init__(
        self, chains: Mapping[str, Chain], relations: Relations, classes: Classes, waited_for: frozenset[str]
    ) -> None:
        self.chains = chains
        self.relations = relations
        self.classes = classes
        self.waited_for = waited_for
        self.waived: set[tuple[str, str]] = set()
        # All that does not depend on an arrangement.
        foreign = sorted(point for point in relations.named if ":" in point.behavior)
        own = [point for id in sorted(chains) for point in chains[id].points]
        self.placed = relations.placed
        found = instants(self.classes, [ORIGIN, *foreign, *own])
        # The start of the block first; the others keep their canonical order.
        found.sort(key=lambda instant: ORIGIN not in instant.points)
        self.size = len(found)
        self.at = {point: number for number, instant in enumerate(found) for point in instant.points}
        self.members = [self._members(instant.points) for instant in found]
        self.kinds = {
            (each.behavior, number): each.kind for number, members in enumerate(self.members) for each in members
        }
        self.transitions = [
            *(Transition(" = ".join(map(str, instant.points)), instant.points) for instant in found),
            Transition("bml:end", ()),
        ]
        self.stations = {id: [self.at[point] for point in each.points] for id, each in chains.items()}
        """The transitions of the points of each behavior."""
        self.places: list[Place] = []
        self.bounds: list[Bound] = []
        self._class_delays(found)
        for relation in relations.orders:
            self._order(relation)
        self._waits = list(self._waits_for_orders(frozenset(self.at[point] for point in foreign)))
        self._fixed = (self.places, self.bounds)
        self._phases: dict[tuple[str, int | None], tuple[list[Place], list[Bound]]] = {}
        """Those of each behavior, cut at a segment."""
        speeches = [each for each in chains.values() if each.type == "speech"]
        self._voiced = {id for pair in self._neighbors(each.behavior.id for each in speeches) for id in pair}
        """Speeches that share a voice with others."""

    def assemble(self, arrangement: Arrangement) -> Assembly:
        """The net for this arrangement."""
        self.arrangement = arrangement
        places, bounds = self._fixed
        self.places, self.bounds = list(places), list(bounds)
        for each in [(id, arrangement.cuts.get(id)) for id in sorted(self.chains)]:
            if each not in self._phases:
                self._phases[each] = self._phases_of(*each)
            places, bounds = self._phases[each]
            self.places += places
            self.bounds += bounds
        self._series()
        self._arranged()
        self._never_too_soon()
        self._ending(self.size)
        return self._in_firing_order()

    def _members(self, points: tuple[Point, ...]) -> tuple[Member, ...]:
        if len(points) == 1 and (alone := self.chains.get(points[0].behavior)):
            return (Member(alone.behavior.id, self._gate(alone, (points[0].sync,)), points[0]),)
        groups: dict[str, list[str]] = {}
        for behavior, sync in points:
            groups.setdefault(behavior, []).append(sync)
        members = []
        for id, syncs in groups.items():
            if chain := self.chains.get(id):
                ordered = tuple(syncs)
                members.append(Member(id, self._gate(chain, ordered), Point(id, gate_point(chain.type, ordered))))
            elif id:
                members.append(Member(id, "passive", Point(id, syncs[0])))
        return tuple(members)

    def _gate(self, chain: Chain, syncs: tuple[str, ...]) -> Gate:
        """Kind of a point, by `gate`; but a movement of which nobody says when it comes begins with the block, and
        waits."""
        kind = gate(chain.type, syncs)
        is_anytime = kind == "prompt" and chain.type in WITH_STROKE and chain.behavior.id not in self.placed
        return "hold" if is_anytime else kind

    def _class_delays(self, found: list[Instant]) -> None:
        by_class: dict[int, list[tuple[Seconds, int]]] = {}
        for number, instant in enumerate(found):
            by_class.setdefault(instant.class_id, []).append((instant.offset, number))
        for number, instant in enumerate(found):
            if instant.at is not None and instant.offset == 0.0 and number:
                self._clock(number, round(instant.at, 9))
        for ladder in by_class.values():
            for (low, source), (high, target) in pairwise(sorted(ladder)):
                seconds = round(high - low, 9)
                self.places.append(Place("delay", source, target, seconds, seconds))
                self.bounds.append(Bound("delay", target, source, -seconds))

    def _clock(self, number: int, at: Seconds) -> None:
        """Tie an instant to the block's start by `at` seconds, whatever else is late."""
        if at >= 0.0:
            self.places.append(Place("delay", 0, number, at, at))
        self.bounds.append(Bound("delay", number, 0, -at))

    def _phases_of(self, id: str, cut: int | None) -> tuple[list[Place], list[Bound]]:
        """Places and bounds between the points of a behavior. cut: first segment that is not given its time."""
        chain, stations, places, bounds = self.chains[id], self.stations[id], list[Place](), list[Bound]()
        lines = _lines(chain.behavior.line)
        always = {pair for group in TYPES[chain.type].one_instant for pair in pairwise(group)}
        if stations[0] != 0:
            places.append(Place("order", 0, stations[0], behavior=id, lines=lines))
        way, lag, shortest, longest = 0.0, 0.0, 0.0, 0.0
        unlimited = False
        for number, segment in enumerate(chain.segments):
            source, target = stations[number], stations[number + 1]
            gone = cut is not None and number >= cut
            limit = chain.longest[number]
            way += segment.natural
            if not gone:
                lag += segment.natural
                shortest += segment.shortest
                longest += limit if limit is not None else segment.natural
                unlimited = unlimited or (limit is None and source != target)
            if (segment.since, segment.to) in always or (source == target and shortest <= EPSILON):
                continue
            places.append(Place("phase", source, target, lag, shortest, id, lines))
            kind = self.kinds[id, target]
            if not gone and source != target and kind != "hold":
                stretch = None if unlimited or kind == "prompt" else max(0.0, longest - lag)
                reserve = RESERVE * way if kind == "prompt" and chain.type in WITH_STROKE else 0.0
                bounds.append(Bound("phase", target, source, -lag - reserve, stretch, id, lines))
            lag, shortest, longest, unlimited = 0.0, 0.0, 0.0, False
        return places, bounds

    def _order(self, relation: Order) -> None:
        earlier, later = relation.earlier, relation.later
        if earlier.point not in self.at or later.point not in self.at:
            return
        source, target = self.at[earlier.point], self.at[later.point]
        seconds = round(earlier.offset - later.offset, 9)
        lines = _lines(earlier.line, later.line)
        if source == target and seconds <= EPSILON:
            return
        if seconds >= 0 and target:
            self.places.append(Place("order", source, target, seconds, seconds, lines=lines))
        else:
            self.bounds.append(Bound("order", source, target, seconds, lines=lines))

    def _series(self) -> None:
        """Put a behavior of which nobody says when it comes after the previous of its series (thesis 4.5.2).

        Nothing waits for it. Speeches share a voice: each follows those before it, whatever is said about them.
        """
        self._speak_in_turn()
        previous: dict[str, Chain] = {}
        for id, chain in self.chains.items():
            series = SERIES[chain.type]
            before = previous.get(series)
            previous[series] = chain
            is_placed = id in self.placed or id in self._voiced or id in self.arrangement.begun
            if before is None or is_placed or performer(chain.behavior) == "recognition":
                continue
            other, sync, seconds = before.behavior.id, "end", 0.0
            if other in self.arrangement.natural:
                # The previous one lasts until this one takes over, which is as soon as the previous is on target.
                sync = "stroke"
                seconds = sum(each.natural for each in before.segments if each.since in ("stroke", "stroke_end"))
            source, target = self.at[Point(other, sync)], self.stations[id][0]
            if source != target and self._names(source, target) not in self.waived:
                lines = _lines(chain.behavior.line)
                self.places.append(Place("series", source, target, seconds, seconds, "", lines, other))

    def _speak_in_turn(self) -> None:
        """Put each speech after the one before it on its voice."""
        for earlier, later in self._neighbors(self.arrangement.spoken):
            chain = self.chains[later]
            if not is_tied(chain, self.chains[earlier], self.classes):
                lines = _lines(chain.behavior.line)
                self._follow(Point(earlier, "end"), chain.points[0], later, lines)

    def _neighbors(self, speeches: Iterable[str]) -> Iterator[tuple[str, str]]:
        """Speeches of one voice, each with the next."""
        last: dict[str, str] = {}
        for id in speeches:
            parts = self.chains[id].parts
            yield from ((earlier, id) for earlier in dict.fromkeys(last[part] for part in parts if part in last))
            last |= dict.fromkeys(parts, id)

    def _arranged(self) -> None:
        for later, earlier in self.arrangement.turns:
            self._follow(earlier, Point(later, "start"), later)
        for handovers in self.arrangement.handovers.values():
            for successor, kept in handovers:
                self._follow(kept, Point(successor, "start"), successor)
        for id, (successor, point) in self.arrangement.successors.items():
            kind: PlaceKind = "series" if id in self.arrangement.natural else "handover"
            self._follow(Point(successor, "start"), point, id, kind=kind)
        others = [id for id in self.chains if id in self.waited_for and id not in self.arrangement.natural]
        for id in self.arrangement.lasting:
            for last in filter(None, [self.arrangement.lasts_for(id, self.chains[other]) for other in others]):
                self._follow(last, Point(id, "relax"), id)

    def _follow(
        self,
        before: Point,
        point: Point,
        behavior: str,
        lines: tuple[int, ...] = (),
        kind: PlaceKind = "series",
    ) -> None:
        source, target, after = self.at[before], self.at[point], before.behavior if kind == "series" else ""
        if source != target:
            self.places.append(Place(kind, source, target, 0.0, 0.0, behavior, lines, after))

    def _waits_for_orders(self, foreign: Container[int]) -> Iterator[Place]:
        """Make sure of orders on points that cannot wait: the behavior waits where it last can before such a point.

        Prediction must do instead if others of the instant wait for another block. (Words after that block's words do
        not wait for a stroke, too.) foreign: transitions of other blocks.
        """
        for place in self.places:
            members = self.members[place.target]
            is_promised = place.source in foreign and any(each.kind != "passive" for each in members)
            for member in members if place.kind == "order" and place.source != 0 and not is_promised else ():
                if member.kind == "passive" and (chain := self.chains.get(member.behavior)):
                    waits_at, seconds = self._last_wait(chain, place.target)
                    lag = max(0.0, round(place.lag - seconds, 9))
                    yield Place("order", place.source, waits_at, lag, lag, member.behavior, place.lines)

    def _never_too_soon(self) -> None:
        """Add the waits for orders, unless the awaited one waits for them in turn, or there is no time."""
        waits = [each for each in self._waits if self._names(each.source, each.target) not in self.waived]
        if not waits:
            return
        out: dict[int, list[int]] = {}
        for place in (*self.places, *waits):
            out.setdefault(place.source, []).append(place.target)
        groups = components(self.size, out)
        circle = {each: number for number, group in enumerate(groups) for each in group}
        self.places += [place for place in waits if circle[place.source] != circle[place.target]]

    def _names(self, *ends: int) -> tuple[str, ...]:
        return tuple([self.transitions[each].name for each in ends])

    def waive(self, ties: Iterable[tuple[str, str]]) -> None:
        """Leave out these waits from now on; see `Assembly.waits`."""
        self.waived |= set(ties)

    def _last_wait(self, chain: Chain, transition: int) -> tuple[int, Seconds]:
        """The last transition before `transition` where the behavior can wait, and the seconds from there."""
        stations = self.stations[chain.behavior.id]
        seconds = 0.0
        for number in range(stations.index(transition) - 1, -1, -1):
            seconds += chain.segments[number].natural
            here = stations[number]
            if here != transition and self.kinds[chain.behavior.id, here] != "passive":
                return here, seconds
        return stations[0], seconds

    def _ending(self, end: int) -> None:
        """Let everything follow the start and lead to the end, so that nothing can happen twice.

        A behavior that may outlast the block holds a token from its own end to its start: so it begins once, too.
        """
        self.places.append(Place("order", 0, end))
        for id, (start, *_, last) in self.stations.items():
            is_awaited = id in self.waited_for
            self.places.append(Place("order", last if is_awaited else start, end, behavior=id))
            if not is_awaited:
                self.places.append(Place("idle", last, start, behavior=id))
        fed = {place.target for place in self.places if place.kind != "idle"}
        left = {place.source for place in self.places}
        self.places += [Place("order", 0, each) for each in range(1, end) if each not in fed]
        self.places += [Place("order", each, end) for each in range(end) if each not in left]
        self.places.append(Place("idle", end, 0))

    def _in_firing_order(self) -> Assembly:
        net, ranked, self._unfired = numbered(self.transitions, self.places, self.bounds)
        number = {old: new for new, old in enumerate(ranked)}
        at = {point: number[each] for point, each in self.at.items()}
        members = tuple([self.members[each] if each < self.size else () for each in ranked])
        return Assembly(prolonged(net, members, self.chains, self.arrangement.stops), not self._unfired, at, members)

    def circles(self) -> list[list[Point]]:
        """Points that wait for each other in a circle of no length, so are one instant: circular synchronization."""
        out: dict[int, list[int]] = {}
        for place in self.places:
            if place.shortest <= EPSILON and place.source in self._unfired and place.kind != "idle":
                out.setdefault(place.source, []).append(place.target)
        groups = [group for group in components(len(self.transitions), out) if len(group) > 1]
        return [[self.transitions[each].points[0] for each in group if each < self.size] for group in groups]


def _lines(*lines: int) -> tuple[int, ...]:
    return tuple(sorted(set(lines) - {0}))
