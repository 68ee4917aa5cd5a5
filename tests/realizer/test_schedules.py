"""Schedules of random lags and nets, against relaxation one by one: what is earliest, what is impossible and why.

The oracle knows no sweeps, no causes and no shares: it relaxes every lag until nothing moves, or a cycle never ends.
"""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engage_hri.services.realizer.net.petri_net import Bound, PetriNet, Place, Transition
from engage_hri.services.realizer.plan.assembly import components, numbered
from engage_hri.services.realizer.plan.schedule import (
    Foresight,
    Impossible,
    Lag,
    PositiveCycle,
    Solution,
    critical_path,
    predict,
    solve,
)
from tests.random_cases import share_of

QUARTERS = st.integers(-8, 8).map(lambda each: each / 4)
Arcs = Iterable[tuple[int, int, float]]


def earliest(size: int, arcs: Arcs, start: Mapping[int, float] = {}) -> list[float] | None:
    """Least times that keep all arcs; None: there are none."""
    times, arcs = [start.get(each, 0.0) for each in range(size)], list(arcs)
    for _ in range(size + 1):
        before = list(times)
        for source, target, seconds in arcs:
            times[target] = max(times[target], times[source] + seconds)
        if times == before:
            return times
    return None


@st.composite
def lags(draw: st.DrawFn) -> tuple[int, list[Lag]]:
    size = draw(st.integers(2, 8))
    ends = st.integers(0, size - 1)
    found = draw(st.lists(st.tuples(ends, ends, QUARTERS), max_size=14))
    return size, [Lag(*each, number) for number, each in enumerate(found) if each[0] != each[1]]


def check_cycles(cycles: Sequence[Sequence[Lag]], known: Sequence[Lag]) -> None:
    assert cycles
    for cycle in cycles:
        assert all(one.target == other.source for one, other in pairwise((*cycle, cycle[0])))
        assert sum(each.seconds for each in cycle) > 0.0
        assert set(cycle) <= set(known)
    seen = Counter(each.source for cycle in cycles for each in cycle if each.source)
    assert all(count == 1 for count in seen.values())


@settings(max_examples=share_of(300), deadline=None)
@given(lags(), st.dictionaries(st.integers(1, 7), st.integers(-8, 0).map(lambda each: each / 4), max_size=2))
def test_a_schedule_is_the_earliest_or_a_cycle_forbids_it(
    asked: tuple[int, list[Lag]], past: dict[int, float]
) -> None:
    size, given_lags = asked
    past = {each: at for each, at in past.items() if each < size}
    expected = earliest(size, [(lag.source, lag.target, lag.seconds) for lag in given_lags], past)
    if expected is None:
        with pytest.raises(PositiveCycle) as refusal:
            solve(size, given_lags, past)
        check_cycles(refusal.value.cycles, given_lags)
        assert refusal.value.lags == refusal.value.cycles[0]
        assert str(refusal.value) == f"a cycle of {sum(each.seconds for each in refusal.value.lags):+g} s"
        return
    found = solve(size, given_lags, past)
    assert found.times == expected
    for each, at in enumerate(found.times):
        if (cause := found.causes.get(each)) is not None:
            assert (cause.target, found.times[cause.source] + cause.seconds) == (each, at)
        else:
            assert at == past.get(each, 0.0)
    path = critical_path(found)
    assert path[-1] == size - 1
    assert path[0] not in found.causes
    assert all(found.causes[to].source == since for since, to in pairwise(path))


@settings(max_examples=100, deadline=None)
@given(st.lists(st.tuples(QUARTERS.filter(bool), st.booleans()), min_size=1, max_size=6), st.booleans())
def test_every_time_of_the_clock_that_cannot_be_kept_is_found_in_one_go(
    spans: list[tuple[float, bool]], says_start: bool
) -> None:
    """Each instant is at the earliest so late, at the latest so late: the two differ by what is drawn."""
    found: list[Lag] = []
    for number, (excess, is_at_once) in enumerate(spans, 1):
        since = 0.0 if is_at_once else 3.0
        if since or says_start:
            found.append(Lag(0, number, since, len(found)))
        found.append(Lag(number, 0, excess - since, len(found)))
    impossible = {n for n, (excess, at_once) in enumerate(spans, 1) if excess > 0.0 and (says_start or not at_once)}
    if not impossible:
        solve(len(spans) + 1, found)
        return
    with pytest.raises(PositiveCycle) as refusal:
        solve(len(spans) + 1, found)
    check_cycles(refusal.value.cycles, found)
    assert {cycle[0].target for cycle in refusal.value.cycles} == impossible
    assert all(cycle[0].source == 0 and len(cycle) == 2 for cycle in refusal.value.cycles)
    assert sum(each.seconds for each in refusal.value.lags) == max(spans[number - 1][0] for number in impossible)


def test_who_could_be_later_without_a_loss_is_no_cause() -> None:
    """Of two reasons, the one that makes it later; nothing is a cause of what begins at once."""
    found = solve(3, [Lag(0, 1, 1.0, 0), Lag(0, 2, 2.0, 1), Lag(1, 2, 0.5, 2), Lag(0, 1, 0.5, 3)])

    assert found == Solution([0.0, 1.0, 2.0], {1: Lag(0, 1, 1.0, 0), 2: Lag(0, 2, 2.0, 1)})
    assert critical_path(found) == (0, 2)


# -- nets --------------------------------------------------------------------------------------------------------


@st.composite
def nets(draw: st.DrawFn) -> PetriNet:
    """Any net: some phases stretch, some not; bounds of phases and bounds that somebody asked for."""
    size = draw(st.integers(2, 6))
    ends = st.tuples(st.integers(0, size - 1), st.integers(1, size - 1)).filter(lambda each: each[0] != each[1])
    places = [Place("order", 0, each) for each in range(1, size)]
    bounds = []
    for source, target in draw(st.lists(ends, max_size=6)):
        lag = draw(st.integers(1, 8)) / 4
        shortest = draw(st.sampled_from((0.0, 0.5, 1.0))) * lag
        places.append(Place("phase", source, target, lag, shortest, "b"))
        if draw(st.booleans()):
            stretch = draw(st.sampled_from((None, 0.0, 0.5 * lag)))
            bounds.append(Bound("phase", target, source, -lag, stretch, "b"))
    for source, target in draw(st.lists(ends, max_size=4)):
        if draw(st.booleans()):
            bounds.append(Bound("order", target, source, -draw(st.integers(0, 8)) / 4, 0.0))
        else:
            seconds = draw(st.integers(0, 8)) / 4
            places.append(Place("delay", source, target, seconds, seconds))
    places.append(Place("idle", size - 1, 0, 1.0, 1.0))
    return PetriNet(tuple(Transition(f"t{each}", ()) for each in range(size)), tuple(places), tuple(bounds))


def least(tie: Place | Bound) -> float:
    """What the lag may be at least."""
    if isinstance(tie, Place):
        return tie.shortest
    return -1e9 if tie.stretch is None else tie.lag - tie.stretch


def arcs(net: PetriNet, *, extreme: bool) -> list[tuple[int, int, float]]:
    ties: list[Place | Bound] = [each for each in net.places if each.kind != "idle"]
    ties += net.bounds
    return [(each.source, each.target, least(each) if extreme else each.lag) for each in ties]


@settings(max_examples=share_of(200), deadline=None)
@given(nets(), st.dictionaries(st.integers(1, 5), st.integers(0, 12).map(lambda each: each / 4), max_size=2))
def test_phases_give_way_only_where_they_must_and_only_as_far_as_they_can(
    net: PetriNet, known: dict[int, float]
) -> None:
    size = len(net.transitions)
    known = {each: at for each, at in known.items() if each < size}
    foreseen = [(0, each, at) for each, at in known.items()]
    natural, extreme = ([*arcs(net, extreme=each), *foreseen] for each in (False, True))
    easy, possible = earliest(size, natural), earliest(size, extreme)
    if possible is None:
        with pytest.raises(Impossible) as refusal:
            predict(net, known=known)
        circles = refusal.value.circles
        assert str(refusal.value) == f"a cycle of {sum(seconds for _, seconds in circles[0]):+g} s"
        for circle in circles:
            assert sum(seconds for _, seconds in circle) > 0.0
            assert all(one.target == other.source for (one, _), (other, _) in pairwise((*circle, circle[0])))
            for tie, seconds in circle:
                if isinstance(tie, Foresight):
                    assert (tie.source, seconds) == (0, known[tie.target])
                else:
                    assert tie in (*net.places, *net.bounds)
                    assert seconds == (least(tie) if least(tie) > -1e9 else -float("inf"))
        return
    found = predict(net, known=known)
    if easy is not None:
        assert found.times == easy
    for source, target, seconds in extreme:
        assert found.times[target] >= found.times[source] + seconds - 1e-6
    for cause in found.causes.values():
        ties: tuple[Place | Bound, ...] = (*net.places, *net.bounds)
        if cause.reason < len(ties):
            tie = ties[cause.reason]
            assert (tie.source, tie.target) == (cause.source, cause.target)
            assert least(tie) - 1e-9 <= cause.seconds <= tie.lag
        else:
            assert (cause.source, cause.seconds) == (0, known[cause.target])


def test_every_phase_of_a_cycle_gives_way_by_a_share_of_its_room() -> None:
    """Three seconds of three phases into two: room of 0.5, 1.0 and none, a second to be gained. And into 2.25."""
    transitions = tuple(Transition(str(each), ()) for each in range(4))
    lengths = ((1.0, 0.5), (1.0, 0.0), (1.0, 1.0))
    places = tuple(Place("phase", n, n + 1, lag, shortest, "b") for n, (lag, shortest) in enumerate(lengths))
    for total, times in (
        (2.0, (0.0, 2 / 3, 1.0, 2.0)),
        (2.25, (0.0, 0.75, 1.25, 2.25)),
        (1.5, (0.0, 0.5, 0.5, 1.5)),
    ):
        net = PetriNet(transitions, places, (Bound("order", 3, 0, -total, 0.0),))
        assert predict(net).times == pytest.approx(times)
    net = PetriNet(transitions, places, (Bound("order", 3, 0, -1.25, 0.0),))
    with pytest.raises(Impossible, match=r"a cycle of \+0.25 s"):
        predict(net)


def test_who_can_wait_bears_it_all_and_phases_keep_their_pace() -> None:
    """One phase of two may last for ever: the other does not hurry."""
    transitions = tuple(Transition(str(each), ()) for each in range(3))
    places = (Place("phase", 0, 1, 1.0, 0.5, "b"), Place("phase", 0, 2, 3.0, 3.0, "c"))
    bounds = (Bound("phase", 1, 0, -1.0, None, "b"), Bound("order", 2, 1, 0.0, 0.0))

    assert predict(PetriNet(transitions, places, bounds)).times == [0.0, 3.0, 3.0]


def test_no_phase_hurries_for_what_is_dispensable() -> None:
    transitions = tuple(Transition(str(each), ()) for each in range(2))
    net = PetriNet(transitions, (Place("phase", 0, 1, 2.0, 1.0, "b"),), (Bound("order", 1, 0, -1.5, 0.0),))

    assert predict(net).times == [0.0, 1.5]
    with pytest.raises(Impossible) as found:
        predict(net, lambda ties: {each.kind for each in ties} == {"phase", "order"})
    assert found.value.circles == (((net.places[0], 2.0), (net.bounds[0], -1.5)),) or found.value.circles == (
        ((net.bounds[0], -1.5), (net.places[0], 2.0)),
    )


def test_what_came_before_the_block_does_not_wait_for_its_start() -> None:
    """A point of another block is known to be 2 s in the past; what follows it by 1 s is in the past, or at once."""
    transitions = tuple(Transition(str(each), ()) for each in range(3))
    start = tuple(Place("order", 0, each) for each in (1, 2))

    def times(known: float, *more: Place) -> list[float]:
        return predict(PetriNet(transitions, (*start, *more)), known={1: known}).times

    assert times(-2.0, Place("delay", 1, 2, 3.0, 3.0)) == [0.0, -2.0, 1.0]
    assert times(-2.0, Place("delay", 1, 2, 1.0, 1.0)) == [0.0, -2.0, 0.0]
    assert times(2.0, Place("delay", 1, 2, 1.0, 1.0)) == [0.0, 2.0, 3.0]
    assert times(0.0, Place("delay", 1, 2, 1.0, 1.0)) == [0.0, 0.0, 1.0]
    for tied in (Place("order", 0, 1, 1.0, 1.0), Place("order", 0, 1, 0.0, 0.0, "b"), Place("phase", 0, 1)):
        assert times(-2.0, tied)[1] == tied.lag


# -- order -------------------------------------------------------------------------------------------------------


@settings(max_examples=120, deadline=None)
@given(st.integers(1, 8), st.integers(0, 10**6).map(Random))
def test_components_are_who_reach_each_other(size: int, chance: Random) -> None:
    out: dict[int, list[int]] = {}
    for _ in range(chance.randint(0, 2 * size)):
        out.setdefault(chance.randrange(size), []).append(chance.randrange(size))
    reach = {each: {each} for each in range(size)}
    for _ in range(size):
        for source, targets in out.items():
            for each in reach.values():
                if source in each:
                    each.update(targets)
    expected = {
        frozenset(to for to in range(size) if to in reach[each] and each in reach[to]) for each in range(size)
    }

    found = components(size, out)
    assert all(group == sorted(group) for group in found)
    assert Counter(frozenset(group) for group in found) == Counter(expected)
    place = {each: number for number, group in enumerate(found) for each in group}
    assert all(place[source] <= place[target] for source, targets in out.items() for target in targets)


@settings(max_examples=60, deadline=None)
@given(nets(), st.randoms(use_true_random=False))
def test_transitions_are_numbered_as_they_can_fire_and_ties_in_order_without_repetition(
    net: PetriNet, chance: object
) -> None:
    size = len(net.transitions)
    places, bounds = list(net.places) * 2, list(net.bounds) * 2
    chance.shuffle(places)  # type: ignore[attr-defined]
    chance.shuffle(bounds)  # type: ignore[attr-defined]
    found, former, unfired = numbered(net.transitions, places, bounds)

    waits = {(each.source, each.target) for each in places if each.kind != "idle"}
    fired: list[int] = []
    while ready := [
        each
        for each in range(size)
        if each not in fired and all(source in fired for source, target in waits if target == each)
    ]:
        fired.append(ready[0])
    assert unfired == {*range(size)} - {*fired}
    assert former == [*fired, *(each for each in range(size) if each not in fired)]
    assert found.transitions == tuple(net.transitions[each] for each in former)
    assert list(found.places) == sorted(set(found.places), key=_in_order)
    assert list(found.bounds) == sorted(set(found.bounds), key=_in_order)
    assert {_formerly(each, former) for each in found.places} == {_formerly(each, range(size)) for each in net.places}
    assert {_formerly(each, former) for each in found.bounds} == {_formerly(each, range(size)) for each in net.bounds}
    again, _, _ = numbered(net.transitions, net.places, net.bounds)
    assert again == found


def _in_order(tie: Place | Bound) -> tuple[object, ...]:
    last = tie.shortest if isinstance(tie, Place) else float("inf") if tie.stretch is None else tie.stretch
    return (tie.source, tie.target, tie.kind, tie.lag, tie.behavior, tie.lines, last)


def _formerly(tie: Place | Bound, former: Sequence[int]) -> tuple[object, ...]:
    last = tie.shortest if isinstance(tie, Place) else tie.stretch
    return (tie.kind, former[tie.source], former[tie.target], tie.lag, last, tie.behavior, tie.lines)
