"""Petri net of a live block, and where its tokens are: to watch a block run."""

from msgspec import Struct

from engage_hri.schemas.units import Seconds, Stamp


class NetTransition(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """An instant. name: the sync points that share it. time: seconds from the block's start, as planned."""

    name: str
    time: Seconds = 0.0


class NetPlace(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A place between two transitions, named by their numbers.

    kind: `phase` of a behavior, `delay`, `order`, `series`, `handover` or `idle`. lag: least seconds that a token
    takes through it. behavior: the one that has this phase, or that waits there.
    """

    kind: str
    source: int
    target: int
    lag: Seconds = 0.0
    behavior: str = ""


class NetPlanned(Struct, frozen=True, kw_only=True, tag="net_planned", omit_defaults=True):
    """stream: realizer: the net that a block runs on from now on; again when something was dropped.

    at: when the block started. marked: numbers of the places that hold a token.
    """

    block: str
    at: Stamp
    transitions: tuple[NetTransition, ...]
    places: tuple[NetPlace, ...]
    marked: tuple[int, ...] = ()


class Fired(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A transition that has fired, `time` seconds after the block's start."""

    transition: int
    time: Seconds


class NetMarked(Struct, frozen=True, kw_only=True, tag="net_marked", omit_defaults=True):
    """stream: realizer: what has changed in the marking of a block's net since the last message.

    fired: transitions, in order. put: places that hold a token now and did not. taken: places that did and do not.
    is_over: the block has ended.
    """

    block: str
    fired: tuple[Fired, ...] = ()
    put: tuple[int, ...] = ()
    taken: tuple[int, ...] = ()
    is_over: bool = False
