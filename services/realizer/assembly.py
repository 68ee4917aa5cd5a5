"""Relations between points, assembled into a Petri net: the middle part of planning."""

from collections.abc import Mapping
from itertools import pairwise

from msgspec import Struct

from schemas.behaviors import Behavior, BlockBehavior
from schemas.units import Seconds
from services.realizer.classes import Classes, Instant, instants
from services.realizer.net import Bound, PetriNet, Place, Transition, order
from services.realizer.points import (
    ON_TARGET,
    ORIGIN,
    Gate,
    Point,
    Segment,
    family,
    gate,
    gate_point,
    one_instant,
    performer,
    sync_points,
    type_of,
)
from services.realizer.relations import Equal, Order, Relations, Term
from services.realizer.schedule import EPSILON


class Member(Struct, frozen=True):
    """A behavior's part in an instant: how it can be made to wait there, and the point whose report counts."""

    behavior: str
    kind: Gate
    point: Point


class Chain(Struct, frozen=True):
    """A behavior with the seconds between its points."""

    behavior: BlockBehavior
    segments: tuple[Segment, ...]
    longest: tuple[Seconds | None, ...]
    """Of each segment; None: it can be stretched without limit."""

    @property
    def points(self) -> tuple[Point, ...]:
        return tuple(Point(self.behavior.id, sync) for sync in sync_points(self.behavior))


class Assembly(Struct, frozen=True):
    net: PetriNet
    at: Mapping[Point, int]
    """The transition of each point."""
    members: tuple[tuple[Member, ...], ...]
    """Of each transition."""


def ends_naturally(chain: Chain, named: frozenset[Point]) -> bool:
    """Does it last until something else takes its place or ends? True if nobody has said when it ends."""
    if type_of(chain.behavior) not in ON_TARGET:
        return False
    return not any(Point(chain.behavior.id, sync) in named for sync in ("stroke_end", "relax", "end"))


class Assembler:
    """chains: in document order. successors: of a behavior that ends naturally, who takes its place.

    cut: behaviors that are not given the time to go home, because their successor has begun by then.
    """

    def __init__(
        self,
        block: str,
        chains: Mapping[str, Chain],
        relations: Relations,
        classes: Classes,
        successors: Mapping[str, str],
        cut: frozenset[str],
        waited_for: frozenset[str],
    ) -> None:
        self.block = block
        self.chains = chains
        self.relations = relations
        self.classes = classes
        self.successors = successors
        self.cut = cut
        self.waited_for = waited_for
        """Behaviors that the end of the block waits for."""
        self.natural = {id for id, chain in chains.items() if ends_naturally(chain, relations.named)}
        self.places: list[Place] = []
        self.bounds: list[Bound] = []

    def assemble(self) -> Assembly:
        foreign = sorted(point for point in self.relations.named if ":" in point.behavior)
        own = [point for id in sorted(self.chains) for point in self.chains[id].points]
        for chain in self.chains.values():
            for syncs in one_instant(type_of(chain.behavior)):
                points = [Term(Point(chain.behavior.id, sync), 0.0, f"{chain.behavior.id}:{sync}") for sync in syncs]
                self.classes.tie(Equal(tuple(points)), self.block)
        found = instants(self.classes, [ORIGIN, *foreign, *own])
        # The start of the block first; the others keep their canonical order.
        found.sort(key=lambda instant: ORIGIN not in instant.points)
        self.at = {point: number for number, instant in enumerate(found) for point in instant.points}
        self.members = tuple(self._members(instant) for instant in found)
        self._class_delays(found)
        for id in sorted(self.chains):
            self._phases(self.chains[id])
        for relation in self.relations.orders:
            self._order(relation)
        self._series()
        self._natural_ends()
        self._never_too_soon()
        end = len(found)
        self._ending(end)
        transitions = [Transition(" = ".join(map(str, instant.points)), instant.points) for instant in found]
        transitions.append(Transition("bml:end", ()))
        places = sorted(set(self.places), key=_place_order)
        net = PetriNet(
            tuple(transitions), (*places, Place("idle", end, 0)), tuple(sorted(self.bounds, key=_bound_order))
        )
        return Assembly(net, self.at, (*self.members, ()))

    def _members(self, instant: Instant) -> tuple[Member, ...]:
        groups: dict[str, list[str]] = {}
        for point in instant.points:
            groups.setdefault(point.behavior, []).append(point.sync)
        members = []
        for id, syncs in groups.items():
            if chain := self.chains.get(id):
                type = type_of(chain.behavior)
                kind, sync = gate(type, tuple(syncs)), gate_point(type, tuple(syncs))
                members.append(Member(id, kind, Point(id, sync)))
            elif id:
                members.append(Member(id, "passive", Point(id, syncs[0])))
        return tuple(members)

    def _class_delays(self, found: list[Instant]) -> None:
        by_class: dict[int, list[tuple[Seconds, int]]] = {}
        for instant in found:
            by_class.setdefault(instant.class_id, []).append((instant.offset, self.at[instant.points[0]]))
        for ladder in by_class.values():
            for (low, source), (high, target) in pairwise(sorted(ladder)):
                seconds = round(high - low, 9)
                self.places.append(Place("delay", source, target, seconds, seconds))
                self.bounds.append(Bound("delay", target, source, -seconds))

    def _phases(self, chain: Chain) -> None:
        id, type = chain.behavior.id, type_of(chain.behavior)
        always = {pair for group in one_instant(type) for pair in pairwise(group)}
        lines = _lines(chain.behavior.line)
        if (start := self.at[Point(id, "start")]) != 0:
            self.places.append(Place("order", 0, start, behavior=id, lines=lines))
        lag, shortest, longest = 0.0, 0.0, 0.0
        unlimited = False
        for segment, limit in zip(chain.segments, chain.longest, strict=True):
            gone = id in self.cut and (segment.since == "relax" or segment.to == "relax")
            lag += 0.0 if gone else segment.natural
            shortest += 0.0 if gone else segment.shortest
            longest += limit if limit is not None else segment.natural
            unlimited = unlimited or limit is None
            source, target = self.at[Point(id, segment.since)], self.at[Point(id, segment.to)]
            if (segment.since, segment.to) in always or (source == target and shortest <= EPSILON):
                continue
            self.places.append(Place("phase", source, target, lag, shortest, id, lines))
            can_wait = any(each.behavior == id and each.kind == "hold" for each in self.members[target])
            if not can_wait and source != target:
                stretch = None if unlimited else max(0.0, longest - lag)
                self.bounds.append(Bound("phase", target, source, -lag, stretch, id, lines))
            lag, shortest, longest, unlimited = 0.0, 0.0, 0.0, False

    def _order(self, relation: Order) -> None:
        earlier, later = relation.earlier, relation.later
        if earlier.point not in self.at or later.point not in self.at:
            return
        source, target = self.at[earlier.point], self.at[later.point]
        seconds = round(earlier.offset - later.offset, 9)
        lines = _lines(earlier.line, later.line)
        if source == target and seconds <= EPSILON:
            return
        if seconds >= 0:
            self.places.append(Place("order", source, target, seconds, seconds, lines=lines))
        else:
            self.bounds.append(Bound("order", source, target, seconds, lines=lines))

    def _series(self) -> None:
        """Thesis 4.5.2: what nothing is said about follows the previous of its type. Nothing waits for it."""
        named = {point.behavior for point in self.relations.named}
        previous: dict[str, Chain] = {}
        for id, chain in self.chains.items():
            type = type_of(chain.behavior)
            before = previous.get(type)
            previous[type] = chain
            if before is None or id in named or performer(chain.behavior) != "body":
                continue
            other = before.behavior.id
            sync, seconds = "end", 0.0
            if other in self.natural:
                # It would last until this one takes over: this one does as soon as it is on target.
                sync = "stroke"
                seconds = sum(each.natural for each in before.segments if each.since in ("stroke", "stroke_end"))
            source, target = self.at[Point(other, sync)], self.at[Point(id, "start")]
            self.places.append(Place("series", source, target, seconds, seconds, lines=_lines(chain.behavior.line)))

    def _natural_ends(self) -> None:
        others = [id for id in self.chains if id in self.waited_for and id not in self.natural]
        for id in sorted(self.natural):
            target = self.at[Point(id, "relax")]
            if (successor := self.successors.get(id)) is not None:
                self.places.append(Place("series", self.at[Point(successor, "start")], target, behavior=id))
                continue
            for other in others:
                end = self.at[self.chains[other].points[-1]]
                self.places.append(Place("series", end, target, behavior=id))

    def _never_too_soon(self) -> None:
        """An order on a point that cannot wait is kept for certain by where its behavior can: it waits there.

        Unless what it would wait for waits for it in turn; then prediction must do.
        """
        for place in [place for place in self.places if place.kind == "order" and place.source != 0]:
            for member in self.members[place.target]:
                if member.kind != "passive" or member.behavior not in self.chains:
                    continue
                waits_at, seconds = self._last_wait(self.chains[member.behavior], place.target)
                if not self._leads_to(waits_at, place.source):
                    lag = max(0.0, round(place.lag - seconds, 9))
                    self.places.append(Place("order", place.source, waits_at, lag, lag, lines=place.lines))

    def _last_wait(self, chain: Chain, transition: int) -> tuple[int, Seconds]:
        """Where the behavior can last wait before `transition`, and how long it takes from there."""
        points = chain.points
        reached = next(number for number, point in enumerate(points) if self.at[point] == transition)
        seconds = 0.0
        for number in range(reached - 1, -1, -1):
            seconds += chain.segments[number].natural
            here = self.at[points[number]]
            if here != transition and any(
                each.behavior == chain.behavior.id and each.kind != "passive" for each in self.members[here]
            ):
                return here, seconds
        return self.at[points[0]], seconds

    def _leads_to(self, source: int, target: int) -> bool:
        out: dict[int, list[int]] = {}
        for place in self.places:
            out.setdefault(place.source, []).append(place.target)
        seen, todo = {source}, [source]
        while todo:
            here = todo.pop()
            if here == target:
                return True
            fresh = set(out.get(here, ())) - seen
            seen |= fresh
            todo += fresh
        return False

    def _ending(self, end: int) -> None:
        self.places.append(Place("order", 0, end))
        for id in sorted(self.waited_for & self.chains.keys()):
            self.places.append(Place("order", self.at[self.chains[id].points[-1]], end, behavior=id))


def equal_by_order(net: PetriNet) -> list[list[int]]:
    """Transitions that wait for each other in a circle of no length: circular synchronization, so one instant."""
    if order(net) is not None:
        return []
    out: dict[int, list[int]] = {}
    for place in net.places:
        if place.kind != "idle" and place.shortest <= EPSILON:
            out.setdefault(place.source, []).append(place.target)
    return [group for group in _strong_components(len(net.transitions), out) if len(group) > 1]


def _strong_components(size: int, out: Mapping[int, list[int]]) -> list[list[int]]:
    """Kosaraju, without recursion."""
    into: dict[int, list[int]] = {}
    for source, targets in out.items():
        for target in targets:
            into.setdefault(target, []).append(source)
    finished: list[int] = []
    seen: set[int] = set()
    for root in range(size):
        stack = [(root, iter(out.get(root, [])))] if root not in seen else []
        seen.add(root)
        while stack:
            here, rest = stack[-1]
            step = next((each for each in rest if each not in seen), None)
            if step is None:
                finished.append(here)
                stack.pop()
            else:
                seen.add(step)
                stack.append((step, iter(out.get(step, []))))
    groups = []
    taken: set[int] = set()
    for root in reversed(finished):
        if root in taken:
            continue
        taken.add(root)
        group: list[int] = []
        todo = [root]
        while todo:
            group.append(here := todo.pop())
            unseen = [each for each in into.get(here, []) if each not in taken]
            taken.update(unseen)
            todo += unseen
        groups.append(sorted(group))
    return groups


def same_part(one: Behavior, other: Behavior) -> bool:
    return family(type_of(one)) == family(type_of(other))


def _lines(*lines: int) -> tuple[int, ...]:
    return tuple(sorted(set(lines) - {0}))


def _place_order(place: Place) -> tuple[int, int, str, Seconds, str, tuple[int, ...]]:
    return (place.source, place.target, place.kind, place.lag, place.behavior, place.lines)


def _bound_order(bound: Bound) -> tuple[int, int, str, Seconds, str, tuple[int, ...]]:
    return (bound.source, bound.target, bound.kind, bound.lag, bound.behavior, bound.lines)
