"""Directed gaze: one looks or points at objects, so that the other looks there too. Thesis 2.2.1.

The initiator may look away before the responder arrives, most of all when pointing; so the robot's own gaze
matters only for how long the gaze was shared. When the human is there first the robot's head is still on its
way: the sharing begins with its arrival.
"""

from schemas.units import Seconds
from services.recognition.limits import LimitClock
from services.recognition.machine import IDLE, Ledger, Machine, Row, UnderWay, table

ROBOT_DIRECTING, HUMAN_DIRECTING, SHARED = "robot_directing", "human_directing", "shared"

TABLE = table(
    Row(IDLE, "robot_directs", ROBOT_DIRECTING, ("started",)),
    Row(IDLE, "robot_directs_shared", SHARED, ("started", "succeeded")),
    Row(IDLE, "human_directs", HUMAN_DIRECTING, ("started",)),
    Row(IDLE, "human_directs_shared", SHARED, ("started", "succeeded")),
    Row(IDLE, "human_directs_in_vain", IDLE, ("started", "preempted")),
    Row(ROBOT_DIRECTING, "human_follows", SHARED, ("succeeded",)),
    Row(ROBOT_DIRECTING, "robot_leaves", ROBOT_DIRECTING),
    Row(ROBOT_DIRECTING, "limit", IDLE, ("failed",)),
    Row(ROBOT_DIRECTING, "person_gone", IDLE, ("failed",)),
    Row(ROBOT_DIRECTING, "withdraw", IDLE, ("withdrawn",)),
    Row(ROBOT_DIRECTING, "supersede", IDLE, ("superseded",)),
    Row(HUMAN_DIRECTING, "robot_follows", SHARED, ("succeeded",)),
    Row(HUMAN_DIRECTING, "human_leaves", HUMAN_DIRECTING),
    Row(HUMAN_DIRECTING, "limit", IDLE, ("failed",)),
    Row(HUMAN_DIRECTING, "person_gone", IDLE, ("withdrawn",)),
    Row(HUMAN_DIRECTING, "fragment_takes_head", IDLE, ("preempted",)),
    Row(HUMAN_DIRECTING, "supersede", IDLE, ("superseded",)),
    Row(SHARED, "part", IDLE, ("completed",)),
    Row(SHARED, "supersede", IDLE, ("completed",)),
    Row(SHARED, "person_gone", IDLE, ("completed",)),
)


class DirectedGaze(Machine):
    """One directed gaze of one person and the robot at `objects`, from idle to idle."""

    TABLE = TABLE

    def __init__(self, ledger: Ledger, objects: tuple[str, ...], *, strict: bool = True) -> None:
        super().__init__(ledger, strict=strict)
        self.objects = objects
        self.by_robot = False
        self.clock: LimitClock | None = None
        self._robot_on = self._human_on = self._robot_came = False
        self._shared_since: Seconds | None = None

    @property
    def deadline(self) -> Seconds | None:
        open = self.clock is not None and self.state in (ROBOT_DIRECTING, HUMAN_DIRECTING)
        return self.clock.deadline if open and self.clock else None

    def expire(self, at: Seconds) -> None:
        self.step("limit", at)

    def robot_directs(
        self, event: UnderWay, clock: LimitClock, *, robot_on: bool, human_since: Seconds | None
    ) -> None:
        """The robot's request. human_since: since when the person looks there already, None if elsewhere."""
        self.event, self.clock, self.by_robot = event, clock, True
        self._robot_on = self._robot_came = robot_on
        self._human_on = human_since is not None
        if human_since is None:
            self.step("robot_directs", event.started)
            return
        event.delay = max(0.0, human_since - event.started)
        self.step("robot_directs_shared", event.started + event.delay)
        self._share(event.started + event.delay)

    def human_directs(
        self,
        event: UnderWay,
        clock: LimitClock,
        *,
        robot_since: Seconds | None,
        human_on: bool,
        in_vain: bool,
        at: Seconds,
    ) -> None:
        """The person points or looks; recognized at `at`, later than its start for a look.

        robot_since: since when the robot looks there, None if elsewhere. in_vain: a fragment's own gaze holds
        the head elsewhere.
        """
        self.event, self.clock = event, clock
        self._robot_on = self._robot_came = robot_since is not None
        self._human_on = human_on
        if robot_since is not None:
            event.delay = max(0.0, robot_since - event.started)
            self.step("human_directs_shared", at)
            self._share(at)
        else:
            self.step("human_directs_in_vain" if in_vain else "human_directs", at)

    def gazes(self, *, robot_on: bool, human_on: bool, at: Seconds) -> None:
        """Somebody's gaze has changed: who looks at the objects now."""
        if self.event is None:
            return
        robot_left, human_left = self._robot_on and not robot_on, self._human_on and not human_on
        self._robot_on, self._human_on = robot_on, human_on
        self._robot_came = self._robot_came or robot_on
        if self.state == ROBOT_DIRECTING and human_on:
            self._follow("human_follows", at)
        elif self.state == HUMAN_DIRECTING and robot_on:
            self._follow("robot_follows", at)
        elif self.state == ROBOT_DIRECTING and robot_left:
            self.step("robot_leaves", at)
        elif self.state == HUMAN_DIRECTING and human_left:
            self.step("human_leaves", at)
        elif self.state == SHARED:
            self._share(at)

    def _follow(self, given: str, at: Seconds) -> None:
        assert self.event is not None
        self.event.delay = max(0.0, at - self.event.started)
        self.step(given, at)
        self._share(at)

    def _share(self, at: Seconds) -> None:
        """The shared phase: begins when both are there, ends when one of them is not."""
        if self._robot_on and self._human_on:
            self._shared_since = at if self._shared_since is None else self._shared_since
        elif self._shared_since is not None or not self._human_on or self._robot_came:
            self.part(at)

    def part(self, at: Seconds, given: str = "part", until: Seconds | None = None) -> None:
        """End the shared phase; until: when it was last seen, if not `at`."""
        assert self.event is not None
        since = self._shared_since
        self.event.duration = 0.0 if since is None else max(0.0, (at if until is None else until) - since)
        self.step(given, at)

    def block_ended(self, at: Seconds, *, aborted: bool) -> None:
        """The robot is done: an aborted fragment takes its event back; a gaze that never came is over."""
        if self.clock is not None:
            self.clock.stop_waiting(at)
        if self.state == ROBOT_DIRECTING and aborted:
            self.step("withdraw", at)
        elif self.state == SHARED and not self._robot_on:
            self.part(at)

    def supersede(self, at: Seconds) -> None:
        """The robot directs anew to the same objects."""
        if self.state == SHARED:
            self.part(at, "supersede")
        else:
            self.step("supersede", at)

    def person_gone(self, at: Seconds, until: Seconds) -> None:
        if self.state == SHARED:
            self.part(at, "person_gone", until)
        else:
            self.step("person_gone", at)
