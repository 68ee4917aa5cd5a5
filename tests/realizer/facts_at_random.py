"""Random nets and random facts about them, told to a forecast and to a model, which relaxes all of it anew each time.

The model holds what was told in plain tables: no causes, no effects, no order of looking.
"""

import random
from collections.abc import Iterable
from itertools import pairwise

from msgspec import Struct, field
from msgspec.structs import replace

from engage_hri.schemas.blocks import Block
from engage_hri.services.realizer.foresee.forecast import Forecast
from engage_hri.services.realizer.net.petri_net import Bound, PetriNet, Place, Transition
from engage_hri.services.realizer.plan.planner import Plan
from engage_hri.services.realizer.plan.relations import Relations
from engage_hri.services.realizer.points import Point

BEGAN = 10.0


class Arc(Struct):
    source: int
    target: int
    seconds: float
    least: float
    behavior: str
    is_bound: bool
    after: str


class Model(Struct):
    """What is known of a running net. base: no earlier than that. passed: when behaviors passed transitions.

    latest: when the first passed a transition that a bound holds back, other than on a phase of its own. Who is left
    there is not expected to wait any longer (docs/decisions/0043), if a phase can be slower for that, or one can be
    shorter that the plan makes shorter.
    planned: seconds from the start of the block to each transition, in the plan.
    """

    net: PetriNet
    factor: dict[str, float]
    planned: tuple[float, ...]
    foreseen: dict[int, float] = field(default_factory=dict)
    facts: dict[int, float] = field(default_factory=lambda: {0: BEGAN})
    base: dict[int, float] = field(default_factory=dict)
    there: dict[int, float] = field(default_factory=dict)
    passed: dict[tuple[str, int], float] = field(default_factory=dict)
    latest: dict[int, float] = field(default_factory=dict)
    come: set[tuple[str, int]] = field(default_factory=set)
    prolonged: dict[tuple[int, int], float] = field(default_factory=dict)

    @property
    def size(self) -> int:
        return len(self.net.transitions)

    @property
    def ties(self) -> list[Place | Bound]:
        return [each for each in self.net.places if each.kind != "idle"] + [*self.net.bounds]

    def arrive(self, behavior: str, transition: int, at: float) -> None:
        """It is there now: that it was overdue matters no more."""
        self.there[transition] = max(at, self.there.get(transition, BEGAN))
        is_first = any(
            each.kind == "phase" and (each.behavior, each.target) == (behavior, transition)
            for each in self.net.places
        )
        if is_first and (behavior, transition) not in self.come:
            self.come.add((behavior, transition))
            self.base[transition] = self.there[transition]
        else:
            self.base[transition] = max(at, self.base.get(transition, BEGAN))

    def leave(self, behavior: str, transition: int, at: float) -> None:
        """It has passed the transition."""
        self.arrive(behavior, transition, at)
        self.passed[behavior, transition] = at
        waiting = {each.behavior for each in self.arcs() if each.is_bound and each.target == transition}
        if transition not in self.facts and any((each, transition) not in self.passed for each in waiting):
            self.latest.setdefault(transition, at)

    def late(self, times: list[float]) -> set[int]:
        """Transitions that others are to pass later, by these times, than the first has."""
        return {each for each, at in self.latest.items() if each not in self.facts and times[each] > at + 1e-6}

    def bent(self, arcs: Iterable[Arc], times: list[float] | None = None) -> list[Arc]:
        """With phases that are slower than is natural, and shorter where the plan has them so: as these times need
        it; without these, as much as can be."""
        found = []
        for arc in arcs:
            is_slower = arc.is_bound and arc.behavior and self._fixed(arc) is None
            if is_slower or (arc.behavior and not arc.is_bound and self._is_hurried(arc)):
                begun = self.passed.get((arc.after, arc.source)) if arc.after else None
                since = 0.0 if times is None else times[arc.source] if begun is None else begun
                seconds = arc.least if times is None else max(arc.least, times[arc.target] - since)
                arc = replace(arc, seconds=min(arc.seconds, seconds))
            found.append(arc)
        return found

    def _is_hurried(self, arc: Arc) -> bool:
        """True for a phase that the plan makes shorter than is natural."""
        natural = next(
            each.lag
            for each in self.net.places
            if (each.kind, each.behavior, each.source) == ("phase", arc.behavior, arc.source)
        )
        return self.planned[arc.target] - self.planned[arc.source] < natural

    def arcs(self) -> list[Arc]:
        """All that holds now; a phase that has begun counts from then, and one that has ended not at all."""
        found = []
        for each in self.ties:
            is_bound, phase = isinstance(each, Bound), each.kind == "phase"
            factor = self.factor.get(each.behavior, 1.0) if phase else 1.0
            least = each.lag
            if isinstance(each, Place):
                least = each.shortest
            elif phase:
                least = -1e6 if each.stretch is None else each.lag - each.stretch
            since, to = (each.target, each.source) if is_bound else (each.source, each.target)
            longer = 0.0 if phase else self.prolonged.get((since, to), 0.0) * (-1 if is_bound else 1)
            arc = Arc(
                each.source,
                each.target,
                each.lag * factor + longer,
                least * factor + longer,
                each.behavior if phase else "",
                is_bound,
                "" if is_bound else each.behavior if phase else each.after,
            )
            if phase and not is_bound and (each.behavior, each.target) in self.come:
                continue
            if phase and is_bound and (each.behavior, each.source) in self.passed:
                continue
            found.append(arc)
        return [arc for arc in found if not (arc.is_bound and (arc.behavior, arc.source) in self.idle)]

    @property
    def idle(self) -> set[tuple[str, int]]:
        """Ends of phases that nothing but the phase makes late: who is there early does not hold its beginning up."""
        arcs = [
            (each.source, each.target, each.behavior if each.kind == "phase" else "", isinstance(each, Bound))
            for each in self.ties
            if isinstance(each, Bound) or each.source or each.lag or each.after
        ] + [(-1, each, "", False) for each in self.foreseen]
        idle: set[tuple[str, int]] = set()
        while True:
            left = [each for each in arcs if not (each[3] and (each[2], each[0]) in idle)]
            more = {
                (behavior, here)
                for here, _, behavior, is_bound in left
                if is_bound and behavior and [each[2] for each in left if each[1] == here] == [behavior]
            }
            if not more - idle:
                return idle
            idle |= more

    def _fixed(self, arc: Arc) -> float | None:
        """The time from which an upper bound counts, if that has been: it moves nothing, but may be broken."""
        if not arc.is_bound:
            return None
        return self.passed.get((arc.behavior, arc.target), self.facts.get(arc.target))

    def times(self, arcs: Iterable[Arc], *, extreme: bool = False) -> list[float] | None:
        """The earliest times; None: there are none, or a bound on a fact is broken."""
        arcs = list(arcs)
        lags: list[tuple[float | int, int | None, float, bool]] = []
        for arc in arcs:
            seconds = arc.least if extreme else arc.seconds
            begun = self.passed.get((arc.after, arc.source)) if arc.after else None
            moves = None if self._fixed(arc) is not None else arc.target
            lags.append((arc.source if begun is None else begun, moves, seconds, begun is not None))
        times = [self.facts.get(each, max(BEGAN, self.base.get(each, BEGAN))) for each in range(self.size)]
        for each, at in self.foreseen.items():
            if each not in self.facts:
                times[each] = max(times[each], at)
        for _ in range(self.size + 1):
            before = list(times)
            for source, target, seconds, is_time in lags:
                if target is not None and target not in self.facts:
                    at = source if is_time else times[int(source)]
                    times[target] = max(times[target], at + seconds)
            if all(abs(one - other) < 1e-9 for one, other in zip(times, before, strict=True)):
                break
        else:
            return None
        for arc, (_, _, seconds, _) in zip(arcs, lags, strict=True):
            latest = self._fixed(arc)
            if latest is not None and arc.source not in self.facts and times[arc.source] + seconds > latest + 1e-6:
                return None
        return times


class Case(Struct):
    """A net, and the transitions that each behavior passes, in order."""

    net: PetriNet
    stations: dict[str, list[int]]
    foreign: list[int]

    @property
    def plan(self) -> Plan:
        at = {Point(f"other:b{number}", "end"): number for number in self.foreign}
        at |= {Point(name, f"p{number}"): number for name, each in self.stations.items() for number in each}
        members = tuple(() for _ in self.net.transitions)
        # What a plan makes slower or faster gives way first: whatever that is, what can be kept is kept.
        chance = random.Random(len(self.net.places))
        schedule = tuple([round(chance.uniform(0.0, 5.0), 2) for _ in self.net.transitions])
        return Plan(
            block=Block(id="b", behaviors=()), behaviors=(), net=self.net, at=at, members=members, schedule=schedule,
            chains={}, estimates={}, natural=frozenset(), required=frozenset(), waited_for=frozenset(), kept={},
            entering=(), relations=Relations((), (), frozenset()),
        )  # fmt: skip


def case(chance: random.Random, *, is_elastic: bool) -> Case:
    size = chance.randint(4, 7)
    places = [Place("order", 0, each) for each in range(1, size)]
    bounds: list[Bound] = []
    stations: dict[str, list[int]] = {}
    for name in ("a", "b", "c")[: chance.randint(1, 3)]:
        stations[name] = sorted(chance.sample(range(size - 1), chance.randint(2, min(4, size - 1))))
        for source, target in pairwise(stations[name]):
            lag = chance.choice((0.25, 0.5, 1.0, 2.0))
            shortest = lag * chance.choice((0.25, 0.5, 1.0)) if is_elastic else lag
            places.append(Place("phase", source, target, lag, shortest, name))
            if chance.random() < 0.6:
                stretch = chance.choice((None, 0.0, lag)) if is_elastic else 0.0
                bounds.append(Bound("phase", target, source, -lag, stretch, name))
    for _ in range(chance.randint(0, 4)):
        source, target = sorted(chance.sample(range(size - 1), 2))
        lag = chance.choice((0.0, 0.5, 1.5))
        kind = chance.choice(("order", "delay", "window"))
        if kind != "window":
            places.append(Place("delay" if kind == "delay" else "order", source, target, lag, lag))
        if kind != "order":
            bounds.append(Bound("delay", target, source, -(lag if kind == "delay" else lag + 1.5)))
    for name, each in stations.items():
        if chance.random() < 0.5 and (source := chance.choice(each)) < size - 2:
            target = chance.randint(source + 1, size - 2)
            lag = chance.choice((0.0, 0.0, 0.5))
            places.append(Place("series", source, target, lag, lag, after=name))
    places += [Place("order", each, size - 1) for each in range(1, size - 1)]
    places.append(Place("idle", size - 1, 0))
    places += [Place("idle", each[-1], each[0], 1.0, 1.0) for each in stations.values() if chance.random() < 0.3]
    foreign = [each for each in range(1, size - 1) if chance.random() < 0.15]
    return Case(
        PetriNet(tuple(Transition(str(n), ()) for n in range(size)), tuple(places), tuple(bounds)), stations, foreign
    )


class Story:
    """Facts that come at random to a forecast and to the model."""

    def __init__(self, chance: random.Random, *, is_elastic: bool) -> None:
        self.chance = chance
        self.case = case(chance, is_elastic=is_elastic)
        self.factor: dict[str, float] = {name: chance.choice((1.0, 1.0, 1.5)) for name in self.case.stations}
        foreseen = {each: BEGAN + chance.choice((-1.0, 0.0, 1.0, 3.0)) for each in self.case.foreign}
        self.model = Model(self.case.net, self.factor, self.case.plan.schedule, dict(foreseen))
        points = {Point(f"other:b{each}", "end"): at for each, at in foreseen.items()}
        points[Point("other:nobody", "end")] = 99.0
        self.forecast = Forecast(self.case.plan, BEGAN, lambda id: self.factor.get(id, 1.0), points)
        self.left = {name: list(each) for name, each in self.case.stations.items()}
        self.now = BEGAN

    def tell(self, *, is_overdue: bool = True) -> None:
        """One fact more. is_overdue: that something has not come is one, too."""
        chance, forecast, model = self.chance, self.forecast, self.model
        self.now += chance.choice((0.0, 0.25, 0.25, 1.0))
        transition = chance.randrange(1, model.size)
        match chance.choice(("pass", "pass", "pass", "arrive", "fix", "overdue", "prolong", "learn", "foresee")):
            case "pass" if coming := [name for name, each in self.left.items() if each]:
                name = chance.choice(coming)
                here = self.left[name].pop(0)
                model.leave(name, here, self.now)
                forecast.passed(name, here, self.now)
                if all(here not in each for each in self.left.values()) and chance.random() < 0.8:
                    self.fix(here, max(self.now, model.there[here]))
            case "arrive" if coming := [name for name, each in self.left.items() if len(each) > 1]:
                name = chance.choice(coming)
                if len(self.left[name]) < len(self.case.stations[name]):
                    model.arrive(name, self.left[name][0], self.now)
                    forecast.come(name, self.left[name][0], self.now)
            case "fix" if all(transition not in each for each in self.left.values()):
                self.fix(transition, self.now)
            case "overdue" if is_overdue:
                at = self.now + chance.choice((0.0, 0.0, 1.5))
                if transition not in model.facts:
                    model.base[transition] = max(at, model.base.get(transition, BEGAN))
                forecast.overdue(transition, at)
            case "prolong" if clocks := [it for it in self.case.net.places if it.kind != "phase" and it.lag > 0.0]:
                clock, seconds = chance.choice(clocks), chance.choice((0.0, 0.5, 2.0))
                model.prolonged[clock.source, clock.target] = seconds
                forecast.prolong(clock.source, clock.target, seconds)
            case "learn":
                name = chance.choice(sorted(self.factor))
                self.factor[name] = chance.choice((0.75, 1.0, 1.5, 2.0))
                forecast.relearn((name, "stranger"))
            case "foresee" if self.case.foreign:
                other = chance.choice(self.case.foreign)
                model.foreseen[other] = BEGAN + chance.choice((-1.0, 0.5, 2.0, 4.0))
                forecast.foresee(other, model.foreseen[other])

    def fix(self, transition: int, at: float) -> None:
        if transition not in self.model.facts:
            self.model.facts[transition] = at
            self.forecast.fix(transition, at)
