"""Behaviors that the body performs: what was asked, how far each has come, and why it waits. Pure."""

from typing import Literal

from engage_hri.schemas.behaviors import Speech
from engage_hri.schemas.body import PerformBehavior
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.contract.body import MovementAuthority
from engage_hri.services.control.serving.progress_check import Told
from engage_hri.services.control.serving.words_for_voice import spoken

Status = Literal["done", "taken_over", "aborted", "lapsed", "failed"]


class LiveBehavior:
    """A `PerformBehavior` that is under way.

    id: as the requester gave it; `request.id` is unique among the requests of all requesters.
    authority: what it may do, as it was decided; the one that the driver has is made to say the same.
    voiced: the behavior as the driver is given it. told: what the driver has told of it.
    is_accepted: true once the driver has told anything. position: characters that the voice has said.
    passed: the last sync point that it has passed. status, fault: of its outcome, if it ended now.
    why: why it is to end early. lapses: true if it does so without its requester.
    aborts: ids of the abort requests that end with it.
    is_held: somebody has asked to hold it. is_unheard: it is held because its requester is not heard.
    overdue: time at which its driver has not done what it was told; None: it was told nothing of the kind.
    is_broken_off: the driver was cut off, for it did not end it. is_broken: the driver has told what cannot be.
    """

    def __init__(self, request: PerformBehavior, id: str, now: Seconds) -> None:
        """Begin. Raises ValueError: the behavior has no sync point `through`."""
        self.request = request
        self.id = id
        self.authority = MovementAuthority(request.behavior, request.through)
        self.voiced = spoken(request.behavior)
        self.told = Told(self.voiced, self.authority, now)
        self.is_accepted = False
        self.position = 0
        self.passed = ""
        self.status: Status = "aborted"
        self.fault: Fault | None = None
        self.why: Fault | None = None
        self.lapses = False
        self.aborts: list[str] = []
        self.is_held = request.held
        self.is_unheard = False
        self.overdue: Seconds | None = None
        self.is_broken_off = False
        self.is_broken = False

    @property
    def label(self) -> str:
        return f"{self.request.block}:{self.request.behavior.id}"

    @property
    def spoken(self) -> str:
        """Text that the voice has said so far; empty for a behavior that is no speech."""
        behavior = self.request.behavior
        return behavior.text[: self.position] if isinstance(behavior, Speech) else ""

    def stop(self, why: Fault, *, lapses: bool = False) -> None:
        """Note why it is to end early; what came first counts."""
        if self.why is None:
            self.why, self.lapses = why, lapses
