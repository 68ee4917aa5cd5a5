"""Settings of the driver of Reachy Mini: the section `control.drivers.reachy_mini`."""

from typing import Annotated
from urllib.parse import urlsplit

from msgspec import Meta, Struct

from engage_hri.schemas.units import Degrees, Seconds, Vector


class ReachyMiniSettings(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings of a Reachy Mini: where it is, and how it moves.

    url: address of its daemon. position: of the middle of its foot, metres in the robot's frame; by default a table.
    facing: of its foot, counted to its left from straight ahead.
    pace: share of the speed that its motors are trusted with, 0.1 to 1; accelerations go with its square.
    on_target: angle between the measured gaze axis and its target below which a look has arrived.
    correction: greatest angle by which the head is told to be elsewhere, so that it is measured where it is to be.
    lag: time by which the measured angles follow the commands; estimates count with it.
    patience: joints that make no way for so long, and are not where they should be, have failed.
    silence: a daemon that sends no measurement for so long is lost.
    enable_motors: switch the motors on at each connection. Off: wait until somebody does.
    """

    url: str = "http://127.0.0.1:8000"
    position: Vector = (0.0, 0.0, 0.73)
    facing: Annotated[Degrees, Meta(ge=-180, le=180)] = 0.0
    pace: Annotated[float, Meta(ge=0.1, le=1)] = 1.0
    on_target: Annotated[Degrees, Meta(ge=0.1, le=5)] = 0.8
    correction: Annotated[Degrees, Meta(ge=0, le=10)] = 4.0
    lag: Annotated[Seconds, Meta(ge=0, le=1)] = 0.08
    patience: Annotated[Seconds, Meta(ge=0.2, le=60)] = 1.5
    silence: Annotated[Seconds, Meta(ge=0.2, le=60)] = 1.0
    enable_motors: bool = True

    def __post_init__(self) -> None:
        parts = urlsplit(self.url)
        if parts.scheme not in ("http", "https") or not parts.hostname:
            raise ValueError(f"url is {self.url!r}: expected such as http://reachy-mini.local:8000")
