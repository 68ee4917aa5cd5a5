"""The predicted schedule of a net: phases last as long as is natural, faster or slower only where they must be."""

from math import inf

from schemas.units import Seconds
from services.realizer.net import Bound, PetriNet, Place
from services.realizer.schedule import EPSILON, Lag, PositiveCycle, Solution, solve


class Impossible(Exception):
    """No schedule, with every phase of these ties as short or long as can be: they lead back to their start.

    ties: in order around the circle, each with the seconds it asks for.
    """

    def __init__(self, ties: tuple[tuple[Place | Bound, Seconds], ...]) -> None:
        self.ties = ties
        super().__init__(f"a cycle of {sum(seconds for _, seconds in ties):+g} s")


def predict(net: PetriNet) -> Solution:
    """The earliest schedule; `reason` of a cause is the number of the place or, after them, of the bound.

    What a cycle takes too long is shared by its phases, each according to the room it has. Raises Impossible.
    """
    ties: tuple[Place | Bound, ...] = (*net.places, *net.bounds)
    lags = [Lag(tie.source, tie.target, tie.lag, number) for number, tie in enumerate(ties) if tie.kind != "idle"]
    index: dict[int, int] = {}
    while True:
        try:
            return solve([0.0] * len(net.transitions), (), lags)
        except PositiveCycle as found:
            index = index or {lag.reason: number for number, lag in enumerate(lags)}
            for cycle in found.cycles:
                for lag in _with_room(cycle, ties):
                    lags[index[lag.reason]] = lag


def _with_room(cycle: tuple[Lag, ...], ties: tuple[Place | Bound, ...]) -> list[Lag]:
    """The lags of the cycle that give way, so that it is no longer positive."""
    excess = sum(lag.seconds for lag in cycle)
    room = [lag.seconds - _least(ties[lag.reason]) for lag in cycle]
    if (total := sum(room)) < excess - EPSILON:
        raise Impossible(tuple((ties[lag.reason], lag.seconds) for lag in cycle))
    if total == inf:
        shares = [float(each == inf) for each in room]
        shares = [share / sum(shares) for share in shares]
    else:
        shares = [each / total for each in room]
    return [
        lag._replace(seconds=lag.seconds - excess * share) for lag, share in zip(cycle, shares, strict=True) if share
    ]


def _least(tie: Place | Bound) -> Seconds:
    """What the lag may be reduced to."""
    if isinstance(tie, Place):
        return tie.shortest
    return -inf if tie.stretch is None else tie.lag - tie.stretch
