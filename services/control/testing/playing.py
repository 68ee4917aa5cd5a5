"""Faults that a simulated body can play, as makers of bodies that have each: for `faults` of a suite."""

import asyncio
from collections.abc import Callable, Iterable, Mapping

from engage_hri.schemas.body import Capabilities
from engage_hri.schemas.body_faults import BodyFault, kind_of, parts_of, words
from engage_hri.services.control.contract.body import Body
from engage_hri.services.control.testing.plugin import virtual_loop

Make = Callable[[], Body]
BY_ENCODERS = ("noisy",)
"""Kinds that make measurements worse and nothing else: for these a suite states `noise`."""
AMOUNT = 10.0
"""Of a kind that needs an amount and has no usual one: degrees, as far as its range goes."""


def playable(able: Capabilities) -> tuple[BodyFault, ...]:
    """List a fault of each kind that a body can play, in every part that can have it, or in its first joint."""
    found = []
    for kind in able.faults:
        row, part, amount = kind_of(kind, able), "", None
        if kind in BY_ENCODERS:
            continue
        if row is not None and row.on == "joint":
            if not (known := parts_of(row, able)):
                continue
            part = known[0]
        if row is not None and row.needs_amount:
            amount = row.usual if row.usual is not None else min(max(AMOUNT, row.low), row.high)
        found.append(BodyFault(kind=kind, part=part, amount=amount))
    return tuple(found)


def played(make: Make, faults: Iterable[BodyFault] | None = None) -> Mapping[str, Make]:
    """Name faults in words, and say how to make the body that has each from its start.

    make: makes the body without faults. faults: None: one of each kind that it says it can play; to know these, a
    body is made, in a loop of its own.
    """
    return {words(fault): Played(make, fault) for fault in (faults if faults is not None else _all(make))}


class Played:
    """Maker of a body that has a fault from its start to its end: one of it is as good as the next."""

    def __init__(self, make: Make, fault: BodyFault) -> None:
        self._make, self._fault = make, fault

    def __call__(self) -> Body:
        body = self._make()
        body.switch_faults((self._fault,))
        return body


def _all(make: Make) -> tuple[BodyFault, ...]:
    try:
        asyncio.get_running_loop()
    except RuntimeError:  # pytest asks for the names before it runs a test
        with asyncio.Runner(loop_factory=virtual_loop) as runner:
            return playable(runner.run(_able(make)))
    return playable(make().capabilities)


async def _able(make: Make) -> Capabilities:
    return make().capabilities
