"""Who owns the robot's head and why; leases that inhibit gaze or pointing. Design: generation, maintenance policy."""

from typing import Literal

from msgspec import Struct

from schemas.requests import Outcome, Request
from schemas.units import Seconds, Stamp

ClaimKind = Literal["inhibition", "fragment", "glance", "response", "hands", "face", "none"]


class Claim(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """priority: 1 (inhibition) .. 6 (face); 0 with kind `none`. target: entity id, empty to hold the direction."""

    kind: ClaimKind
    priority: int
    target: str = ""
    reason: str = ""


class HeadOwner(Struct, frozen=True, kw_only=True, tag="head_owner", omit_defaults=True):
    """state: generation. Published at every change of owner."""

    owner: Claim
    since: Stamp
    waiting: tuple[Claim, ...] = ()


class Inhibit(Request, frozen=True, kw_only=True, tag="inhibit", omit_defaults=True):
    """cmd: anyone -> generation. A lease, renewed by sending it again; ends after `ttl` or with its owner's life.

    Ends in `InhibitionEnded`. mode release: the arbiter gives the part up; hold: it stays as it is;
    target: the robot keeps looking at `target`.
    """

    part: Literal["gaze", "point-left", "point-right"] = "gaze"
    mode: Literal["release", "hold", "target"] = "hold"
    ttl: Seconds = 5.0
    target: str = ""


class InhibitionEnded(Outcome, frozen=True, kw_only=True, tag="inhibition_ended", omit_defaults=True):
    reason: Literal["lapsed", "released", "owner_lost"] = "lapsed"
