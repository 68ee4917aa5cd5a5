"""All of recognition as one pure machine: symbolic and raw observations in; effects and derived actions out.

Raw perception makes up its mind late about what has happened, so observations wait in the order of their times until
nothing that came before them can still become known. With symbolic perception alone nothing ever waits.
"""

import heapq
import math
from itertools import count

from schemas.actions import ActionBegan, ActionEnded, ActorFound, ActorLost
from schemas.body import RobotState
from schemas.perception import HeadPose, VoiceActivity
from schemas.units import Seconds
from schemas.world import World
from services.recognition.attention import Attention, Symbolic
from services.recognition.config import RecognitionConfig
from services.recognition.machine import Effect
from services.recognition.scene import Covered
from services.recognition.session import Observation, Session

Perceived = Observation | HeadPose | VoiceActivity | RobotState
Result = Effect | Symbolic
"""Actions among them are what raw perception means; they have been taken already."""


class Recognizer:
    """robot, clock, name: as of `Session` and `Attention`."""

    def __init__(self, robot: str, config: RecognitionConfig, *, clock: str = "loop", name: str = "") -> None:
        self.session = Session(robot, config, clock=clock, name=name)
        self._robot = robot
        self._config = config
        self._attention = Attention(robot, config, clock)
        self._waiting: list[tuple[Seconds, int, Observation | Covered]] = []
        self._numbers = count()
        self._covered = Covered(frozenset())
        self._now: Seconds = -math.inf

    @property
    def deadline(self) -> Seconds | None:
        """When `advance` has something to do, unless an observation comes first."""
        settled, due = self._settled, self.session.deadline
        more = settled + self._config.sensing.settling  # is settled then, at the latest
        times = [self._attention.deadline]
        if self._waiting:
            times.append(more)
        if due is not None:
            times.append(due if due < settled else max(due, more))
        return min((at for at in times if at is not None), default=None)

    def feed(self, observation: Perceived, at: Seconds, now: Seconds) -> list[Result]:
        """Take what happened at `at`, before or at `now`."""
        self._now = now
        derived: list[Symbolic] = []
        match observation:
            case HeadPose() | VoiceActivity():
                if now - at <= self._config.sensing.oldest:
                    derived = self._attention.feed(observation, at)
            case RobotState():
                derived = self._attention.feed(observation, at)
            case World():
                derived = self._attention.feed(observation, at)
                self._wait(observation, at)
                if (covered := self._attention.covered) != self._covered:
                    self._covered = covered
                    self._wait(covered, at)
            case ActionBegan(confidence=confidence) if confidence < self._config.least_confidence:
                pass
            case ActionBegan() | ActionEnded() | ActorFound() | ActorLost():
                if observation.actor != self._robot:
                    self._attention.believe(observation, at)
                self._wait(observation, at)
            case _:
                self._wait(observation, at)
        return self._take(derived)

    def advance(self, now: Seconds) -> list[Result]:
        """What happens by itself up to and including `now`."""
        self._now = now
        results = self._take(self._attention.advance(now))
        settled = self._settled
        # What is due at the very moment from which on things are undecided has to wait, too.
        return [*results, *self.session.advance(now if settled > now else math.nextafter(settled, -math.inf))]

    def _take(self, derived: list[Symbolic]) -> list[Result]:
        for action in derived:
            self._wait(action, action.at.seconds)
        settled = self._settled
        results: list[Result] = [*derived]
        while self._waiting and self._waiting[0][0] <= settled:
            at, _, observation = heapq.heappop(self._waiting)
            results += self.session.feed(observation, at)
        return results

    def _wait(self, observation: Observation | Covered, at: Seconds) -> None:
        heapq.heappush(self._waiting, (at, next(self._numbers), observation))

    @property
    def _settled(self) -> Seconds:
        """Nothing from before this can still become known, but for what has taken longer than the time to settle."""
        longest = self._config.sensing.settling
        return min((since for since in self._attention.undecided if self._now < since + longest), default=math.inf)
