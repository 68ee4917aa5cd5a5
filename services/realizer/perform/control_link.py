"""What one block asks of the body."""

from collections.abc import Iterable

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import BlockBehavior
from engage_hri.schemas.body import GoHome, PerformBehavior, PlannedInstant
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus
from engage_hri.services.realizer.decide.effects import Begin, Extend
from engage_hri.services.requests.ends import Pending, Requester

LONGEST_WAY: Seconds = 10.0
"""Home: a body that does not say that it is there is not asked for longer."""


class ControlLink:
    """request: the id of the block's; a behavior's is `<request>/<behavior>`. No behavior's id holds a colon."""

    def __init__(self, bus: Bus, requests: Requester, request: str, block: str) -> None:
        self._bus = bus
        self._requests = requests
        self._request = request
        self._block = block

    def id(self, behavior: str) -> str:
        """Of the request for a behavior, whoever performs it."""
        return f"{self._request}/{behavior}"

    def perform(self, behavior: BlockBehavior, asked: Begin | Extend) -> Pending:
        """Begin, or go on as far as is asked."""
        perform = PerformBehavior(
            id=self.id(behavior.id),
            block=self._block,
            behavior=behavior,
            through=asked.through.partition(":")[0],  # nobody asks for a repetition
            pace=tuple(PlannedInstant(sync=sync, at=self._bus.stamp(at)) for sync, at in asked.pace),
        )
        return self._requests.send(keys.BEHAVIOR, perform)

    def abort(self, behavior: str) -> None:
        self._requests.cancel(self.id(behavior), "aborted")

    def go_home(self, parts: Iterable[str], behavior: str = "") -> None:
        """behavior: for whose sake; empty: the block's."""
        going = GoHome(id=f"{self.id(behavior)}:home", parts=tuple(sorted(parts)))
        self._requests.send(keys.BEHAVIOR, going, within=LONGEST_WAY)
