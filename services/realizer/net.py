"""The Petri net of a block, as data: thesis 4.3. Places and transitions, a marking, and what may fire.

A transition is one instant, shared by all sync points that are synchronized there. A place is the phase of a
behavior between two of its points, a delay, or a mere order. Every place has one input and one output: a timed
marked graph, live if and only if every cycle holds a token. The only token at rest lies in `idle`, between the
end of the block and its start, so the net is live exactly if nothing in the block waits for itself.

Backward arcs (an upper bound, a phase that cannot stretch) hold no tokens: they only bound the schedule.
"""

from collections import deque
from typing import Literal

from msgspec import Struct

from schemas.units import Seconds
from services.realizer.points import Point

PlaceKind = Literal["phase", "delay", "order", "series", "idle"]
Marking = tuple[int, ...]
"""Tokens in each place."""


class Transition(Struct, frozen=True):
    """One instant. name: its points, `gaze-1:stroke = point-1:start`."""

    name: str
    points: tuple[Point, ...]


class Place(Struct, frozen=True):
    """From transition `source` to `target`, taking at least `lag` seconds. lines: of the XML that asks for it.

    shortest: what the lag can be at the very least; differs from `lag` only for the phase of a behavior.
    """

    kind: PlaceKind
    source: int
    target: int
    lag: Seconds = 0.0
    shortest: Seconds = 0.0
    behavior: str = ""
    lines: tuple[int, ...] = ()


class Bound(Struct, frozen=True):
    """`target` is no earlier than `source` + `lag`, and `lag` is negative: `source` is no later than ...

    kind phase: a behavior cannot wait in this phase, `stretch` seconds more than natural at most (None: any).
    """

    kind: PlaceKind
    source: int
    target: int
    lag: Seconds
    stretch: Seconds | None = 0.0
    behavior: str = ""
    lines: tuple[int, ...] = ()


class PetriNet(Struct, frozen=True):
    """Transition 0 is the start of the block, the last one its end."""

    transitions: tuple[Transition, ...]
    places: tuple[Place, ...]
    bounds: tuple[Bound, ...] = ()

    @property
    def initial(self) -> Marking:
        return tuple(int(place.kind == "idle") for place in self.places)


def inputs(net: PetriNet) -> tuple[tuple[int, ...], ...]:
    """Of each transition, the places it takes a token from."""
    return _by_transition(net, [place.target for place in net.places])


def outputs(net: PetriNet) -> tuple[tuple[int, ...], ...]:
    """Of each transition, the places it puts a token into."""
    return _by_transition(net, [place.source for place in net.places])


def _by_transition(net: PetriNet, ends: list[int]) -> tuple[tuple[int, ...], ...]:
    found: list[list[int]] = [[] for _ in net.transitions]
    for place, transition in enumerate(ends):
        found[transition].append(place)
    return tuple(map(tuple, found))


def enabled(net: PetriNet, marking: Marking) -> tuple[int, ...]:
    """The transitions whose every input place holds a token."""
    return tuple(each for each, places in enumerate(inputs(net)) if all(marking[place] for place in places))


def fire(net: PetriNet, marking: Marking, transition: int) -> Marking:
    """The marking after `transition`. Raises ValueError if it is not enabled."""
    tokens = list(marking)
    for place in inputs(net)[transition]:
        if not tokens[place]:
            raise ValueError(f"{net.transitions[transition].name!r} is not enabled: place {place} is empty")
        tokens[place] -= 1
    for place in outputs(net)[transition]:
        tokens[place] += 1
    return tuple(tokens)


def order(net: PetriNet) -> tuple[int, ...] | None:
    """Transitions in an order they can fire in, starting with 0; None if some wait for each other for ever."""
    into, out = inputs(net), outputs(net)
    missing = [sum(net.places[place].kind != "idle" for place in places) for places in into]
    ready = deque(each for each, count in enumerate(missing) if count == 0)
    fired = []
    while ready:
        fired.append(transition := ready.popleft())
        for place in out[transition]:
            if net.places[place].kind != "idle":
                missing[target := net.places[place].target] -= 1
                if missing[target] == 0:
                    ready.append(target)
    return tuple(fired) if len(fired) == len(net.transitions) else None


def is_live(net: PetriNet) -> bool:
    """Can every transition always fire again? For a marked graph: does every cycle hold a token?"""
    return order(net) is not None
