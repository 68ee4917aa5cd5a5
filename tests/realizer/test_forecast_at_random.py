"""The forecast of random nets while random facts come in, against a model that relaxes all of it anew each time.

The model holds what was told in plain tables: no causes, no effects, no order of looking. Where all can be kept, the
times are the earliest; where phases must give way, they do so within their limits and all is kept; and where nothing
helps, some upper bounds are given up, and the times are the earliest without these.
"""

import random
from collections.abc import Iterable, Mapping
from itertools import chain, combinations, pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec import Struct, field
from msgspec.structs import replace

from engage_hri.schemas.blocks import Block
from engage_hri.services.realizer.foresee import forecast
from engage_hri.services.realizer.foresee.forecast import Forecast, full_forecast, is_predictive
from engage_hri.services.realizer.net.petri_net import Bound, PetriNet, Place, PlaceKind, Transition
from engage_hri.services.realizer.plan.planner import Plan
from engage_hri.services.realizer.points import Member, Point

BEGAN = 10.0
CLOSE = 1e-5


class Arc(Struct):
    source: int
    target: int
    seconds: float
    least: float
    behavior: str
    is_bound: bool


class Model(Struct):
    """What is known of a running net. base: no earlier than that. passed: when behaviors passed transitions."""

    net: PetriNet
    factor: dict[str, float]
    foreseen: dict[int, float] = field(default_factory=dict)
    facts: dict[int, float] = field(default_factory=lambda: {0: BEGAN})
    base: dict[int, float] = field(default_factory=dict)
    there: dict[int, float] = field(default_factory=dict)
    passed: dict[tuple[str, int], float] = field(default_factory=dict)
    come: set[tuple[str, int]] = field(default_factory=set)
    prolonged: dict[tuple[int, int], float] = field(default_factory=dict)

    @property
    def size(self) -> int:
        return len(self.net.transitions)

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

    def arcs(self) -> list[Arc]:
        """All that holds now; a phase that has begun counts from then, and one that has ended not at all."""
        found = []
        for each in (*self.net.places, *self.net.bounds):
            if each.kind == "idle":
                continue
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
            )
            if phase and not is_bound and (each.behavior, each.target) in self.come:
                continue
            if phase and is_bound and (each.behavior, each.target) in self.passed:
                continue
            found.append(arc)
        return [arc for arc in found if not (arc.is_bound and (arc.behavior, arc.source) in self.idle)]

    @property
    def idle(self) -> set[tuple[str, int]]:
        """Ends of phases that nothing but the phase makes late: who is there early does not hold its beginning up."""
        arcs = [
            (each.source, each.target, each.behavior if each.kind == "phase" else "", isinstance(each, Bound))
            for each in (*self.net.places, *self.net.bounds)
            if each.kind != "idle" and (isinstance(each, Bound) or each.source or each.lag)
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

    def times(self, arcs: Iterable[Arc], *, extreme: bool = False) -> list[float] | None:
        """The earliest times; None: there are none, or a bound on a fact is broken."""
        arcs = list(arcs)
        lags: list[tuple[float | int, int, float, bool]] = []
        for arc in arcs:
            seconds = arc.least if extreme else arc.seconds
            begun = self.passed.get((arc.behavior, arc.source)) if arc.behavior and not arc.is_bound else None
            lags.append((arc.source if begun is None else begun, arc.target, seconds, begun is not None))
        times = [self.facts.get(each, max(BEGAN, self.base.get(each, BEGAN))) for each in range(self.size)]
        for each, at in self.foreseen.items():
            if each not in self.facts:
                times[each] = max(times[each], at)
        for _ in range(self.size + 1):
            before = list(times)
            for source, target, seconds, is_time in lags:
                if target not in self.facts:
                    at = source if is_time else times[int(source)]
                    times[target] = max(times[target], at + seconds)
            if all(abs(one - other) < 1e-9 for one, other in zip(times, before, strict=True)):
                break
        else:
            return None
        for arc, (_, _, seconds, _) in zip(arcs, lags, strict=True):
            is_on_fact = arc.is_bound and not arc.behavior and arc.target in self.facts
            if is_on_fact and arc.source not in self.facts and times[arc.source] + seconds > times[arc.target] + 1e-6:
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
        return Plan(
            block=Block(id="b", behaviors=()), behaviors=(), net=self.net, at=at, members=members, schedule=(),
            chains={}, estimates={}, natural=frozenset(), required=frozenset(), waited_for=frozenset(), kept={},
            entering=(),
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
    places += [Place("order", each, size - 1) for each in range(1, size - 1)]
    places.append(Place("idle", size - 1, 0))
    foreign = [each for each in range(1, size - 1) if chance.random() < 0.15]
    return Case(
        PetriNet(tuple(Transition(str(n), ()) for n in range(size)), tuple(places), tuple(bounds)), stations, foreign
    )


class Story:
    """Facts that come at random to a forecast and to the model."""

    def __init__(self, chance: random.Random, *, is_elastic: bool, is_partial: bool) -> None:
        self.chance = chance
        self.case = case(chance, is_elastic=is_elastic)
        self.factor: dict[str, float] = {name: chance.choice((1.0, 1.0, 1.5)) for name in self.case.stations}
        foreseen = {each: BEGAN + chance.choice((-1.0, 0.0, 1.0, 3.0)) for each in self.case.foreign}
        self.model = Model(self.case.net, self.factor, dict(foreseen))
        points = {Point(f"other:b{each}", "end"): at for each, at in foreseen.items()}
        points[Point("other:nobody", "end")] = 99.0
        self.forecast = Forecast(self.case.plan, BEGAN, lambda id: self.factor.get(id, 1.0), points)
        self.left = {name: list(each) for name, each in self.case.stations.items()}
        self.now = BEGAN
        for each in range(self.model.size):
            if not is_partial or chance.random() < 0.3:
                self.forecast.require(each)

    def tell(self, *, is_overdue: bool = True) -> None:
        """One fact more. is_overdue: that something has not come is one, too."""
        chance, forecast, model = self.chance, self.forecast, self.model
        self.now += chance.choice((0.0, 0.25, 0.25, 1.0))
        transition = chance.randrange(1, model.size)
        match chance.choice(
            ("pass", "pass", "pass", "arrive", "fix", "overdue", "prolong", "learn", "foresee", "require")
        ):
            case "pass" if coming := [name for name, each in self.left.items() if each]:
                name = chance.choice(coming)
                here = self.left[name].pop(0)
                model.arrive(name, here, self.now)
                model.passed[name, here] = self.now
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
            case "require":
                forecast.require(transition)

    def fix(self, transition: int, at: float) -> None:
        if transition not in self.model.facts:
            self.model.facts[transition] = at
            self.forecast.fix(transition, at)


def subsets(bounds: list[Arc]) -> Iterable[tuple[Arc, ...]]:
    """Those with most left first."""
    return chain.from_iterable(combinations(bounds, size) for size in range(len(bounds), -1, -1))


def known(forecast: Forecast, times: list[float]) -> list[float]:
    return [each for each, is_kept in zip(times, forecast.is_kept, strict=False) if is_kept]


@settings(max_examples=150, deadline=None)
@given(st.integers(0, 10**6), st.booleans())
def test_what_is_expected_is_the_earliest_that_keeps_all_or_as_much_as_can_be(seed: int, is_partial: bool) -> None:
    """Nothing can give way here but upper bounds."""
    story = Story(random.Random(seed), is_elastic=False, is_partial=is_partial)
    before = [BEGAN] * story.model.size
    for _ in range(14):
        changed = story.forecast.update()
        now = story.forecast.times[: story.model.size]
        assert changed == {each for each, at in enumerate(now) if abs(at - before[each]) > 1e-8}
        before = list(now)
        arcs = story.model.arcs()
        told = known(story.forecast, now)
        expected = story.model.times(arcs)
        if expected is not None:
            assert told == pytest.approx(known(story.forecast, expected), abs=CLOSE)
            assert not any(story.forecast.is_hurried(each) for each in story.factor)
        elif not is_partial and len(bounds := [each for each in arcs if each.is_bound]) < 8:
            rigid = [each for each in arcs if not each.is_bound]
            kept = (story.model.times((*rigid, *some)) for some in subsets(bounds))
            assert any(each == pytest.approx(told, abs=CLOSE) for each in kept if each is not None)
        story.tell()


@settings(max_examples=150, deadline=None)
@given(st.integers(0, 10**6))
def test_phases_give_way_within_their_limits_where_all_can_be_kept_by_that(seed: int) -> None:
    story = Story(random.Random(seed), is_elastic=True, is_partial=False)
    for _ in range(14):
        story.forecast.update()
        arcs, times = story.model.arcs(), story.forecast.times
        natural, extreme = story.model.times(arcs), story.model.times(arcs, extreme=True)
        if natural is not None:
            assert times[: story.model.size] == pytest.approx(natural, abs=CLOSE)
            assert not any(story.forecast.is_hurried(each) for each in story.factor)
        for arc in arcs:
            if not arc.is_bound or extreme is not None:
                begun = story.model.passed.get((arc.behavior, arc.source)) if not arc.is_bound else None
                since = times[arc.source] if begun is None else begun
                is_due = arc.is_bound and not arc.behavior and arc.source not in story.model.facts
                if arc.target not in story.model.facts or is_due:
                    assert times[arc.target] >= since + (arc.seconds if is_due else arc.least) - CLOSE
            if arc.behavior and not arc.is_bound:
                seconds = story.forecast.phase(arc.behavior, arc.target)
                assert arc.least - CLOSE <= seconds <= arc.seconds + CLOSE
                assert seconds > arc.seconds - CLOSE or story.forecast.is_hurried(arc.behavior)
        story.tell()


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6))
def test_a_forecast_from_scratch_takes_all_facts_at_once(seed: int) -> None:
    story = Story(random.Random(seed), is_elastic=False, is_partial=True)
    for _ in range(12):
        story.tell(is_overdue=False)
    model = story.model
    if (expected := model.times(model.arcs())) is None:
        return
    reached = {Point(name, f"p{number}"): at for (name, number), at in model.passed.items()}
    arrived = {Point(name, f"p{number}"): model.there[number] for name, number in model.come - model.passed.keys()}
    foreseen = {Point(f"other:b{number}", "end"): at for number, at in model.foreseen.items()}
    stranger = {Point("gone", "p1"): 99.0}
    prolonged = [(*ends, seconds) for ends, seconds in model.prolonged.items()]
    factor = lambda id: story.factor.get(id, 1.0)  # noqa: E731
    found = full_forecast(
        story.case.plan, BEGAN, factor, foreseen, {**reached, **stranger}, {**arrived, **stranger, **reached},
        model.facts, prolonged,
    )  # fmt: skip
    assert found.times[: model.size] == pytest.approx(expected, abs=CLOSE)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6))
def test_who_gives_up_in_the_end_still_keeps_all_lower_bounds(seed: int) -> None:
    """As if nothing could be made way for: no upper bound holds then, and all phases last as long as is natural."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(forecast, "REPAIRS", 0)
        story = Story(random.Random(seed), is_elastic=True, is_partial=False)
        for _ in range(8):
            story.forecast.update()
            lower = story.model.times([each for each in story.model.arcs() if not each.is_bound])
            assert lower is not None
            assert story.forecast.times[: story.model.size] == pytest.approx(lower, abs=CLOSE)
            story.tell()


def member(kind: str) -> Member:
    return Member("a", kind, Point("a", kind))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("bounds", "place", "members", "expected"),
    [
        ((), "order", ("hold",), False),
        (("phase",), "order", ("hold",), False),
        (("phase", "order"), "order", ("hold",), True),
        (("delay",), "phase", ("hold",), True),
        ((), "phase", ("passive",), False),
        ((), "phase", ("prompt", "hold"), True),
        ((), "phase", ("hold", "passive"), True),
        ((), "phase", ("hold", "hold"), False),
        ((), "order", ("passive",), True),
        ((), "delay", ("prompt",), True),
        ((), "series", ("passive",), True),
        ((), "handover", ("passive",), False),
        ((), "series", ("start",), False),
    ],
)
def test_a_forecast_is_needed_where_a_time_is_bounded_or_who_cannot_wait_is_tied(
    bounds: tuple[PlaceKind, ...], place: PlaceKind, members: tuple[str, ...], expected: bool
) -> None:
    transitions = tuple(Transition(str(n), ()) for n in range(3))
    net = PetriNet(transitions, (Place(place, 0, 1),), tuple(Bound(kind, 1, 0, -1.0) for kind in bounds))
    plan = replace(Case(net, {}, []).plan, members=((), tuple(member(kind) for kind in members), ()))

    assert is_predictive(plan) == expected


def test_what_was_told_last_of_a_net_of_one_phase() -> None:
    """Plain numbers: two phases of a behavior and a bound, as they are hurried, come late, and are given up."""
    places = (
        Place("order", 0, 1),
        Place("phase", 1, 2, 1.0, 0.5, "a"),
        Place("phase", 2, 3, 2.0, 1.0, "a"),
        Place("order", 3, 4),
    )
    bounds = (Bound("delay", 3, 0, -2.25), Bound("phase", 2, 1, -1.0, 3.0, "a"))
    one = Case(PetriNet(tuple(Transition(str(n), ()) for n in range(5)), places, bounds), {}, [])

    def times(*facts: tuple[int, float], factor: float = 1.0) -> tuple[Mapping[int, float], Forecast]:
        forecast = Forecast(one.plan, BEGAN, lambda id: factor, {})
        for each in range(5):
            forecast.require(each)
        for each, at in facts:
            forecast.passed("a", each, at)
        forecast.update()
        return {each: at - BEGAN for each, at in enumerate(forecast.times[:5])}, forecast

    told, forecast = times()
    assert told == pytest.approx({0: 0.0, 1: 0.0, 2: 0.75, 3: 2.25, 4: 2.25})
    assert forecast.is_hurried("a")
    assert not forecast.is_hurried("b")
    assert (forecast.phase("a", 2), forecast.phase("a", 3)) == pytest.approx((0.75, 1.5))
    assert (forecast.phase("a", 4), forecast.phase("b", 2)) == (0.0, 0.0)
    assert (forecast.longest("a", 3), forecast.longest("a", 2)) == (float("inf"), 4.0)
    assert times((1, BEGAN), (2, BEGAN + 1.0))[0] == pytest.approx({0: 0.0, 1: 0.0, 2: 1.0, 3: 2.25, 4: 2.25})
    late, forecast = times((1, BEGAN), (2, BEGAN + 1.5))
    assert late == pytest.approx({0: 0.0, 1: 0.0, 2: 1.5, 3: 2.5, 4: 2.5})
    assert forecast.phase("a", 3) == pytest.approx(1.0)
    assert times(factor=3.0)[0] == pytest.approx({0: 0.0, 1: 0.0, 2: 1.5, 3: 4.5, 4: 4.5})


def test_a_phase_that_may_last_for_ever_lasts_as_long_as_it_must_and_no_longer() -> None:
    """Its beginning is as late as it may be: at 1 s. What has nothing to do with it is as it was."""
    places = (
        *(Place("order", 0, each) for each in (1, 2, 3)),
        Place("phase", 1, 2, 1.0, 1.0, "a"),
        Place("order", 0, 2, 3.0, 3.0),
        Place("phase", 0, 3, 2.0, 2.0, "b"),
    )
    bounds = (Bound("phase", 2, 1, -1.0, None, "a"), Bound("delay", 1, 0, -1.0))
    one = Case(PetriNet(tuple(Transition(str(n), ()) for n in range(4)), places, bounds), {}, [])
    told = Forecast(one.plan, BEGAN, lambda id: 1.0, {})
    for each in range(4):
        told.require(each)

    told.update()
    assert [at - BEGAN for at in told.times[:4]] == pytest.approx([0.0, 1.0, 3.0, 2.0])
    assert not told.is_hurried("a")


def test_what_cannot_be_kept_costs_no_other_bound() -> None:
    """The phase of a can be hurried to 1 s, not to 0.5 s; that b is not on its way too early is kept."""
    places = (
        *(Place("order", 0, each) for each in (1, 2, 3, 4)),
        Place("phase", 0, 1, 2.0, 1.0, "a"),
        Place("phase", 2, 3, 1.0, 1.0, "b"),
        Place("order", 0, 3, 3.0, 3.0),
    )
    bounds = (Bound("delay", 1, 0, -0.5), Bound("phase", 3, 2, -1.0, 0.0, "b"))
    one = Case(PetriNet(tuple(Transition(str(n), ()) for n in range(5)), places, bounds), {}, [])
    told = Forecast(one.plan, BEGAN, lambda id: 1.0, {})
    for each in range(5):
        told.require(each)

    told.update()
    assert [at - BEGAN for at in told.times[:5]] == pytest.approx([0.0, 1.0, 2.0, 3.0, 0.0])
    assert told.bounded == {2, 3}
