"""Scenes of a recording: what was where, who looked at what, and what was said, at given times. Pure."""

from collections.abc import Iterator, Sequence

from msgspec import Struct

from engage_hri.schemas.actions import ActionBegan, ActionEnded, ActorLost
from engage_hri.schemas.body import RobotState
from engage_hri.schemas.recognition import ENDINGS, ConnectionEvent
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import World
from engage_hri.services.recording.reading import Recording
from engage_hri.services.recording.times import messages


class SceneSnapshot(Struct, frozen=True, kw_only=True):
    """A scene at a time. doing: targets of what each actor does, by actor and action. events: those that are open."""

    at: Seconds
    robot: str
    world: World | None = None
    body: RobotState | None = None
    doing: dict[tuple[str, str], tuple[str, ...]] = {}
    events: tuple[ConnectionEvent, ...] = ()

    @property
    def caption(self) -> str:
        """Words that the robot says."""
        return self.body.speaking if self.body is not None else ""


def scenes(recording: Recording, times: Sequence[Seconds]) -> Iterator[SceneSnapshot]:
    """Make the scenes at these times, which must be in order."""
    told = sorted(messages(recording), key=lambda one: one[1])
    world: World | None = None
    body: RobotState | None = None
    doing: dict[tuple[str, str], tuple[str, ...]] = {}
    events: dict[str, ConnectionEvent] = {}
    number = 0
    for at in times:
        while number < len(told) and told[number][1] <= at:
            match told[number][0].message:
                case World() as world:
                    pass
                case RobotState() as body:
                    pass
                case ActionBegan(actor=actor, action=action, targets=targets):
                    doing[actor, action] = targets
                case ActionEnded(actor=actor, action=action, targets=targets):
                    if doing.get((actor, action)) == targets:
                        del doing[actor, action]
                case ActorLost(actor=actor):
                    doing = {name: targets for name, targets in doing.items() if name[0] != actor}
                case ConnectionEvent(id=id, state=state) as event:
                    events[id] = event
                    if state in ENDINGS:
                        del events[id]
            number += 1
        yield SceneSnapshot(
            at=at, robot=recording.robot, world=world, body=body, doing=dict(doing), events=tuple(events.values())
        )  # fmt: skip


def spread(end: Seconds, count: int) -> list[Seconds]:
    """Spread so many times over a recording: even, the first and the last half a step from its ends."""
    return [end * (2 * number + 1) / (2 * count) for number in range(count)]
