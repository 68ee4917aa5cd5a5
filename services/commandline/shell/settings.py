"""Configuration of the services of a robot."""

from msgspec import Struct

from engage_hri.schemas.units import Seconds, not_negative
from engage_hri.schemas.world import COVERED_FOR
from engage_hri.services.bus.config import BusConfig
from engage_hri.services.control.config import ControlConfig
from engage_hri.services.door.config import DoorConfig
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.perception.eyes.config import EyesConfig
from engage_hri.services.perception.hearing.config import PAGE, HearingConfig
from engage_hri.services.perception.pieces.config import PiecesConfig
from engage_hri.services.realizer.config import RealizerConfig
from engage_hri.services.recognition.config import RecognitionConfig

ELSEWHERE = ("simulation", "collaboration")
"""Sections of the same file that a robot ignores: it loads nothing of the simulation and the task."""
TRANSCRIPT = ("recognition.gaze_resolution=table",)
"""Settings for the transcript of the tangram: its annotators saw that a look went to the table, but rarely to which
piece."""
FROM_PAGES = (f"hearing.source={PAGE}",)
"""Settings of ears for whoever sits at a page, and may switch a microphone on there."""
AT_PAGES = (*FROM_PAGES, f"eyes.source={PAGE}", "control.drivers.espeak.device=none")
"""Settings of a robot that is met at pages: they have cameras, and its voice as well. Two loudspeakers at one table
are an echo, and a machine without a sound card has none."""


class RobotConfig(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Sections (TOML tables) of the services, and values that several of them share.

    covered_for: time for which an object that is missing in reports of the world is taken to be covered, so that the
    robot still speaks of it and looks at it.
    """

    covered_for: Seconds = COVERED_FOR
    bus: BusConfig = BusConfig()
    generation: GenerationConfig = GenerationConfig()
    realizer: RealizerConfig = RealizerConfig()
    recognition: RecognitionConfig = RecognitionConfig()
    control: ControlConfig = ControlConfig()
    hearing: HearingConfig = HearingConfig()
    eyes: EyesConfig = EyesConfig()
    pieces: PiecesConfig = PiecesConfig()
    door: DoorConfig = DoorConfig()

    def __post_init__(self) -> None:
        not_negative(self, ("covered_for",))

    @property
    def robot(self) -> str:
        """The namespace on the bus, and the robot's actor id."""
        return self.bus.robot
