"""Faults that a simulated body plays, switched on and off by who tries out what comes of them."""

from abc import abstractmethod
from collections.abc import Iterable
from typing import Any

from engage_hri.schemas import keys
from engage_hri.schemas.body import Capabilities, DescribeBody
from engage_hri.schemas.body_faults import BodyFault, BodyFaults, FaultsSwitched, SwitchFaults
from engage_hri.schemas.faults import Fault, NoReply
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus
from engage_hri.services.client.feeds import Feed
from engage_hri.services.client.results import in_time
from engage_hri.services.client.steering import Steering


class Faulting(Steering):
    """The part of `Robot` that knows of its body, and switches the faults that it plays."""

    _bus: Bus

    @abstractmethod
    def _feed(self, kinds: tuple[type, ...], *patterns: str) -> Feed[Any]:
        """Follow messages of these kinds."""

    async def switch_faults(
        self, faults: Iterable[BodyFault] = (), *, timeout: Seconds | None = None
    ) -> tuple[BodyFault, ...]:
        """Switch on exactly these faults of the body, in what is under way, too; returns what is on.

        Where others switch faults as well, `switch_on` and `switch_off` leave theirs as they are.

        faults: none: it is healthy again. `schemas/body_faults.py` says what each does. Rules for access keep this to
            operators and wizards.
        timeout: seconds to wait for the request to be accepted; None: for ever.

        Raises:
            InputRefused: the body cannot play one of them. Nothing has changed.
            RunFailed: control is gone, or has not come within `timeout`.
        """
        return await self._switch(on=tuple(faults), all_off=True, timeout=timeout)

    async def switch_on(self, *faults: BodyFault, timeout: Seconds | None = None) -> tuple[BodyFault, ...]:
        """Switch on these faults of the body besides those that are on; returns what is on.

        faults: each replaces one that differs from it in its amount alone. timeout, errors: as of `switch_faults`.
        """
        return await self._switch(on=faults, timeout=timeout)

    async def switch_off(self, *faults: BodyFault, timeout: Seconds | None = None) -> tuple[BodyFault, ...]:
        """Switch off these faults of the body, and no others; returns what is on.

        faults: of each, all go off that have the fields which it has; one with a kind alone means all of its kind.
        timeout, errors: as of `switch_faults`; InputRefused also if one of them is not on.
        """
        return await self._switch(off=faults, timeout=timeout)

    async def _switch(
        self,
        *,
        on: tuple[BodyFault, ...] = (),
        off: tuple[BodyFault, ...] = (),
        all_off: bool = False,
        timeout: Seconds | None,
    ) -> tuple[BodyFault, ...]:
        request = SwitchFaults(id=self._request_id("faults"), on=on, off=off, all_off=all_off)
        outcome = await self._ask(keys.FAULTS, request, timeout)
        assert isinstance(outcome, FaultsSwitched)
        return outcome.faults

    def body_faults(self) -> Feed[BodyFaults]:
        """Follow the faults that the body plays: now, and at every change."""
        return self._feed((BodyFaults,), keys.BODY_FAULTS)

    async def faults_on(self, timeout: Seconds | None = None) -> tuple[BodyFault, ...]:
        """Return the faults that the body plays now; waits for control.

        timeout: seconds to wait; None: for ever.

        Raises:
            NoReply: none within `timeout`.
        """
        with self.body_faults() as feed:
            return in_time(await feed.next(timeout), "state of the body", timeout).faults

    async def capabilities(self, timeout: Seconds = 1.0) -> Capabilities:
        """Return what the body says of itself: its parts and joints, what it can do, which faults it can play.

        timeout: seconds to wait for control.

        Raises:
            NoReply: no answer within `timeout`.
        """
        said = await self._bus.query(keys.DESCRIBE, DescribeBody(), timeout=timeout)
        if not isinstance(said, Capabilities):
            raise NoReply(Fault(reason="no capabilities of a body", where=keys.DESCRIBE))
        return said
