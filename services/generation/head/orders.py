"""Orders of others: an inhibition in force, and the gaze of a fragment. Their claims come first. Pure."""

from collections.abc import Sequence

from engage_hri.schemas.fragments import Claim
from engage_hri.schemas.units import Seconds
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.head.policy import HeadPolicy
from engage_hri.services.generation.head.scene import HeadScene
from engage_hri.services.generation.inhibitions import Inhibition
from engage_hri.services.reports.same_people import joined


class InhibitionPolicy(HeadPolicy):
    """Claim of the inhibition in force: that of the newest lease on gaze."""

    kind = "inhibition"

    def __init__(self, scene: HeadScene, config: GenerationConfig) -> None:
        super().__init__(scene, config)
        self.inhibition: Inhibition | None = None

    @property
    def mode(self) -> str:
        """Mode of the lease; "": there is none."""
        return self.inhibition.mode if self.inhibition is not None else ""

    def claim(self, now: Seconds, weaker: Sequence[Claim]) -> Claim | None:
        return self.wish(self.inhibition.target, self.inhibition.reason) if self.inhibition is not None else None


class FragmentPolicy(HeadPolicy):
    """Claim of what the robot says: of a fragment's gaze, else of the look away while it thinks."""

    kind = "fragment"

    def __init__(self, scene: HeadScene, config: GenerationConfig) -> None:
        super().__init__(scene, config)
        self.gaze: Claim | None = None
        self._thought: Claim | None = None

    def gazes(self, target: str, reason: str) -> None:
        """Note the gaze of a fragment that has started."""
        self.gaze = self.wish(target, reason)

    def lets_go(self) -> None:
        """Note that the blocks of all fragments that moved the head have ended."""
        self.gaze = None

    def think(self, target: str) -> None:
        """Claim the head for a look away until the turn's next fragment. target: "": no longer."""
        self._thought = self.wish(target, "thinks") if target else None

    def claim(self, now: Seconds, weaker: Sequence[Claim]) -> Claim | None:
        return self.gaze or self._thought

    def join(self, other: str, name: str) -> None:
        self.gaze, self._thought = (each and joined(each, other, name) for each in (self.gaze, self._thought))
