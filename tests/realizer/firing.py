"""Petri nets by the book: which transitions are enabled, and the marking after one of them has fired."""

from collections.abc import Iterable

from engage_hri.services.realizer.net.petri_net import Marking, PetriNet


def enabled(net: PetriNet, marking: Marking, among: Iterable[int] | None = None) -> tuple[int, ...]:
    """The transitions that have a token in each input place. among: those to look at; None: all."""
    inputs = net.inputs
    each = range(len(net.transitions)) if among is None else among
    return tuple(one for one in each if all(marking[place] for place in inputs[one]))


def fire(net: PetriNet, marking: Marking, transition: int) -> Marking:
    """The marking after `transition`. Raises ValueError if it is not enabled."""
    tokens = bytearray(marking)
    for place in net.inputs[transition]:
        if not tokens[place]:
            raise ValueError(f"{net.transitions[transition].name!r} is not enabled: place {place} is empty")
        tokens[place] -= 1
    for place in net.outputs[transition]:
        tokens[place] += 1
    return bytes(tokens)
