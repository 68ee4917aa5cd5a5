"""Claims on the robot's head, the one that owns it, and leases that inhibit gaze or pointing."""

from typing import ClassVar, Literal

from msgspec import Struct

from engage_hri.schemas.requests import Outcome, Request
from engage_hri.schemas.units import Seconds, Stamp

ClaimKind = Literal["inhibition", "fragment", "glance", "response", "hands", "face", "none"]


class Claim(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A wish for the robot's gaze, by which the arbiter decides about the head.

    priority: 1 (inhibition, the strongest) to 6 (face); 0 with kind `none`.
    target: entity id; empty: hold the direction.
    reason: why, in words, for people.
    """

    kind: ClaimKind
    priority: int
    target: str = ""
    reason: str = ""


class HeadOwner(Struct, frozen=True, kw_only=True, tag="head_owner", omit_defaults=True):
    """state: generation. The claim that owns the head, and the claims that wait.

    Published at every change of the owner, of its target or reason, or of the waiting claims; a late subscriber gets
    the last one.

    since: when this owner got the head.
    waiting: the strongest first.
    """

    owner: Claim
    since: Stamp
    waiting: tuple[Claim, ...] = ()


class Inhibit(Request, frozen=True, kw_only=True, tag="inhibit", omit_defaults=True):
    """cmd: anyone -> generation: a lease that inhibits gaze or pointing. Ends in `InhibitionEnded`.

    A gaze or a pointing of the running fragment is aborted, those of later fragments are left out. The newest lease
    on a part counts. It ends when `ttl` has passed without a `KeepAlive` or being sent again, and with its owner's
    life.

    part: what is inhibited: the gaze, or pointing with one arm.
    mode: of the gaze: `release` lets the head go back to the base gaze, `hold` keeps the direction, `target` looks at
    `target`. Without meaning for an arm.
    ttl: how long the lease lasts without renewal.
    target: entity id, with mode `target`.
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
    """evt: generation -> requester: the lease has ended.

    reason: `lapsed`: not renewed; `released`: cancelled; `owner_lost`: its owner has gone from the bus.
    """

    reason: Literal["lapsed", "released", "owner_lost"] = "lapsed"
