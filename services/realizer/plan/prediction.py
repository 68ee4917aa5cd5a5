"""The predicted schedule of a net: phases last as long as is natural, faster or slower only where they must be."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from math import inf

from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.net.petri_net import Bound, PetriNet, Place
from engage_hri.services.realizer.plan.schedule import Lag, PositiveCycle, Solution, solve
from engage_hri.services.realizer.points import EPSILON, Point


class Foresight(Place, frozen=True):
    """Place that stands for what is known beforehand of its target: it comes no earlier than `lag` seconds."""


class Awaited(Place, frozen=True, kw_only=True):
    """Place that stands for what other blocks wait for: its target, a point of theirs, comes after its source.

    pair: the point of this block, and that of the other.
    """

    pair: tuple[Point, Point]


Circle = tuple[tuple[Place | Bound, Seconds], ...]
"""Ties that lead back to their start, in order, each with its seconds: the sum is more than 0."""


class Impossible(Exception):
    """Raised if there is no schedule, with every phase of these circles as short or long as can be.

    circles: all that were found, no two of which share an instant other than the start of the block.
    """

    def __init__(self, circles: Sequence[Circle]) -> None:
        self.circles = tuple(circles)
        super().__init__(f"a cycle of {sum(seconds for _, seconds in self.circles[0]):+g} s")


def predict(
    net: PetriNet,
    is_dispensable: Callable[[Iterable[Place | Bound]], bool] = lambda ties: False,
    known: Mapping[int, Seconds] = {},
    awaited: Iterable[Awaited] = (),
    may_be_late: bool = False,
) -> Solution:
    """The earliest schedule; `reason` of a cause is the number of the place or, after them, of the bound.

    known: when transitions come that depend on more than this net, at the earliest; negative: before the block.
    awaited: which of them come after transitions of this net.
    A cycle that takes too long is shortened: each phase by a share of its room, those that can be slower before those
    that have to hurry. Raises Impossible; also for a cycle with ties that are dispensable: no phase is hurried for
    their sake. may_be_late: what the block says is missed then, by as little as can be.
    """
    foreseen = [Foresight("order", 0, each, at, at) for each, at in sorted(known.items()) if each and at > 0.0]
    past = {each: at for each, at in known.items() if each and at <= 0.0}
    ties: tuple[Place | Bound, ...] = (*net.places, *net.bounds, *foreseen, *awaited)
    lags = []
    for number, tie in enumerate(ties):
        if tie.kind != "idle":
            # What came before the block does not wait for its start.
            is_before = tie.target in past and _is_beginning(tie)
            lags.append(Lag(tie.source, tie.target, past[tie.target] if is_before else tie.lag, number))
    index: dict[int, int] = {}
    while True:
        try:
            return solve(len(net.transitions), lags, past)
        except PositiveCycle as found:
            index = index or {lag.reason: number for number, lag in enumerate(lags)}
            hopeless = []
            for cycle in found.cycles:
                circle = tuple([(ties[lag.reason], lag.seconds) for lag in cycle])
                room = [seconds - least(tie) for tie, seconds in circle]
                excess = sum(lag.seconds for lag in cycle)
                if sum(room) < excess - EPSILON and may_be_late and (last := _said(circle)) is not None:
                    room[last] = excess - sum(room)
                if sum(room) < excess - EPSILON:
                    hopeless.append(tuple([(tie, least(tie)) for tie, _ in circle]))
                    continue
                if is_dispensable([tie for tie, _ in circle]):
                    hopeless.append(circle)
                    continue
                slower = [
                    seconds if isinstance(tie, Bound) else 0.0 for (tie, _), seconds in zip(circle, room, strict=True)
                ]
                for lag in _shortened(cycle, slower, min(excess, sum(slower))):
                    lags[index[lag.reason]] = lag
                if (rest := excess - sum(slower)) > 0.0:
                    faster = [seconds - each for seconds, each in zip(room, slower, strict=True)]
                    if not any(faster):  # They miss each other by a rounding: nobody notices who gives way.
                        faster = [1.0] * len(cycle)
                    for lag in _shortened(cycle, faster, rest):
                        lags[index[lag.reason]] = lag
            if hopeless:
                raise Impossible(hopeless) from None


def _shortened(cycle: tuple[Lag, ...], room: list[Seconds], excess: Seconds) -> list[Lag]:
    """The lags of the cycle that give way, by `excess` in all, each in proportion to its `room`."""
    if sum(room) == inf:
        # What can wait as long as it must does so as early as it can, as it does when it is performed.
        first = min(lag.target for lag, each in zip(cycle, room, strict=True) if each == inf)
        room = [float(each == inf and lag.target == first) for lag, each in zip(cycle, room, strict=True)]
    if not (total := sum(room)):
        return []
    shares = [each / total for each in room]
    return [
        lag._replace(seconds=lag.seconds - excess * share) for lag, share in zip(cycle, shares, strict=True) if share
    ]


def _said(circle: Circle) -> int | None:
    """Number of the tie in a circle that may be missed: of what the block says, that of the last instant."""
    said = [number for number, (tie, _) in enumerate(circle) if isinstance(tie, Bound) and not tie.behavior]
    return max(said, key=lambda number: circle[number][0].source, default=None)


def _is_beginning(tie: Place | Bound) -> bool:
    """True for the place that only says that nothing comes before the block."""
    return isinstance(tie, Place) and tie.kind == "order" and not (tie.source or tie.lag or tie.behavior)


def least(tie: Place | Bound) -> Seconds:
    """The least that the lag may be."""
    if isinstance(tie, Place):
        return tie.shortest
    return -inf if tie.stretch is None else tie.lag - tie.stretch
