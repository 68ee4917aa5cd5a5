"""Configuration of control: how it reports, zones that are never pointed into, and faults of the simulated body."""

from collections.abc import Mapping
from typing import Any, Literal

from msgspec import Struct

from engage_hri.schemas.body import NoPointZone
from engage_hri.schemas.units import Degrees, Probability, Seconds


class Displaced(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A joint that is elsewhere than the body believes, until it first moves (Fig. 4.7: an arm near already).

    joint: its name in the body's `Capabilities`. angle: where it really is.
    """

    joint: str
    angle: Degrees


class Miscalibrated(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A joint that is beside the angle that it measures, which people see and the body does not know. Thesis 5.4.3.

    part: a joint, or a body part, whose joints are all so. angle: by which the true angle is greater.
    """

    part: str
    angle: Degrees


class Stall(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A part stops half-way to a sync point.

    part: head, left_arm, right_arm, torso or face. before: the sync point it is late for.
    seconds: how long it stands still; None: for ever. behavior: id of the only behavior meant; empty: each.
    """

    part: str
    before: str
    seconds: Seconds | None = None
    behavior: str = ""


class Slow(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A part that moves slower than it should. Thesis 4.2.2.

    part: head, left_arm, right_arm, torso or face. factor: everything takes this many times as long; less than 1:
        faster, within the limits.
    """

    part: str
    factor: float


class Variability(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Deviations of the simulated body from its own estimates, drawn from `seed`; none by default.

    seed: same seed, same deviations, whatever the order in which behaviors come.
    noise: standard deviation of the logarithm of each behavior's duration; 0.1 is about 10 %.
    slow, stall, displaced, miscalibrated: see their types.
    overheated: parts whose motor fails half-way through every motion (thesis 4.5.3).
    mute: `silent`: the voice makes no sound and reports its words all the same (thesis 5.4.3);
        `refuse`: the voice refuses to speak.
    lost: share of the sync point messages that never reach the bus.
    """

    seed: int = 0
    noise: float = 0.0
    slow: tuple[Slow, ...] = ()
    stall: tuple[Stall, ...] = ()
    displaced: tuple[Displaced, ...] = ()
    miscalibrated: tuple[Miscalibrated, ...] = ()
    overheated: tuple[str, ...] = ()
    mute: Literal["", "silent", "refuse"] = ""
    lost: Probability = 0.0

    def __post_init__(self) -> None:
        if self.noise < 0.0:
            raise ValueError(f"noise is {self.noise}: expected >= 0")
        for slow in self.slow:
            if slow.factor <= 0.0:
                raise ValueError(f"slow.factor of {slow.part!r} is {slow.factor}: expected > 0")
        if not 0.0 <= self.lost <= 1.0:
            raise ValueError(f"lost is {self.lost}: expected 0..1")


class ControlConfig(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The section `control`.

    body: the driver of the robot's body, one name or a list; see docs/control.md. `head,face=NAME` takes only these
        parts of a driver.
    voice: the driver of its voice; empty: the one that the body has.
    drivers: the settings of drivers, a table for each, by the name of its class or entry point.
    state_rate: looks at the body per second while anything moves, and `RobotState` messages for who asks for all.
    no_point_zones: spheres that no body ever points into.
    variability: deviations of the simulated body.
    calibration: file with the offsets of joints, and how well looks and points are known, as `engage calibrate body`
        makes it. Empty: the body is as it measures.
    alive: true if a body of ours blinks, breathes and stirs while it does nothing, as far as it can; seen on the
        stream of its state only.
    repertoire: files with lexemes of the simulated body, one name or a list; see docs/control.md.
    """

    state_rate: float = 20.0
    no_point_zones: tuple[NoPointZone, ...] = ()
    variability: Variability = Variability()
    calibration: str = ""
    alive: bool = True
    repertoire: str | tuple[str, ...] = ()
    body: str | tuple[str, ...] = "simulated"
    voice: str = ""
    drivers: Mapping[str, Mapping[str, Any]] = {}

    @property
    def bodies(self) -> tuple[str, ...]:
        """The drivers in `body`, each as it is named there."""
        return (self.body,) if isinstance(self.body, str) else self.body

    @property
    def has_voice(self) -> bool:
        """True if a voice is chosen that makes a sound."""
        return self.voice not in ("", "silent")

    @property
    def repertoire_files(self) -> tuple[str, ...]:
        """Names of the files in `repertoire`, each stronger than those before it."""
        return (self.repertoire,) if isinstance(self.repertoire, str) else self.repertoire

    @property
    def files(self) -> tuple[str, ...]:
        """Names of all files that hold settings."""
        return (*([self.calibration] if self.calibration else []), *self.repertoire_files)

    def __post_init__(self) -> None:
        if not 1.0 <= self.state_rate <= 200.0:
            raise ValueError(f"state_rate is {self.state_rate}: expected 1..200 per second")
