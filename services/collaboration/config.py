"""Configuration of the collaboration manager: how it plays the tangram."""

from collections.abc import Mapping
from typing import Any, ClassVar, Literal

from msgspec import Struct

from engage_hri.schemas.ranges import not_negative
from engage_hri.schemas.units import Seconds


class CollaborationConfig(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The section `collaboration`. mode: `scripted` plays Appendix B; `task` chooses pieces and words itself."""

    mode: Literal["scripted", "task"] = "scripted"
    placement: Seconds = 15.0
    """Time that the person has to place a piece before the robot asks again."""

    FIXED: ClassVar[Mapping[str, Any]] = {
        "attempts": 3, "steady": 0.5, "patience": 2.0, "settle": 0.75, "pause": 0.4, "thinking": 1.0, "arrival": 4.0,
        "farewell": 15.0, "piece_reliability": 0.95, "landmark_reliability": 0.85,
    }  # fmt: skip
    """Former keys, and the value of the constant that has taken the place of each."""

    def __post_init__(self) -> None:
        not_negative(self, ("placement",), "collaboration.")
