"""The forecast of random nets while random facts come in, against a model that relaxes all of it anew each time.

Where all can be kept, the times are the earliest; where phases must give way, they do so within their limits and all
is kept; and where nothing helps, some upper bounds are given up, and the times are the earliest without these. Who is
left of an instant that another has passed waits there no longer for the end of a phase that can be slower.
"""

import random
from collections.abc import Iterable, Mapping
from itertools import chain, combinations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from engage_hri.services.realizer.foresee import forecast
from engage_hri.services.realizer.foresee.forecast import Forecast
from engage_hri.services.realizer.foresee.from_scratch import full_forecast, is_predictive
from engage_hri.services.realizer.net.petri_net import Bound, PetriNet, Place, PlaceKind, Transition
from engage_hri.services.realizer.points import Member, Point
from tests.random_cases import share_of
from tests.realizer.facts_at_random import BEGAN, Arc, Case, Story

CLOSE = 1e-5


def subsets(bounds: list[Arc]) -> Iterable[tuple[Arc, ...]]:
    """Those with most left first."""
    return chain.from_iterable(combinations(bounds, size) for size in range(len(bounds), -1, -1))


@settings(max_examples=share_of(150), deadline=None)
@given(st.integers(0, 10**6))
def test_what_is_expected_is_the_earliest_that_keeps_all_or_as_much_as_can_be(seed: int) -> None:
    """Nothing can give way here but upper bounds."""
    story = Story(random.Random(seed), is_elastic=False)
    before = [BEGAN] * story.model.size
    for _ in range(14):
        changed = story.forecast.update()
        now = story.forecast.times[: story.model.size]
        assert changed == {each for each, at in enumerate(now) if abs(at - before[each]) > 1e-8}
        before = list(now)
        arcs = story.model.arcs()
        expected = story.model.times(arcs)
        if expected is not None:
            assert now == pytest.approx(expected, abs=CLOSE)
            assert not any(story.forecast.is_hurried(each) for each in story.factor)
        elif len(bounds := [each for each in arcs if each.is_bound]) < 8:
            rigid = [each for each in arcs if not each.is_bound]
            kept = (story.model.times((*rigid, *some)) for some in subsets(bounds))
            assert any(each == pytest.approx(now, abs=CLOSE) for each in kept if each is not None)
        story.tell()


@settings(max_examples=share_of(150), deadline=None)
@given(st.integers(0, 10**6))
def test_phases_give_way_within_their_limits_where_all_can_be_kept_by_that(seed: int) -> None:
    story = Story(random.Random(seed), is_elastic=True)
    for _ in range(14):
        story.forecast.update()
        model, arcs, times = story.model, story.model.arcs(), story.forecast.times
        natural, extreme = model.times(arcs), model.times(arcs, extreme=True)
        if natural is not None:
            late, least = model.late(natural), model.times(model.bent(arcs))
            assert least is not None
            for each in late:
                assert times[each] == pytest.approx(max(model.latest[each], least[each]), abs=CLOSE)
            expected = model.times(model.bent(arcs, times)) if late else natural
            assert times[: model.size] == pytest.approx(expected, abs=CLOSE)
            assert late or not any(story.forecast.is_hurried(each) for each in story.factor)
        for arc in arcs:
            if not arc.is_bound or extreme is not None:
                begun = story.model.passed.get((arc.after, arc.source))
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
    story = Story(random.Random(seed), is_elastic=False)
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
    found.update()

    assert found.times[: model.size] == pytest.approx(expected, abs=CLOSE)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6))
def test_who_gives_up_in_the_end_still_keeps_all_lower_bounds(seed: int) -> None:
    """As if nothing could be made way for: no upper bound holds then, and all phases last as long as is natural."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(forecast, "REPAIRS", 0)
        story = Story(random.Random(seed), is_elastic=True)
        for _ in range(8):
            story.forecast.update()
            came = story.model.facts  # What has come is a reason to be late as well, and gives no way.
            arcs = story.model.arcs()
            lower = story.model.times(
                [each for each in arcs if not each.is_bound or (each.source in came and not each.behavior)]
            )
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
    plan = replace(one.plan, schedule=(0.0,) * 5)  # which hurries both phases

    def times(*facts: tuple[int, float], factor: float = 1.0) -> tuple[Mapping[int, float], Forecast]:
        forecast = Forecast(plan, BEGAN, lambda id: factor, {})
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

    told.update()
    assert [at - BEGAN for at in told.times[:5]] == pytest.approx([0.0, 1.0, 2.0, 3.0, 0.0])


def test_an_instant_that_comes_as_expected_frees_what_was_given_up_for_it() -> None:
    """The second comes two seconds after the first, which is to be half a second before it."""
    places = (*(Place("order", 0, each) for each in (1, 2, 3)), Place("order", 1, 2, 2.0, 2.0))
    one = Case(
        PetriNet(tuple(Transition(str(n), ()) for n in range(4)), places, (Bound("delay", 2, 1, -0.5),)), {}, []
    )
    told = Forecast(one.plan, BEGAN, lambda id: 1.0, {})

    assert told.update() == {2}
    assert told.times[1:3] == pytest.approx([BEGAN, BEGAN + 2.0])
    told.fix(2, BEGAN + 2.0)
    assert told.update() == {1}
    assert told.times[1:3] == pytest.approx([BEGAN + 1.5, BEGAN + 2.0])


def test_an_upper_bound_that_only_its_own_phase_could_break_holds_nobody_back() -> None:
    """Unless something else may end the phase late: an order, a bound, or a point of another block."""
    phase, own = Place("phase", 1, 2, 1.0, 1.0, "a"), Bound("phase", 2, 1, -1.0, 0.0, "a")
    starts = tuple(Place("order", 0, each) for each in (1, 2, 3))
    for more, bounded in ((), set()), ((Place("order", 3, 2),), {1, 2}), ((Place("order", 0, 2, 2.0, 2.0),), {1, 2}):
        net = PetriNet(tuple(Transition(str(n), ()) for n in range(4)), (*starts, phase, *more), (own,))
        assert Forecast(Case(net, {}, []).plan, BEGAN, lambda id: 1.0, {}).bounded == bounded
    net = PetriNet(tuple(Transition(str(n), ()) for n in range(4)), (*starts, phase), (own,))
    assert Forecast(Case(net, {}, [2]).plan, BEGAN, lambda id: 1.0, {}).bounded == {1, 2}


@pytest.mark.parametrize(
    ("passed", "stretch", "expected"),
    [(None, 1.0, 2.0), (2.5, 1.0, 2.5), (1.5, 1.0, 1.5), (0.5, 1.0, 1.0), (0.5, None, 0.5), (0.5, 0.0, 2.0)],
)
def test_who_is_left_of_an_instant_waits_there_no_longer_than_another_that_has_passed_it(
    passed: float | None, stretch: float | None, expected: float
) -> None:
    """The phase of b takes 1 s, or as much longer as it can, and ends at 3 s: it was to begin at 2 s, with a."""
    places = (Place("order", 0, 1), Place("phase", 1, 2, 1.0, 0.5, "b"), Place("order", 0, 2, 3.0, 3.0))
    bounds = (Bound("phase", 2, 1, -1.0, stretch, "b"),)
    one = Case(PetriNet(tuple(Transition(str(n), ()) for n in range(3)), places, bounds), {}, [])
    told = Forecast(one.plan, BEGAN, lambda id: 1.0, {})
    if passed is not None:
        told.passed("a", 1, BEGAN + passed)

    told.update()
    assert [at - BEGAN for at in told.times[:3]] == pytest.approx([0.0, expected, max(3.0, expected + 1.0)])
    assert not told.is_hurried("b")


def test_who_is_left_waits_no_longer_also_where_that_it_waits_could_not_be_kept_when_another_passed() -> None:
    """Until the clock is stopped for 1 s, the phases are to begin by 0.5 s; b cannot be slow enough for that."""
    places = (Place("order", 0, 1), Place("phase", 1, 2, 1.0, 0.5, "b"), Place("order", 0, 2, 3.0, 3.0))
    bounds = (Bound("delay", 1, 0, -0.5), Bound("phase", 2, 1, -1.0, 1.0, "b"))
    one = Case(PetriNet(tuple(Transition(str(n), ()) for n in range(3)), places, bounds), {}, [])
    told = Forecast(one.plan, BEGAN, lambda id: 1.0, {})

    told.update()
    assert [at - BEGAN for at in told.times[:3]] == pytest.approx([0.0, 0.0, 3.0])
    told.passed("a", 1, BEGAN + 1.25)
    told.prolong(0, 1, 1.0)
    told.update()
    assert [at - BEGAN for at in told.times[:3]] == pytest.approx([0.0, 1.25, 3.0])


def test_a_delay_that_is_no_longer_than_planned_after_all_frees_what_gave_way_for_it() -> None:
    """The phases of c, 1 s, and b, 0.5 s, end together; b begins at 1.5 s, and 0.5 s after c at least."""
    places = (
        *(Place("order", 0, each) for each in (1, 2, 3)),
        Place("phase", 1, 3, 1.0, 1.0, "c"),
        Place("phase", 2, 3, 0.5, 0.25, "b"),
        Place("delay", 1, 2, 0.5, 0.5),
    )
    one = Case(
        PetriNet(tuple(Transition(str(n), ()) for n in range(4)), places, (Bound("phase", 3, 1, -1.0, 0.0, "c"),)),
        {}, [],
    )  # fmt: skip
    told = Forecast(one.plan, BEGAN, lambda id: 1.0, {})
    told.overdue(2, BEGAN + 1.5)

    told.update()
    assert [at - BEGAN for at in told.times[:4]] == pytest.approx([0.0, 1.0, 1.5, 2.0])
    told.prolong(1, 2, 0.5)
    told.update()
    assert [at - BEGAN for at in told.times[:4]] == pytest.approx([0.0, 0.0, 1.5, 1.75])
    told.prolong(1, 2, 0.0)
    told.update()
    assert [at - BEGAN for at in told.times[:4]] == pytest.approx([0.0, 1.0, 1.5, 2.0])
    assert not told.is_hurried("b")
