"""Who owns the robot's head and why; leases that inhibit gaze or pointing. Design: generation, maintenance policy."""

from typing import ClassVar, Literal

from msgspec import Struct

from engage_hri.schemas.requests import Outcome, Request
from engage_hri.schemas.units import Seconds, Stamp

ClaimKind = Literal["inhibition", "fragment", "glance", "response", "hands", "face", "none"]


class Claim(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """priority: 1 (inhibition) .. 6 (face); 0 with kind `none`. target: entity id, empty to hold the direction."""

    kind: ClaimKind
    priority: int
    target: str = ""
    reason: str = ""


class HeadOwner(Struct, frozen=True, kw_only=True, tag="head_owner", omit_defaults=True):
    """state: generation. Who has the head, since when and why, and which claims wait, the highest first.

    Published at every change of owner, of its target or reason, or of what waits; who joins late gets the last.
    """

    owner: Claim
    since: Stamp
    waiting: tuple[Claim, ...] = ()


class Inhibit(Request, frozen=True, kw_only=True, tag="inhibit", omit_defaults=True):
    """cmd: anyone -> generation. Ends after `ttl` without `KeepAlive` or being sent again, or with its owner's life.

    Ends in `InhibitionEnded`. A gaze or point of a fragment that runs is aborted, others are left out. mode, of gaze:
    release: the head is free and goes back to the base gaze; hold: it stays on what it is on; target: it keeps to
    `target`. Of an arm every mode is the same: it does not point. The newest lease on a part counts.
    """

    is_updatable: ClassVar[bool] = True

    part: Literal["gaze", "point-left", "point-right"] = "gaze"
    mode: Literal["release", "hold", "target"] = "hold"
    ttl: Seconds = 5.0
    target: str = ""

    @property
    def term(self) -> Seconds:
        return self.ttl


class InhibitionEnded(Outcome, frozen=True, kw_only=True, tag="inhibition_ended", omit_defaults=True):
    reason: Literal["lapsed", "released", "owner_lost"] = "lapsed"
