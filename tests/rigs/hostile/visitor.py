"""An honest client during an attack: it asks for blocks and fragments, cancels some, and counts how each ends."""

import asyncio
from collections import Counter
from random import Random

from engage_hri.schemas import keys
from engage_hri.schemas.blocks import InterruptBehavior, PerformBlock
from engage_hri.schemas.faults import EngageError
from engage_hri.schemas.fragments import PerformFragment
from engage_hri.schemas.requests import Request
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus
from engage_hri.services.requests.ends import Pending, Requester
from tests.rigs.hostile import plausible

NAME = "visitor"
MOST = 5
"""Most blocks and fragments asked for at a time."""


class Visitor:
    """A client that keeps to the protocol. entities: ids of what the world holds. servers: services that run."""

    def __init__(self, chance: Random, entities: tuple[str, ...], servers: tuple[str, ...]) -> None:
        self._chance = chance
        self._entities = entities
        self._servers = servers
        self.asked: list[Pending] = []

    @property
    def hung(self) -> list[str]:
        """Ids of requests that have not ended."""
        return [pending.request.id for pending in self.asked if not pending.outcome.done()]

    def ends(self) -> Counter[str]:
        """Count the requests that have ended, by the name of the outcome or error."""
        outcomes = [pending.outcome for pending in self.asked if pending.outcome.done()]
        ended = [outcome for outcome in outcomes if not outcome.cancelled()]
        return Counter(type(outcome.exception() or outcome.result()).__name__ for outcome in ended)

    async def visit(self, bus: Bus, requests: Requester, seconds: Seconds) -> None:
        """Ask for a few blocks and fragments, again and again, for so many seconds."""
        chance, until, number = self._chance, bus.now() + seconds, 0
        while bus.now() < until:
            for _ in range(chance.randrange(1, MOST + 1)):
                number += 1
                self._ask(requests, number)
            await asyncio.sleep(chance.uniform(0.0, 3.0))
            self._change_mind(requests, f"{NAME}/{number}i")
            await asyncio.sleep(chance.uniform(0.0, 6.0))

    def _ask(self, requests: Requester, number: int) -> None:
        chance, id = self._chance, f"{NAME}/{number}"
        if "generation" in self._servers and chance.random() < 0.25:
            asked: Request = PerformFragment(id=id, fragment=plausible.fragment(chance, f"f{number}", self._entities))
            self.asked.append(requests.send(keys.FRAGMENT, asked))
        else:
            # Now and then under the id of another live block.
            name = f"v{number if chance.random() < 0.9 else number - 1}"
            asked = PerformBlock(id=id, block=plausible.block(chance, name, self._entities))
            self.asked.append(requests.send(keys.BLOCK, asked))

    def _change_mind(self, requests: Requester, id: str) -> None:
        pending = self._chance.choice(self.asked)
        match self._chance.randrange(0, 4):
            case 0 | 1:
                requests.cancel(pending.request.id, "never mind")
            case 2 if isinstance(pending.request, PerformBlock):
                behavior = self._chance.choice(("b1", "b2", "b3"))
                interrupt = InterruptBehavior(id=id, block=pending.request.block.id, behavior=behavior)
                self.asked.append(requests.send(keys.BLOCK, interrupt))


async def client_fault(client: asyncio.Task[None], patience: Seconds, since: Seconds) -> str:
    """Say what is wrong with how a client under test ended; empty: it ended well, or with an `EngageError`.

    patience: seconds that it may still take. since: seconds from the end of the attack until then.
    """
    done, _ = await asyncio.wait([client], timeout=patience)
    if not done:
        client.cancel()
        await asyncio.wait([client])
        return f"the client has not ended {since:g} s after the attack"
    if client.cancelled():
        return "the client was cancelled"
    error = client.exception()
    return "" if error is None or isinstance(error, EngageError) else f"the client ended: {error!r}"
