"""Requests of one block to the body."""

from collections.abc import Iterable

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import BlockBehavior
from engage_hri.schemas.body import GoHome, PerformBehavior, PlannedInstant
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus
from engage_hri.services.realizer.config import RealizerConfig
from engage_hri.services.realizer.decide.effects import Begin, Extend
from engage_hri.services.requests.ends import Pending, Requester

LONGEST_WAY: Seconds = 10.0
"""Most seconds on the way home; a body that does not say that it is there is not asked for longer."""


class ControlLink:
    """Sends the body what one block asks of it.

    request: the id of the block's request; that of a behavior is `<request>/<behavior>`, with `%2F` for a slash in
    the behavior's, so that no two are alike. Ids of behaviors hold no colon.
    """

    def __init__(self, bus: Bus, requests: Requester, request: str, block: str, config: RealizerConfig) -> None:
        self._bus = bus
        self._requests = requests
        self._request = request
        self._block = block
        self._held_after = config.held_after

    def id(self, behavior: str) -> str:
        """Id of the request for a behavior, to whatever service performs it."""
        quoted = behavior.replace("%", "%25").replace("/", "%2F")
        return f"{self._request}/{quoted}"

    def perform(self, behavior: BlockBehavior, asked: Begin | Extend) -> Pending:
        """Ask the body to begin a behavior, or to go on as far as is asked."""
        perform = PerformBehavior(
            id=self.id(behavior.id),
            block=self._block,
            behavior=behavior,
            through=asked.through.partition(":")[0],  # without the number of a repeated stroke
            pace=tuple(PlannedInstant(sync=sync, at=self._bus.stamp(at)) for sync, at in asked.pace),
            held=isinstance(asked, Extend) and asked.held,
            held_after=self._held_after,
        )
        return self._requests.send(keys.BEHAVIOR, perform)

    def cancel(self, behavior: str, why: Fault | str) -> None:
        """Cancel the request for a behavior, to whatever service performs it. why: what has happened."""
        self._requests.cancel(self.id(behavior), why)

    def go_home(self, parts: Iterable[str], behavior: str = "") -> None:
        """Send these parts home. behavior: the one that used them; empty: the whole block."""
        going = GoHome(id=f"{self.id(behavior)}:home", parts=tuple(sorted(parts)))
        self._requests.send(keys.BEHAVIOR, going, within=LONGEST_WAY)
