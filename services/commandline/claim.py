"""Which of several `engage up` of one robot goes on, when they start at once and see one another late.

Each shows a token before it looks: first that it is starting, and once its services are there that it is up.
One that is starting gives way to one that is up, and to one that is starting whose id comes earlier; one that is up
gives way to none. So of two that meet, whenever that is, exactly one goes on.
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

PATIENCE: Seconds = 4.0
"""How long one that was killed may still seem to be there."""
_TOKEN = re.compile(r"(?P<starting>starting-)?up-(?P<id>[0-9a-f]{8})")


class StartClaim:
    """Of one that is starting, on a robot's services."""

    def __init__(self, robot: str, id: str) -> None:
        self._robot = robot
        self._id = id
        self._others: dict[str, bool] = {}
        """By token, those that are there: may they stay beside us?"""
        self.is_up = False

    def feed(self, message: Message) -> None:
        match message:
            case PeerAlive(participant=name) if (token := _TOKEN.fullmatch(name)) and token["id"] != self._id:
                self._others[name] = token["starting"] is not None and token["id"] > self._id
            case PeerGone(participant=name):
                self._others.pop(name, None)

    @property
    def is_good(self) -> bool:
        """May it go on?"""
        return self.is_up or all(self._others.values())

    @property
    def refusal(self) -> InputRefused:
        reason = f"robot {self._robot!r} has this on the bus already"
        advice = "stop what runs there, or give this one another --robot or another endpoint"
        return InputRefused(Fault(reason=reason, where="up", advice=advice))


class Claiming:
    """A claim, the tokens that show it, and what is heard of others."""

    def __init__(self, claim: StartClaim, presence: Subscription, up: Bus) -> None:
        self._claim = claim
        self._presence = presence
        self.bus = up
        """The bus of the one that goes on."""

    async def granted(self) -> None:
        """Return when nobody is in the way. Raises InputRefused for one that stays."""
        deadline = self.bus.now() + PATIENCE
        while len(self._presence) or not self._claim.is_good:
            received = await self._presence.next(deadline)
            if received is None:
                raise self._claim.refusal
            self._claim.feed(received.message)

    async def held_until(self, ready: asyncio.Event) -> None:
        """Watch until its services are there; from then on it gives way to none. Raises InputRefused when it must."""
        watching = asyncio.create_task(self._watch(), name="claim")
        waiting = asyncio.create_task(ready.wait(), name="services")
        try:
            await asyncio.wait((watching, waiting), return_when=asyncio.FIRST_COMPLETED)
            await asyncio.sleep(0)  # what has arrived by now counts
            if watching.done():
                watching.result()
            self._claim.is_up = True
            self.bus.declare_alive()
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
    """id: what decides between two that are starting; by chance if none is given."""
    id = id or uuid.uuid4().hex[:8]
    starting, up = hub.join(f"starting-up-{id}"), hub.join(f"up-{id}")
    try:
        with starting.subscribe(keys.ANY_ALIVE) as presence:
            starting.declare_alive()
            await hub.wait_until_free()  # until all are known who are there
            yield Claiming(StartClaim(hub.robot, id), presence, up)
    finally:
        await starting.leave()
        await up.leave()
