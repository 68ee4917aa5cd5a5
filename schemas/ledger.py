"""Ledger of a service: what it took, in the order in which it did, so that a recording can be played to it once more.

What a recorder hears, it hears in an order of its own: each process is heard in order, but two of them need not come
to two listeners in the same one. Streams may reach one and not the other, and what a driver tells its service is on
no bus. So each service tells itself what it took, and a fingerprint of what that led to.
"""

from typing import Annotated, Any

from msgspec import Meta, Struct

from engage_hri.schemas.units import Seconds, Stamp


class ReadClock(Struct, frozen=True, array_like=True):
    """A clock of another machine as a step read it: the own one is at `its instant + offset`.

    offset: None: nothing is known of the clock; then all its instants read as now. error: None: without bound.
    """

    clock: str
    offset: Seconds | None
    error: Seconds | None


class Step(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A step of a service: it took an input, or did what was due.

    now: on the clock of the service. life, number: of the message that it took, on any key of the classes `evt` and
    `state`; it is not repeated here. key, source, content: of any other input, whole: a message, where a request has
    the name that the service knows it by as its id; or, without a key, what came by no bus, as `intake.py` of the
    service says. at: local time of arrival, if it is not `now`. clocks: those that were read. led_to: fingerprint of
    all that followed; empty: nothing. is_same_turn: no task of the service ran between the step before and this one.
    """

    now: Seconds
    life: str = ""
    number: Annotated[int, Meta(ge=0)] = 0
    key: str = ""
    source: str = ""
    content: Any = None
    at: Seconds | None = None
    past: bool = False
    clocks: tuple[ReadClock, ...] = ()
    led_to: str = ""
    is_same_turn: bool = False


class Taken(Struct, frozen=True, kw_only=True, tag="taken", omit_defaults=True):
    """evt: a service -> recorders: steps, in order; only while somebody listens. They come before what they led to.

    session: the life of the service, as in the ids of its events. first: number of the first step in that life, from
    1; steps before were not told. Its configuration is in its `ServiceSettings`.
    """

    service: str
    session: str
    at: Stamp
    first: Annotated[int, Meta(ge=1)]
    steps: tuple[Step, ...]
