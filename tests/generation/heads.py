"""The arbiter of the head on a stage where time passes from deadline to deadline."""

from collections.abc import Callable

from engage_hri.schemas.body import BodyPose, Ray, RobotState
from engage_hri.schemas.perception import ActionBegan, ActionEnded
from engage_hri.schemas.recognition import ConnectionEvent, Statistics, WindowStatistics
from engage_hri.schemas.units import Seconds, Stamp, Vector
from engage_hri.schemas.world import Entity, World
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.head.arbiter import Arbiter, Ruling
from engage_hri.services.generation.inhibitions import Inhibition

AT = Stamp("test", 0.0)


def inhibition(mode: str = "hold", target: str = "") -> Inhibition:
    return Inhibition(target, f"manager: {mode}", mode)  # type: ignore[arg-type]


INHIBITED = inhibition()


def world(speed: float = 0.0, person: bool = True) -> World:
    hand = Entity(id="hand", kind="hand", owner="human", position=(0.8, 0.0, 0.7), velocity=(speed, 0.0, 0.0))
    human = Entity(id="human", kind="person", position=(1.3, 0.0, 1.2))
    piece = Entity(id="piece", kind="object", position=(0.6, 0.2, 0.7))
    other = Entity(id="other", kind="object", position=(0.6, -0.3, 0.7))
    between = Entity(id="between", kind="object", position=(0.6, -0.1, 0.7))
    return World(entities=(*((human,) if person else ()), hand, piece, other, between))


def event(id: str, state: str, **fields: object) -> ConnectionEvent:
    values = {"kind": "directed_gaze", "initiator": "human", "responder": "robot", "objects": ("piece",), **fields}
    return ConnectionEvent(id=id, state=state, at=AT, started=AT, **values)  # type: ignore[arg-type]


def statistics(mtbce: float | None, events: int = 10) -> Statistics:
    return Statistics(
        actor="human",
        at=AT,
        session=WindowStatistics(events=events),
        recent=WindowStatistics(mtbce_without_maintenance=mtbce),
    )


def act(ends: bool = False) -> ActionBegan | ActionEnded:
    return (ActionEnded if ends else ActionBegan)(actor="human", action="act", targets=("piece",), at=AT)


class Stage:
    """Time passes only through `until`; between, every deadline of the arbiter is met exactly."""

    def __init__(self, **config: object) -> None:
        self.arbiter = Arbiter("robot", GenerationConfig(**config))  # type: ignore[arg-type]
        self.now: Seconds = 0.0
        self.owners: list[tuple[Seconds, str, str]] = []
        self.shifts: list[tuple[Seconds, str, str]] = []
        self.timed: list[tuple[Seconds, Ruling]] = []

    def rule(self) -> None:
        ruling = self.arbiter.rule(self.now)
        self.timed.append((self.now, ruling))
        owner = (ruling.owner.kind, ruling.owner.target)
        if not self.owners or self.owners[-1][1:] != owner:
            self.owners.append((round(self.now, 6), *owner))
        if ruling.shift:
            self.shifts.append((round(self.now, 6), ruling.shift.id.partition("-")[0], ruling.shift.target))

    def feed(self, *observations: object) -> None:
        for observation in observations:
            self.arbiter.feed(observation, self.now)  # type: ignore[arg-type]
        self.rule()

    def do(self, change: Callable[[Arbiter], None]) -> None:
        change(self.arbiter)
        self.rule()

    def until(self, end: Seconds) -> None:
        while (due := self.arbiter.deadline) is not None and due <= end:
            assert due >= self.now, "a deadline in the past would spin"
            self.now = due
            before = self.arbiter.deadline
            self.rule()
            assert self.arbiter.deadline != before, "a deadline that stays would spin"
        self.now = end

    @property
    def rulings(self) -> list[Ruling]:
        return [ruling for _, ruling in self.timed]

    @property
    def owner(self) -> str:
        return self.rulings[-1].owner.kind

    @property
    def waiting(self) -> list[str]:
        return [claim.kind for claim in self.rulings[-1].waiting]


def on_the_face(**config: object) -> Stage:
    """A robot that has looked at a face for long, and does so until something happens: it does not look away."""
    stage = Stage(**{"policies_off": ("aversion",), **config})
    stage.feed(world())
    stage.until(10.0)
    stage.owners.clear()
    stage.rule()
    stage.owners.clear()
    stage.shifts.clear()
    return stage


def looking_at(place: Vector, target: str = "") -> RobotState:
    eyes = (0.0, 0.0, 1.2)
    reach = tuple(there - here for here, there in zip(eyes, place, strict=True))
    length = sum(part * part for part in reach) ** 0.5
    gaze = Ray(origin=eyes, axis=tuple(part / length for part in reach))  # type: ignore[arg-type]
    return RobotState(at=AT, pose=BodyPose(), gaze=gaze, left_arm=gaze, right_arm=gaze, looking_at=target)
