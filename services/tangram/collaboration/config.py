"""Configuration of the collaboration manager: how it plays the tangram."""

from typing import Literal

from msgspec import Struct

from engage_hri.schemas.units import Seconds, not_negative


class CollaborationConfig(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The section `collaboration`.

    mode: `scripted` plays Appendix B; `task` chooses pieces and words itself; `host` has no pieces laid: it asks
    people who talk among themselves something, now and then.
    """

    mode: Literal["scripted", "task", "host"] = "scripted"
    placement: Seconds = 15.0
    """Time that the person has to place a piece before the robot asks again. It stops while they hold one."""

    def __post_init__(self) -> None:
        not_negative(self, ("placement",), "collaboration.")
