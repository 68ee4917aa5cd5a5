"""Relations between points, assembled into a Petri net: the middle part of planning."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise

from msgspec import Struct

from engage_hri.schemas.behavior_types import SERIES, TYPES
from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.net.petri_net import Bound, PetriNet, Place, PlaceKind, Transition
from engage_hri.services.realizer.plan.cycles import components
from engage_hri.services.realizer.plan.handover import Arrangement, is_tied
from engage_hri.services.realizer.plan.instants import Classes, Instant, instants
from engage_hri.services.realizer.plan.numbering import numbered
from engage_hri.services.realizer.plan.phases import RESERVE, Chain
from engage_hri.services.realizer.plan.relations import Order, Relations
from engage_hri.services.realizer.plan.stops import prolonged
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
        self.places: list[Place] = []
        self.bounds: list[Bound] = []
        self._class_delays(found)
        for relation in relations.orders:
            self._order(relation)
        self._foreign = frozenset(self.at[point] for point in foreign)
        self._fixed = (self.places, self.bounds)

    def assemble(self, arrangement: Arrangement) -> Assembly:
        """The net for this arrangement."""
        self.arrangement = arrangement
        places, bounds = self._fixed
        self.places, self.bounds = list(places), list(bounds)
        for id in sorted(self.chains):
            self._phases(self.chains[id])
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

    def _phases(self, chain: Chain) -> None:
        id, lines, at = chain.behavior.id, _lines(chain.behavior.line), self.at
        always = {pair for group in TYPES[chain.type].one_instant for pair in pairwise(group)}
        cut = self.arrangement.cuts.get(id)
        if (start := at[chain.points[0]]) != 0:
            self.places.append(Place("order", 0, start, behavior=id, lines=lines))
        way, lag, shortest, longest = 0.0, 0.0, 0.0, 0.0
        unlimited = False
        for number, segment in enumerate(chain.segments):
            source, target = at[chain.points[number]], at[chain.points[number + 1]]
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
            self.places.append(Place("phase", source, target, lag, shortest, id, lines))
            kind = self.kinds[id, target]
            if not gone and source != target and kind != "hold":
                stretch = None if unlimited or kind == "prompt" else max(0.0, longest - lag)
                reserve = RESERVE * way if kind == "prompt" and chain.type in WITH_STROKE else 0.0
                self.bounds.append(Bound("phase", target, source, -lag - reserve, stretch, id, lines))
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
        if seconds >= 0 and target:
            self.places.append(Place("order", source, target, seconds, seconds, lines=lines))
        else:
            self.bounds.append(Bound("order", source, target, seconds, lines=lines))

    def _series(self) -> None:
        """Put a behavior of which nobody says when it comes after the previous of its series (thesis 4.5.2).

        Nothing waits for it. Speeches share a voice: each follows those before it, whatever is said about them.
        """
        sharing = self._speak_in_turn()
        previous: dict[str, Chain] = {}
        for id, chain in self.chains.items():
            series = SERIES[chain.type]
            before = previous.get(series)
            previous[series] = chain
            is_placed = id in self.relations.placed or id in sharing or id in self.arrangement.begun
            if before is None or is_placed or performer(chain.behavior) == "recognition":
                continue
            other, sync, seconds = before.behavior.id, "end", 0.0
            if other in self.arrangement.natural:
                # The previous one lasts until this one takes over, which is as soon as the previous is on target.
                sync = "stroke"
                seconds = sum(each.natural for each in before.segments if each.since in ("stroke", "stroke_end"))
            ends = Point(other, sync), Point(id, "start")
            if (self._name(self.at[ends[0]]), self._name(self.at[ends[1]])) not in self.waived:
                self._follow(*ends, seconds, lines=_lines(chain.behavior.line))

    def _speak_in_turn(self) -> set[str]:
        """Put each speech after the one before it on its voice. Returns those that share a voice."""
        for earlier, later in self._neighbors(self.arrangement.spoken):
            chain = self.chains[later]
            if not is_tied(chain, self.chains[earlier], self.classes):
                lines = _lines(chain.behavior.line)
                self._follow(Point(earlier, "end"), chain.points[0], behavior=later, lines=lines)
        speeches = [id for id, chain in self.chains.items() if chain.type == "speech"]
        return {id for pair in self._neighbors(speeches) for id in pair}

    def _neighbors(self, speeches: Iterable[str]) -> Iterator[tuple[str, str]]:
        """Speeches of one voice, each with the next."""
        last: dict[str, str] = {}
        for id in speeches:
            parts = self.chains[id].parts
            yield from ((earlier, id) for earlier in dict.fromkeys(last[part] for part in parts if part in last))
            last |= dict.fromkeys(parts, id)

    def _arranged(self) -> None:
        for later, earlier in self.arrangement.turns:
            self._follow(earlier, Point(later, "start"), behavior=later)
        for handovers in self.arrangement.handovers.values():
            for successor, kept in handovers:
                self._follow(kept, Point(successor, "start"), behavior=successor)
        for id, (successor, point) in self.arrangement.successors.items():
            kind: PlaceKind = "series" if id in self.arrangement.natural else "handover"
            self._follow(Point(successor, "start"), point, behavior=id, kind=kind)
        others = [id for id in self.chains if id in self.waited_for and id not in self.arrangement.natural]
        for id in self.arrangement.lasting:
            for last in filter(None, [self.arrangement.lasts_for(id, self.chains[other]) for other in others]):
                self._follow(last, Point(id, "relax"), behavior=id)

    def _follow(
        self,
        before: Point,
        point: Point,
        seconds: Seconds = 0.0,
        *,
        behavior: str = "",
        lines: tuple[int, ...] = (),
        kind: PlaceKind = "series",
    ) -> None:
        source, target, after = self.at[before], self.at[point], before.behavior if kind == "series" else ""
        if source != target:
            self.places.append(Place(kind, source, target, seconds, seconds, behavior, lines, after))

    def _never_too_soon(self) -> None:
        """Make sure of orders on points that cannot wait: the behavior waits where it last can before such a point.

        Prediction must do instead if the awaited one waits for it in turn, if there is no time, or if others of the
        instant wait for another block. (Words after that block's words do not wait for a stroke, too.)
        """
        waits = []
        for place in self.places:
            if place.source in self._foreign and any(each.kind != "passive" for each in self.members[place.target]):
                continue
            if place.kind == "order" and place.source != 0:
                for member in self.members[place.target]:
                    if member.kind == "passive" and (chain := self.chains.get(member.behavior)):
                        waits_at, seconds = self._last_wait(chain, place.target)
                        lag = max(0.0, round(place.lag - seconds, 9))
                        wait = Place("order", place.source, waits_at, lag, lag, member.behavior, place.lines)
                        if (self._name(place.source), self._name(waits_at)) not in self.waived:
                            waits.append(wait)
        if not waits:
            return
        out: dict[int, list[int]] = {}
        for place in (*self.places, *waits):
            out.setdefault(place.source, []).append(place.target)
        groups = components(self.size, out)
        circle = {each: number for number, group in enumerate(groups) for each in group}
        self.places += [place for place in waits if circle[place.source] != circle[place.target]]

    def _name(self, transition: int) -> str:
        return self.transitions[transition].name

    def waive(self, ties: Iterable[tuple[str, str]]) -> None:
        """Leave out these waits from now on; see `Assembly.waits`."""
        self.waived |= set(ties)

    def _last_wait(self, chain: Chain, transition: int) -> tuple[int, Seconds]:
        """The last transition before `transition` where the behavior can wait, and the seconds from there."""
        stations = [self.at[point] for point in chain.points]
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
        for id, chain in self.chains.items():
            start, last = self.at[chain.points[0]], self.at[chain.points[-1]]
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
        net, ranked, is_ordered = numbered(self.transitions, self.places, self.bounds)
        number = {old: new for new, old in enumerate(ranked)}
        at = {point: number[each] for point, each in self.at.items()}
        members = tuple([self.members[each] if each < self.size else () for each in ranked])
        return Assembly(prolonged(net, members, self.chains, self.arrangement.stops), is_ordered, at, members)

    def circles(self) -> list[list[Point]]:
        """Points that wait for each other in a circle of no length, so are one instant: circular synchronization."""
        out: dict[int, list[int]] = {}
        for place in self.places:
            if place.kind != "idle" and place.shortest <= EPSILON:
                out.setdefault(place.source, []).append(place.target)
        groups = [group for group in components(len(self.transitions), out) if len(group) > 1]
        return [[self.transitions[each].points[0] for each in group if each < self.size] for group in groups]


def _lines(*lines: int) -> tuple[int, ...]:
    return tuple(sorted(set(lines) - {0}))
