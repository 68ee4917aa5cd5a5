"""What the performances of one realizer share."""

from collections.abc import Callable, Iterable, MutableMapping
from typing import Protocol

from msgspec import Struct

from engage_hri.schemas.body import SyncPointArrived, SyncPointReached
from engage_hri.services.bus.interface import Bus, Containing
from engage_hri.services.realizer.config import RealizerConfig
from engage_hri.services.realizer.perform.ledger import Ledger
from engage_hri.services.realizer.perform.presence import Presence
from engage_hri.services.requests.ends import Requester


class Moving(Protocol):
    """What a performance is to the others, and to the reports of the body."""

    @property
    def parts_moving(self) -> set[str]: ...
    def containing(self) -> Containing: ...
    def feed(self, message: SyncPointArrived | SyncPointReached) -> None: ...


class Surroundings(Struct, frozen=True):
    """routes: whose body requests are whose. others: all that are performed. ledger: what they may be tied to."""

    bus: Bus
    requests: Requester
    config: RealizerConfig
    peers: Presence
    routes: MutableMapping[str, Moving]
    others: Callable[[], Iterable[Moving]]
    ledger: Ledger
