"""Actions of people and of the robot, as all reporters together tell them: the same for every reader. Pure.

    reports = ActionReports("robot", REPORT_GRACE, clock, instant)
    told = reports.take(message, key, source, life, now)    # any message
    told = reports.advance(now)                             # whenever `deadline` has been reached

A reader of nothing but `ActionBegan` and its like keeps a person for ever whose reporter was killed, for nobody is
left to tell that this person has gone. `Reporters` tells it.
"""

from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator

from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.actions import ActionBegan, ActionEnded, ActorFound, ActorLost, OngoingActions
from engage_hri.schemas.presence import PeerAlive, PeerGone
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.reports.ongoing_actions import MOST, ActionEvent
from engage_hri.services.reports.reporters import Reporters
from engage_hri.services.reports.reports import GoesOn, TimedReport

FACE_GRACE: Seconds = 2.0
"""Time for which a person may be out of sight, and come back under the same id, before the person has gone. Trackers
lose faces for 0.5 to 2 s all day."""
REPORT_GRACE: Seconds = 4.0
"""Time for which what a reporter said holds after it has vanished, where no configuration says otherwise."""
STRANGERS_KEPT = 256
"""Number of programs of others whose name as a reporter is remembered."""
Read = ActionEvent | OngoingActions | PeerAlive | PeerGone
"""Messages of which it takes notice."""


class ActionReports:
    """The reports of actions. robot, grace, clock, instant: as of `Reporters`."""

    def __init__(self, robot: str, grace: Seconds, clock: str, instant: Callable[[Stamp], Seconds]) -> None:
        self._robot = robot
        self._reporters = Reporters(robot, grace, clock, instant)
        self._strangers: OrderedDict[str, str] = OrderedDict()
        """Names of reporters whose messages name no participant, by their life."""

    @property
    def deadline(self) -> Seconds | None:
        """Time at which `advance` has something to tell."""
        return self._reporters.deadline

    def advance(self, now: Seconds) -> list[TimedReport]:
        """Let time pass."""
        return self._reporters.advance(now)

    def take(
        self, message: object, key: str, source: str, life: str, now: Seconds, *, past: bool = False
    ) -> list[TimedReport]:
        """Take a message as it was received. Returns what follows, in order; nothing for what tells of no action."""
        told = self.advance(now)
        if isinstance(message, PeerAlive | PeerGone):
            return told + self._reporters.feed(message, now)
        if isinstance(message, ActionEvent | OngoingActions) and is_proper(message, key, source, self._robot):
            name, of = self._reporter(key, source, life)
            return told + self._reporters.hear(message, name, of, now, past=past)
        return told

    def forget(self, actor: str) -> None:
        """Drop a person who has been gone for long."""
        self._reporters.forget(actor)

    def _reporter(self, key: str, source: str, life: str) -> tuple[str, str]:
        """Name and life of who tells of actions. The robot's are told by its body, whoever speaks for it."""
        is_event = key in (keys.PERCEIVED_ACTION, keys.RECOGNIZED_ACTION)
        name = source if is_event else keys.reporter_of(key) or "control"
        if source:
            return name, life if name == source else ""
        if is_event:
            return self._strangers.get(life, ""), ""
        if life and name != "control":
            self._strangers[life] = name
            self._strangers.move_to_end(life)
            if len(self._strangers) > STRANGERS_KEPT:
                self._strangers.popitem(last=False)
        return name, ""


def events(told: Iterable[TimedReport], clock: str) -> Iterator[tuple[ActionEvent, Seconds]]:
    """Events for readers that know nothing of reporters, each with its local time. clock: that of local time.

    An action that goes on is told as begun. Of a speech that goes on nothing is told: nobody heard its beginning.
    """
    for observation, at, is_sure in told:
        if isinstance(observation, GoesOn):
            if observation.began.action != "speak":
                yield observation.began, observation.since
        else:
            yield observation if is_sure else replace(observation, at=Stamp(clock, at)), at


def is_proper(message: ActionEvent | OngoingActions, key: str, source: str, robot: str) -> bool:
    """True for what came from its proper sender: the robot's body for the robot, perception for people."""
    match message:
        case ActionBegan(actor=actor) | ActionEnded(actor=actor):
            return (actor == robot) == (key == keys.ROBOT_ACTION)
        case ActorFound(actor=actor) | ActorLost(actor=actor):
            return actor != robot
    if len(message.actions) > MOST or any(action.actor != message.actor for action in message.actions):
        return False
    reporter = keys.reporter_of(key)
    if not reporter:
        return message.actor == robot
    is_own = source in ("", reporter)
    return is_own and message.actor != robot and key == keys.perceived_ongoing(reporter, message.actor)
