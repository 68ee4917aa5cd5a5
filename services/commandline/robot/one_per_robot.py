"""Election of one `engage up` for a robot, when several start at once and see one another late.

Each `engage up` shows a token before it looks for others: first that it is starting, and once its services run that
it is up. One that is starting gives way to one that is up, and to one that is starting with an id earlier in the
alphabet; one that is up gives way to none. So exactly one of any two goes on.
"""

import asyncio
import re
import uuid
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.messages import Message
from engage_hri.schemas.presence import PeerAlive, PeerGone
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus, Hub, Subscription
from engage_hri.services.runtime.service import check_name

PATIENCE: Seconds = 4.0
"""Time for which a killed `engage up` may still seem to be there."""
_TOKEN = re.compile(r"up-(?P<starting>starting-)?(?P<id>[0-9a-f]{8})")


class StartClaim:
    """Claim of a starting `engage up` to be the only one of its robot."""

    def __init__(self, robot: str, id: str) -> None:
        self._robot = robot
        self._id = id
        self._others: dict[str, bool] = {}
        """Tokens of the others; True: that one has to give way to us."""
        self.is_up = False

    def feed(self, message: Message) -> None:
        match message:
            case PeerAlive(participant=name) if (token := _TOKEN.fullmatch(name)) and token["id"] != self._id:
                self._others[name] = token["starting"] is not None and token["id"] > self._id
            case PeerGone(participant=name):
                self._others.pop(name, None)

    @property
    def is_good(self) -> bool:
        """True if no other has precedence."""
        return self.is_up or all(self._others.values())

    @property
    def refusal(self) -> InputRefused:
        reason = f"robot {self._robot!r} has this on the bus already"
        advice = "stop what runs there, or give this one another --robot or another endpoint"
        return InputRefused(Fault(reason=reason, where="up", advice=advice))


class Claiming:
    """A claim with the tokens that show it and the subscription to those of others."""

    def __init__(self, claim: StartClaim, presence: Subscription, starting: Bus, up: Bus) -> None:
        self._claim = claim
        self._presence = presence
        self._starting = starting
        self.bus = up
        """Bus for the use of the winner."""

    async def granted(self) -> None:
        """Wait until no other has precedence. Raises InputRefused if one stays."""
        deadline = self.bus.now() + PATIENCE
        while len(self._presence) or not self._claim.is_good:
            received = await self._presence.next(deadline)
            if received is None:
                raise self._claim.refusal
            self._claim.feed(received.message)

    async def held_until(self, ready: asyncio.Event) -> None:
        """Hold the claim until the services run; then it gives way to none. Raises InputRefused if it must before."""
        watching = asyncio.create_task(self._watch(), name="claim")
        waiting = asyncio.create_task(ready.wait(), name="services")
        try:
            await asyncio.wait((watching, waiting), return_when=asyncio.FIRST_COMPLETED)
            await asyncio.sleep(0)  # tokens that have arrived by now count
            if watching.done():
                watching.result()
            self._claim.is_up = True
            self.bus.declare_alive()
            watching.cancel()
            await self._starting.leave()  # after the other token, so that one of the two is always seen
        finally:
            watching.cancel()
            waiting.cancel()

    async def _watch(self) -> None:
        while self._claim.is_good:
            received = await self._presence.next()
            assert received is not None
            self._claim.feed(received.message)
        raise self._claim.refusal


@asynccontextmanager
async def claiming(hub: Hub, id: str = "") -> AsyncIterator[Claiming]:
    """Claim a robot while the body of `async with` runs. id: decides between two that are starting; empty: random.

    Raises InputRefused if the keys are not those of `up`.
    """
    check_name(hub, "up")
    id = id or uuid.uuid4().hex[:8]
    starting, up = hub.join(f"up-starting-{id}"), hub.join(f"up-{id}")
    try:
        with starting.subscribe(keys.ANY_ALIVE) as presence:
            starting.declare_alive()
            await hub.wait_until_free()  # until all participants are known
            yield Claiming(StartClaim(hub.robot, id), presence, starting, up)
    finally:
        await starting.leave()
        await up.leave()
