"""The Petri net of a block, as data: thesis 4.3. Places and transitions, a marking, and what may fire.

A transition is one instant, shared by all sync points that are synchronized there. A place is the phase of a
behavior between two of its points, a delay, or a mere order. Every place has one input and one output: a timed
marked graph. Transitions are numbered in an order in which they can fire.

`idle` places hold the tokens at rest. One lies between the end of the block and its start; one at each behavior
that may outlast the block, from its end to its start. So the net is live exactly if nothing in the block waits for
itself, and no place ever holds a second token.

Backward arcs (an upper bound, a phase that cannot stretch) hold no tokens: they only bound the schedule.
"""

from collections import deque
from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import Literal, NamedTuple

from msgspec import Struct

from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.points import Point

PlaceKind = Literal["phase", "delay", "order", "series", "handover", "idle"]
"""Kinds of places and bounds.

handover: the start of the successor cuts a behavior short. The successor does not wait for that: a behavior that
is early goes home. series: nothing in the block asks for this order in so many words.
"""
Marking = bytes
"""Tokens in each place, a byte for each: to copy a marking is quick."""


class Transition(Struct, frozen=True, gc=False):
    """One instant. name: its points, `gaze-1:stroke = point-1:start`."""

    name: str
    points: tuple[Point, ...]


class Place(Struct, frozen=True, gc=False):
    """Place from transition `source` to `target`; a token takes at least `lag` seconds through it.

    shortest: the least that the lag can be; only the phase of a behavior has less than `lag`.
    behavior: the one that has this phase, or that waits here since it cannot wait at a later point.
    lines: of the XML that asks for it. after: behavior of which the token comes, when it passes the source, as that
    of a phase does; empty: of the transition, when all have passed. stopped: seconds by which the plan was made with
    a longer lag, since holds have stopped the token so far.
    """

    kind: PlaceKind
    source: int
    target: int
    lag: Seconds = 0.0
    shortest: Seconds = 0.0
    behavior: str = ""
    lines: tuple[int, ...] = ()
    after: str = ""
    stopped: Seconds = 0.0


class Bound(Struct, frozen=True, gc=False):
    """Upper bound: `target` is no earlier than `source` + `lag`, so `source` is no later than `target` - `lag`.

    lag: negative, but for bounds on the start of the block. kind phase: a behavior cannot wait in this phase; it can
    take `stretch` seconds more than natural (None: any). stopped: see `Place`.
    """

    kind: PlaceKind
    source: int
    target: int
    lag: Seconds
    stretch: Seconds | None = 0.0
    behavior: str = ""
    lines: tuple[int, ...] = ()
    stopped: Seconds = 0.0


class PetriNet(Struct, frozen=True, dict=True):
    """A timed marked graph. Transition 0 is the start of the block, the last one its end."""

    transitions: tuple[Transition, ...]
    places: tuple[Place, ...]
    bounds: tuple[Bound, ...] = ()

    def later(self, sources: Iterable[int], *, of_instants: bool = False) -> set[int]:
        """Transitions that come after one of these, and these.

        of_instants: without what comes after a behavior that passes one, not after the instant itself.
        """
        return _reachable(self, sources, forward=True, is_of_instants=of_instants)

    def earlier(self, targets: Iterable[int]) -> set[int]:
        """Transitions that come before one of these, and these."""
        return _reachable(self, targets, forward=False)

    @cached_property
    def initial(self) -> Marking:
        """The marking before the block starts: a token in each `idle` place."""
        return bytes(place.kind == "idle" for place in self.places)

    @cached_property
    def inputs(self) -> Sequence[Sequence[int]]:
        """For each transition, the places that it takes a token from."""
        return self._by_transition([place.target for place in self.places])

    @cached_property
    def outputs(self) -> Sequence[Sequence[int]]:
        """For each transition, the places that it puts a token into."""
        return self._by_transition([place.source for place in self.places])

    def _by_transition(self, ends: list[int]) -> list[tuple[int, ...]]:
        found: list[list[int]] = [[] for _ in self.transitions]
        for place, transition in enumerate(ends):
            found[transition].append(place)
        return list(map(tuple, found))


class Firing(NamedTuple):
    """Result of firing. fired: the transitions, in order. marking: after the last of them."""

    fired: tuple[int, ...]
    marking: Marking


def fire_once_each(net: PetriNet, marking: Marking) -> Firing:
    """Fire whatever is enabled, each transition once at most, until none is left that could.

    From the initial marking of a live net: every transition, and the initial marking again.
    """
    tokens = bytearray(marking)
    inputs, outputs, places = net.inputs, net.outputs, net.places
    empty = [sum([not tokens[place] for place in into]) for into in inputs]
    ready = deque(each for each, count in enumerate(empty) if not count)
    fired: list[int] = []
    done = bytearray(len(inputs))
    while ready:
        if done[transition := ready.popleft()]:
            continue
        done[transition] = 1
        fired.append(transition)
        for place in inputs[transition]:
            tokens[place] -= 1
            if not tokens[place]:
                empty[transition] += 1
        for place in outputs[transition]:
            tokens[place] += 1
            if tokens[place] == 1:
                target = places[place].target
                empty[target] -= 1
                if not empty[target]:
                    ready.append(target)
    return Firing(tuple(fired), bytes(tokens))


def is_live(net: PetriNet) -> bool:
    """True if every transition can always fire again; in a marked graph, if every cycle holds a token.

    That is so if the transitions can be put in order along the places that hold none.
    """
    return order(net) is not None


def order(net: PetriNet) -> tuple[int, ...] | None:
    """The transitions in an order along all places without a token; None if there is no such order."""
    fired, _ = fire_once_each(net, net.initial)
    return fired if len(fired) == len(net.transitions) else None


def is_safe(net: PetriNet) -> bool:
    """True if no place ever holds two tokens; in a live marked graph, if each place is on a cycle with one token."""
    ends = [((place.source, place.target), count) for place, count in zip(net.places, net.initial, strict=True)]
    tokens = {pair for pair, count in ends if count}
    open_places = {pair for pair, count in ends if not count and pair[::-1] not in tokens}
    for source, target in tokens:
        after, before = _reachable(net, (target,), forward=True), _reachable(net, (source,), forward=False)
        if source not in after:
            return False  # No cycle limits the tokens that come to this one.
        open_places = {(since, to) for since, to in open_places if since not in after or to not in before}
    return not open_places and is_live(net)


def _reachable(net: PetriNet, starts: Iterable[int], *, forward: bool, is_of_instants: bool = False) -> set[int]:
    """Transitions of `starts`, and those on paths from or to them through places without a token at rest."""
    found = set(starts)
    todo = list(found)
    while todo:
        here = todo.pop()
        for number in net.outputs[here] if forward else net.inputs[here]:
            if not net.initial[number]:
                place = net.places[number]
                there = place.target if forward else place.source
                if there not in found and not (is_of_instants and place.after):
                    found.add(there)
                    todo.append(there)
    return found
