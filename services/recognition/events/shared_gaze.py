"""The base of both gaze events: one begins, the other joins, and the shared phase lasts while both look there.

Thesis 2.2.1-2. The names of states and inputs are data of the subclasses; their tables have the transitions.
"""

from typing import ClassVar

from engage_hri.schemas.units import Probability, Seconds
from engage_hri.services.recognition.events.limits import LimitClock
from engage_hri.services.recognition.events.machine import IDLE, EventWriter, Machine, OngoingEvent
from engage_hri.services.recognition.events.scene import GazeState


class SharedGaze(Machine):
    """A gaze event of one person and the robot: directed gaze or mutual facial gaze."""

    ROBOT_WAITS: ClassVar[str]
    """State after the robot has begun, until the person joins."""
    HUMAN_WAITS: ClassVar[str]
    TOGETHER: ClassVar[str]
    """State of the shared phase."""
    ROBOT_BEGINS: ClassVar[str]
    """Input when the robot begins; `<input>_<TOGETHER>` if the person looks there already."""
    HUMAN_BEGINS: ClassVar[str]
    """Input when the person begins; `<input>_<TOGETHER>`, or `<input>_in_vain` if the robot cannot answer."""
    ROBOT_JOINS: ClassVar[str]
    HUMAN_JOINS: ClassVar[str]

    def __init__(self, writer: EventWriter) -> None:
        super().__init__(writer)
        self.by_robot = False
        self.clock: LimitClock | None = None
        self._robot_on = self._human_on = self._robot_came = False
        self._shared_since: Seconds | None = None

    @property
    def deadline(self) -> Seconds | None:
        if self.clock is None or self.state not in (self.ROBOT_WAITS, self.HUMAN_WAITS):
            return None
        return self.clock.deadline

    @property
    def is_shared(self) -> bool:
        """True while both look there."""
        return self.state == self.TOGETHER and self._shared_since is not None

    def expire(self, at: Seconds) -> None:
        """Decide the event at its deadline: the limit has passed, or the robot has never shown its target."""
        never_shown = self.clock is not None and self.clock.waiting
        self.step("withdraw" if never_shown else "limit", at)

    def robot_begins(self, event: OngoingEvent, clock: LimitClock, *, robot_on: bool, look: GazeState | None) -> None:
        """Begin the event by the robot's request. look: the person's, if it is on the target already."""
        self._begin(event, clock, by_robot=True, robot_on=robot_on, human_on=look is not None)
        if look is None:
            self.step(self.ROBOT_BEGINS, event.started)
        else:
            given = f"{self.ROBOT_BEGINS}_{self.TOGETHER}"
            self._join(given, max(event.started, look.since), confidence=look.confidence)

    def human_begins(
        self,
        event: OngoingEvent,
        limit: Seconds,
        *,
        robot_since: Seconds | None,
        human_on: bool,
        in_vain: bool,
        at: Seconds,
    ) -> None:
        """Begin the event by the person's gesture or look, recognized at `at`, which may be later than its start.

        robot_since: start of the robot's look there, None if it looks elsewhere. in_vain: a fragment's own gaze holds
        the head elsewhere.
        """
        clock = LimitClock(event.started, limit)
        self._begin(event, clock, by_robot=False, robot_on=robot_since is not None, human_on=human_on)
        if robot_since is not None:
            self._join(f"{self.HUMAN_BEGINS}_{self.TOGETHER}", at, came=robot_since)
        else:
            self.step(f"{self.HUMAN_BEGINS}_in_vain" if in_vain else self.HUMAN_BEGINS, at)

    def _begin(
        self, event: OngoingEvent, clock: LimitClock, *, by_robot: bool, robot_on: bool, human_on: bool
    ) -> None:
        self.event, self.clock, self.by_robot = event, clock, by_robot
        self._robot_on = self._robot_came = robot_on
        self._human_on, self._shared_since = human_on, None

    def gazes(self, *, robot_on: bool, human_on: bool, at: Seconds, confidence: Probability = 1.0) -> None:
        """Take a change of gaze: True for each of the two that looks there now. confidence: of the person's look."""
        if self.event is None:
            return
        robot_left, human_left = self._robot_on and not robot_on, self._human_on and not human_on
        self._robot_on, self._human_on = robot_on, human_on
        self._robot_came = self._robot_came or robot_on
        if self.state == self.ROBOT_WAITS and human_on:
            self._join(self.HUMAN_JOINS, at, confidence=confidence)
        elif self.state == self.HUMAN_WAITS and robot_on:
            self._join(self.ROBOT_JOINS, at)
        elif self.state == self.ROBOT_WAITS and robot_left:
            self.step("robot_leaves", at)
        elif self.state == self.HUMAN_WAITS and human_left:
            self.step("human_leaves", at)
        elif self.state == self.TOGETHER:
            self._share(at)

    def _join(self, given: str, at: Seconds, came: Seconds | None = None, confidence: Probability = 1.0) -> None:
        """Let the responder join. came: start of its look, if not `at`. confidence: of that look."""
        assert self.event is not None
        self.event.rests_on(confidence)
        together_since = max(at if came is None else came, self.event.started)
        self.event.delay = together_since - self.event.started
        self.step(given, at)
        self._share(together_since)

    def _share(self, at: Seconds) -> None:
        """Update the shared phase: it begins when both look there, and ends when one does not."""
        if self._robot_on and self._human_on:
            self._shared_since = at if self._shared_since is None else self._shared_since
        elif self._shared_since is not None or not self._human_on or self._robot_came:
            self._part("part", at)

    def _part(self, given: str, at: Seconds, until: Seconds | None = None) -> None:
        """End the shared phase. until: time at which it was last seen, if not `at`."""
        assert self.event is not None
        since = self._shared_since
        self.event.duration = 0.0 if since is None else max(0.0, (at if until is None else until) - since)
        self.step(given, at)

    def block_ended(self, at: Seconds, *, aborted: bool) -> None:
        """End the robot's part: an aborted fragment withdraws its event; a shared phase that lacks its gaze ends."""
        if self.clock is not None:
            self.clock.stop_waiting(at)
        if self.state == self.ROBOT_WAITS and aborted:
            self.step("withdraw", at)
        elif self.state == self.TOGETHER and not self._robot_on:
            self._part("part", at)

    def supersede(self, at: Seconds) -> None:
        """End the event because the robot begins anew: a shared phase completes, a pending event is superseded."""
        self._close("supersede", at)

    def person_gone(self, at: Seconds, until: Seconds) -> None:
        self._close("person_gone", at, until)

    def _close(self, given: str, at: Seconds, until: Seconds | None = None) -> None:
        if self.state == self.TOGETHER:
            self._part(given, at, until)
        elif self.state != IDLE:
            self.step(given, at)
