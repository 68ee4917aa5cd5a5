"""A table with pieces, faces and hands, and what cameras and microphones say of them; for the tests of attention."""

import math
from typing import Any

from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, ActorLost, HeadPose, VoiceActivity
from engage_hri.schemas.units import Vector
from engage_hri.schemas.world import Entity, World
from engage_hri.services.recognition.config import RecognitionConfig, Sensing
from engage_hri.services.recognition.events.interrupted_looks import Symbolic
from engage_hri.services.recognition.perceive.attention import Attention
from engage_hri.services.recognition.perceive.gaze_targets import ROBOT_FACE
from tests.recognition.observations import HUMAN, ROBOT, stamp

EYES: Vector = (1.3, 0.0, 1.2)
ROBOT_EYES = ROBOT_FACE
SQUARE = ((0.035, 0.035), (-0.035, 0.035), (-0.035, -0.035), (0.035, -0.035))
TABLE = Entity(
    id="table",
    kind="surface",
    position=(0.6, 0.0, 0.7),
    footprint=((0.4, 0.5), (-0.4, 0.5), (-0.4, -0.5), (0.4, -0.5)),
)
PLACES: dict[str, Vector] = {"blue": (0.6, -0.2, 0.7), "red": (0.6, 0.2, 0.7), "green": (0.6, 0.27, 0.7)}
"""green lies beside red."""
EMPTY: Vector = (0.6, 0.0, 0.7)
"""A place on the table with no piece near it."""
UP: Vector = (1.3, 0.5, 3.0)
"""Nothing is there."""


def piece(id: str, position: Vector | None = None, **about: Any) -> Entity:
    return Entity(id=id, kind="object", position=position or PLACES[id], footprint=SQUARE, **about)


def hand(position: Vector, owner: str = HUMAN, side: str = "right") -> Entity:
    return Entity(id=f"{owner}-{side}-hand", kind="hand", owner=owner, position=position)


def face(actor: str = HUMAN, position: Vector = EYES) -> Entity:
    return Entity(id=actor, kind="person", position=position)


def table(*others: Entity, without: str = "", **moved: Vector) -> World:
    """Three pieces on a table. moved: where a piece is instead; without: a piece that is not seen."""
    pieces = (piece(id, moved.get(id)) for id in PLACES if id != without)
    return World(entities=(TABLE, *pieces, *others))


def place_of(target: str) -> Vector:
    known = {**PLACES, ROBOT: ROBOT_EYES, "table": EMPTY, "": UP}
    return known[target]


def pose(
    target: str | Vector, at: float, *, actor: str = HUMAN, eyes: Vector = EYES, confidence: float = 1.0
) -> HeadPose:
    x, y, z = place_of(target) if isinstance(target, str) else target
    direction = (x - eyes[0], y - eyes[1], z - eyes[2])
    return HeadPose(actor=actor, position=eyes, direction=direction, at=stamp(at), confidence=confidence)


def voice(active: bool, at: float, *, actor: str = HUMAN, confidence: float = 1.0) -> VoiceActivity:
    return VoiceActivity(actor=actor, active=active, at=stamp(at), confidence=confidence)


def turned(position: Vector, degrees: float) -> Vector:
    """A place as far from the eyes, `degrees` to the side."""
    cos, sin = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    x, y = position[0] - EYES[0], position[1] - EYES[1]
    return (EYES[0] + cos * x - sin * y, EYES[1] + sin * x + cos * y, position[2])


Told = tuple[str, str, float]


class Watch:
    """Attention over the table; every call is one observation, what it means is kept in `told`."""

    def __init__(self, resolution: str = "object", **sensing: Any) -> None:
        config = RecognitionConfig(gaze_resolution=resolution, sensing=Sensing(**sensing))  # type: ignore[arg-type]
        self.attention = Attention(ROBOT, config)
        self.actions: list[Symbolic] = []
        self.sees(0.0)

    def _keep(self, actions: list[Symbolic]) -> None:
        self.actions += actions

    def feed(self, observation: Any, at: float | None = None) -> None:
        self._keep(self.attention.feed(observation, observation.at.seconds if at is None else at))

    def sees(self, at: float, *others: Entity, **about: Any) -> None:
        self.feed(table(*others, **about), at)

    def looks(self, target: str | Vector, *times: float, **about: Any) -> None:
        for at in times:
            self.feed(pose(target, at, **about))

    def hears(self, active: bool, *times: float, **about: Any) -> None:
        for at in times:
            self.feed(voice(active, at, **about))

    def until(self, now: float) -> None:
        self._keep(self.attention.advance(now))

    @property
    def told(self) -> list[Told]:
        return [_told(action) for action in self.actions]

    def of(self, action: str) -> list[Told]:
        return [told for told in self.told if told[0].startswith(action)]


def _told(action: Symbolic) -> Told:
    at = round(action.at.seconds, 6)
    match action:
        case ActionBegan(targets=targets, action=kind):
            return (f"{kind}", ",".join(targets), at)
        case ActionEnded(targets=targets, action=kind):
            return (f"{kind} ends", ",".join(targets), at)
        case ActorFound(actor=actor):
            return ("found", actor, at)
        case ActorLost(actor=actor):
            return ("lost", actor, at)


def frames(start: float, end: float, rate: float = 30.0) -> list[float]:
    """Times from `start` to before `end`."""
    return [start + index / rate for index in range(math.ceil((end - start) * rate - 1e-9))]
