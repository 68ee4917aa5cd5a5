"""Behaviors that the body performs: what was asked, how far each has come, and why it waits."""

from typing import Literal

from engage_hri.schemas.behaviors import Speech
from engage_hri.schemas.body import PerformBehavior
from engage_hri.schemas.faults import Fault
from engage_hri.services.control.contract.body import MovementAuthority

Status = Literal["done", "taken_over", "aborted", "lapsed", "failed"]


class LiveBehavior:
    """A `PerformBehavior` that is under way."""

    def __init__(self, request: PerformBehavior, id: str, authority: MovementAuthority) -> None:
        """id: as the requester gave it; `request.id` is unique among the requests of all requesters."""
        self.request = request
        self.id = id
        self.authority = authority
        self.position = 0
        self.status: Status = "aborted"
        self.fault: Fault | None = None
        self.aborted: Status = "aborted"
        """Its status if it ends early: `lapsed` without its requester."""
        self.why: Fault | None = None
        """Why it is to end early."""
        self.passed = ""
        """The last sync point that it has passed."""
        self.aborts: list[str] = []
        """Ids of the abort requests that end with this behavior."""
        self._is_held = False
        self._is_unheard = False
        self.hold(request.held)

    @property
    def label(self) -> str:
        return f"{self.request.block}:{self.request.behavior.id}"

    @property
    def spoken(self) -> str:
        """Text that the voice has said so far; empty for a behavior that is no speech."""
        behavior = self.request.behavior
        return behavior.text[: self.position] if isinstance(behavior, Speech) else ""

    def stop(self, why: Fault, status: Status = "aborted") -> None:
        """Note why it is to end early. status: `lapsed` without its requester."""
        if self.why is None:
            self.aborted, self.why = status, why

    def hold(self, is_held: bool) -> None:
        """Hold it on request, or no more."""
        self._is_held = is_held
        self._apply()

    def miss(self, is_unheard: bool) -> None:
        """Hold it because its requester is not heard, or no more."""
        self._is_unheard = is_unheard
        self._apply()

    def _apply(self) -> None:
        if self._is_held or self._is_unheard:
            self.authority.hold()
        else:
            self.authority.go_on()
