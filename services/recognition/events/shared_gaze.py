"""The base of both gaze events: one begins, the other joins, and the shared phase lasts while both look there.

Thesis 2.2.1-2. The names of states and inputs are data of the subclasses; their tables have the transitions.

A look begins with its arrival, for both sides. The robot asks before its head is there; the event starts when it
shows its target (decision 0197). Who has followed the words by then was there at once: the delay is 0. And two who
look at each other meet once: if the robot asks for a look while the person's own look waits for it, the request waits
for what becomes of that. If they meet, this is the event that was asked for; if they don't, the request begins an
event of its own (decision 0187).
"""

from collections.abc import Callable, Iterator
from math import inf
from typing import ClassVar, NamedTuple

from engage_hri.schemas.recognition import EventState
from engage_hri.schemas.units import Probability, Seconds
from engage_hri.services.recognition.events.limits import LimitClock
from engage_hri.services.recognition.events.machine import IDLE, EventWriter, Machine, OngoingEvent
from engage_hri.services.recognition.events.scene import GazeState

ROBOT_COMING = "robot_coming"
"""State after the robot has asked, until it shows its target."""


class _Asked(NamedTuple):
    """An event that the robot has asked for, with the clock of its limit."""

    event: OngoingEvent
    clock: LimitClock


class SharedGaze(Machine):
    """A gaze event of one person and the robot: directed gaze or mutual facial gaze."""

    ROBOT_WAITS: ClassVar[str]
    """State after the robot has shown its target, until the person joins."""
    HUMAN_WAITS: ClassVar[str]
    TOGETHER: ClassVar[str]
    """State of the shared phase."""
    ROBOT_BEGINS: ClassVar[str]
    """Input when the robot shows its target; `<input>_<TOGETHER>` if the person looks there already."""
    HUMAN_BEGINS: ClassVar[str]
    """Input when the person begins; `<input>_<TOGETHER>`, or `<input>_in_vain` if the robot cannot answer."""
    ROBOT_JOINS: ClassVar[str]
    HUMAN_JOINS: ClassVar[str]

    def __init__(self, writer: EventWriter) -> None:
        super().__init__(writer)
        self.by_robot = False
        self._clock: LimitClock | None = None
        self._robot_on = self._human_on = self._robot_came = False
        self._shared_since: Seconds | None = None
        self._confidence: Probability = 1.0
        """Confidence of the person's present look."""
        self._asked: _Asked | None = None
        """What the robot has asked for while the person waits."""

    @property
    def deadline(self) -> Seconds:
        if self._clock is None or self.state not in (ROBOT_COMING, self.ROBOT_WAITS, self.HUMAN_WAITS):
            return inf
        return self._clock.deadline

    @property
    def is_shared(self) -> bool:
        """True while both look there."""
        return self.state == self.TOGETHER and self._shared_since is not None

    def expire(self, at: Seconds) -> None:
        """Decide the event at its deadline: the limit has passed, or an anchor has never come."""
        still_waits = self._clock is not None and self._clock.waiting
        self.step("withdraw" if still_waits else "limit", at)

    # -- beginnings ---------------------------------------------------------------------------------------------

    def robot_begins(self, event: OngoingEvent, clock: LimitClock, *, robot_on: bool, look: GazeState | None) -> None:
        """Begin the event by the robot's request, or adopt that of the person.

        look: the person's, if it is on the target already.
        """
        at = event.started
        if self.event is not None and self.is_shared:
            self._adopt(event)
            self._writer.publish(self.event, "succeeded", at, retold=True)
        elif self.state == self.HUMAN_WAITS:
            if self._asked is not None:
                self._drop("superseded", at)
            self._asked = _Asked(event, clock)
        else:
            self._close("supersede", at)
            self._confidence = 1.0 if look is None else look.sureness(event.objects or (event.initiator,))
            if robot_on:
                clock.show(at)
            self._begin(event, clock, by_robot=True, robot_on=robot_on, human_on=look is not None)
            self.step("robot_asks", at)
            self._follow(at if look is None else max(at, look.since))

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
        self._confidence = event.confidence
        self._begin(event, clock, by_robot=False, robot_on=robot_since is not None, human_on=human_on)
        if robot_since is not None:
            self._join(f"{self.HUMAN_BEGINS}_{self.TOGETHER}", at, came=robot_since)
        else:
            self.step(f"{self.HUMAN_BEGINS}_in_vain" if in_vain else self.HUMAN_BEGINS, at)

    def _begin(
        self, event: OngoingEvent, clock: LimitClock, *, by_robot: bool, robot_on: bool, human_on: bool
    ) -> None:
        self.event, self._clock, self.by_robot = event, clock, by_robot
        self._robot_on = self._robot_came = robot_on
        self._human_on, self._shared_since = human_on, None

    def step(self, given: str, at: Seconds) -> None:
        """Take one transition. What the robot has asked for begins when it ends, at the latest.

        If it has waited for the person's event, it goes its own way when that has ended without it.
        """
        if self.state == ROBOT_COMING:
            self._start(at)
        super().step(given, at)
        if self.state == IDLE and self._asked is not None:
            (event, clock), self._asked = self._asked, None
            self._begin(event, clock, by_robot=True, robot_on=self._robot_on, human_on=self._human_on)
            super().step("robot_asks", at)
            self._follow(at)

    def _start(self, at: Seconds) -> None:
        """Let what the robot has asked for start when it is shown, or now at the latest."""
        assert self.event is not None
        assert self._clock is not None
        self.event.started = self._clock.show(at)

    def _adopt(self, asked: OngoingEvent) -> None:
        """Let the present event be the one that the robot has asked for."""
        assert self.event is not None
        self.event.request, self.event.turn = asked.request, asked.turn
        self.event.block, self.event.behavior = asked.block, asked.behavior

    def _drop(self, state: EventState, at: Seconds) -> None:
        """Tell of an event that was asked for, and will not begin any more."""
        assert self._asked is not None
        (event, clock), self._asked = self._asked, None
        event.started = clock.show(at)
        self._writer.publish(event, "started", at)
        self._writer.publish(event, state, at)

    # -- what happens -------------------------------------------------------------------------------------------

    def gazes(self, *, robot_on: bool, human_on: bool, at: Seconds, confidence: Probability = 1.0) -> None:
        """Take a change of gaze: True for each of the two that looks there now. confidence: of the person's look."""
        if self.event is None:
            return
        robot_left, human_left = self._robot_on and not robot_on, self._human_on and not human_on
        self._robot_on, self._human_on, self._confidence = robot_on, human_on, confidence
        self._robot_came = self._robot_came or robot_on
        if robot_on and self._clock is not None:
            self._clock.show(at)
        if self.state == self.ROBOT_WAITS and robot_left and not human_on:
            self.step("robot_leaves", at)
        elif self.state == self.HUMAN_WAITS and human_left and not robot_on:
            self.step("human_leaves", at)
        elif self.state == self.TOGETHER:
            self._share(at)
        else:
            self._follow(at)

    def robot_points(self, at: Seconds) -> None:
        """Take a gesture of the robot that shows the target, whether or not it looks there."""
        if self.state == self.HUMAN_WAITS:
            self._join(self.ROBOT_JOINS, at)
        elif self._clock is not None:
            self._clock.show(at)
            self._follow(at)

    def realised(self, block: str, name: str, at: Seconds) -> None:
        """Take a realised sync point of a block of the robot: time limits may run from there."""
        for clock in self.clocks_of(block):
            clock.realised(name, at)
        self._follow(at)

    def clocks_of(self, block: str) -> Iterator[LimitClock]:
        """Clocks of what a block of the robot has asked for."""
        if self._asked is not None and self._asked.event.block == block:
            yield self._asked.clock
        if self.event is not None and self.event.block == block and self._clock is not None:
            yield self._clock

    def _follow(self, at: Seconds) -> None:
        """Start what the robot has shown, and let the responder join who is there."""
        is_shown = self._clock is not None and self._clock.shown_at is not None
        if self.state == ROBOT_COMING and is_shown:
            self._start(at)
            if self._human_on:
                self._join(f"{self.ROBOT_BEGINS}_{self.TOGETHER}", at, confidence=self._confidence)
            else:
                self.step(self.ROBOT_BEGINS, at)
        elif self.state == self.ROBOT_WAITS and self._human_on:
            self._join(self.HUMAN_JOINS, at, confidence=self._confidence)
        elif self.state == self.HUMAN_WAITS and self._robot_on:
            self._join(self.ROBOT_JOINS, at)

    def _join(self, given: str, at: Seconds, came: Seconds | None = None, confidence: Probability = 1.0) -> None:
        """Let the responder join. came: start of its look, if not `at`. confidence: of that look."""
        assert self.event is not None
        self.event.rests_on(confidence)
        together_since = max(at if came is None else came, self.event.started)
        self.event.delay = together_since - self.event.started
        if self._asked is not None:
            self._adopt(self._asked.event)
            self._asked = None
        self.step(given, at)
        self._share(together_since)

    def _share(self, at: Seconds) -> None:
        """Update the shared phase: it begins when both look there, and ends when one does not."""
        if self._robot_on and self._human_on:
            self._shared_since = at if self._shared_since is None else self._shared_since
        elif self._shared_since is not None or not self._human_on or self._robot_came:
            self._part("part", at)

    # -- endings ------------------------------------------------------------------------------------------------

    def _part(self, given: str, at: Seconds, until: Seconds | None = None) -> None:
        """End the shared phase. until: time at which it was last seen, if not `at`."""
        assert self.event is not None
        since = self._shared_since
        self.event.duration = 0.0 if since is None else max(0.0, (at if until is None else until) - since)
        self.step(given, at)

    def block_ended(self, block: str, at: Seconds, *, aborted: bool) -> None:
        """End the robot's part: an aborted fragment withdraws its event; a shared phase that lacks its gaze ends."""
        self._robots_part_ends(lambda event: event.block == block, at, aborted=aborted)

    def abort(self, turn: str, at: Seconds) -> None:
        """Withdraw what the robot began in a turn that was cut off."""
        self._robots_part_ends(lambda event: event.turn == turn, at, aborted=True)

    def _robots_part_ends(self, concerns: Callable[[OngoingEvent], bool], at: Seconds, *, aborted: bool) -> None:
        if self._asked is not None and concerns(self._asked.event):
            self._asked.clock.stop_waiting(at)
            if aborted:
                self._drop("withdrawn", at)
        if self.event is not None and concerns(self.event):
            if self._clock is not None:
                self._clock.stop_waiting(at)
            if self.state in (ROBOT_COMING, self.ROBOT_WAITS) and aborted:
                self.step("withdraw", at)
            elif self.state == self.TOGETHER and not self._robot_on:
                self._part("part", at)
        self._follow(at)

    def withdraw(self, event: OngoingEvent, at: Seconds) -> None:
        """Withdraw this event of the robot."""
        if self._asked is not None and self._asked.event is event:
            self._drop("withdrawn", at)
        elif self.event is event:
            self.step("withdraw", at)

    def person_gone(self, at: Seconds, until: Seconds) -> None:
        if self._asked is not None:
            self._drop("failed", at)
        self._close("person_gone", at, until)

    def _close(self, given: str, at: Seconds, until: Seconds | None = None) -> None:
        if self.state == self.TOGETHER:
            self._part(given, at, until)
        elif self.state != IDLE:
            self.step(given, at)
