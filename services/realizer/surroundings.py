"""What a performance has around it, and how it ends."""

from collections.abc import Callable, Iterable, MutableMapping
from typing import TYPE_CHECKING, Literal

from msgspec import Struct

from schemas.faults import Fault
from services.bus import Bus
from services.realizer.config import RealizerConfig
from services.requests import Requester

if TYPE_CHECKING:
    from services.realizer.executor import Performance

Status = Literal["done", "failed", "interrupted"]


class Ending(Struct, frozen=True):
    """Why a block ends."""

    status: Status
    fault: Fault | None = None
    replaced_by: str = ""


class Surroundings(Struct, frozen=True):
    """What performances of one realizer share.

    is_there: is this participant alive? routes: whose body requests are whose. others: what else is performed.
    """

    bus: Bus
    requests: Requester
    config: RealizerConfig
    is_there: Callable[[str], bool]
    routes: MutableMapping[str, "Performance"]
    others: Callable[[], Iterable["Performance"]]
