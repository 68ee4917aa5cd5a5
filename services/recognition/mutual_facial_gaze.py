"""Mutual facial gaze: each looks at the other's face. Thesis 2.2.2.

The robot asks for it when its head begins to move. Its turning away counts only once its gaze has been on the
face since the request; before that it has not yet come.
"""

from schemas.units import Seconds
from services.recognition.limits import LimitClock
from services.recognition.machine import IDLE, Ledger, Machine, Row, UnderWay, table

ROBOT_WAITING, HUMAN_WAITING, MUTUAL = "robot_waiting", "human_waiting", "mutual"

TABLE = table(
    Row(IDLE, "robot_looks", ROBOT_WAITING, ("started",)),
    Row(IDLE, "robot_looks_mutual", MUTUAL, ("started", "succeeded")),
    Row(IDLE, "human_looks", HUMAN_WAITING, ("started",)),
    Row(IDLE, "human_looks_mutual", MUTUAL, ("started", "succeeded")),
    Row(IDLE, "human_looks_in_vain", IDLE, ("started", "preempted")),
    Row(ROBOT_WAITING, "human_answers", MUTUAL, ("succeeded",)),
    Row(ROBOT_WAITING, "limit", IDLE, ("failed",)),
    Row(ROBOT_WAITING, "robot_leaves", IDLE, ("withdrawn",)),
    Row(ROBOT_WAITING, "withdraw", IDLE, ("withdrawn",)),
    Row(ROBOT_WAITING, "person_gone", IDLE, ("failed",)),
    Row(ROBOT_WAITING, "supersede", IDLE, ("superseded",)),
    Row(HUMAN_WAITING, "robot_answers", MUTUAL, ("succeeded",)),
    Row(HUMAN_WAITING, "limit", IDLE, ("failed",)),
    Row(HUMAN_WAITING, "human_leaves", IDLE, ("failed",)),
    Row(HUMAN_WAITING, "fragment_takes_head", IDLE, ("preempted",)),
    Row(HUMAN_WAITING, "person_gone", IDLE, ("withdrawn",)),
    Row(HUMAN_WAITING, "supersede", IDLE, ("superseded",)),
    Row(MUTUAL, "part", IDLE, ("completed",)),
    Row(MUTUAL, "directed_gaze_begins", IDLE, ("completed",)),
    Row(MUTUAL, "supersede", IDLE, ("completed",)),
    Row(MUTUAL, "person_gone", IDLE, ("completed",)),
)


class MutualFacialGaze(Machine):
    """The mutual facial gaze of one person and the robot."""

    TABLE = TABLE

    def __init__(self, ledger: Ledger, *, strict: bool = True) -> None:
        super().__init__(ledger, strict=strict)
        self.clock: LimitClock | None = None
        self._robot_on = self._human_on = self._robot_came = False
        self._mutual_since: Seconds | None = None

    @property
    def deadline(self) -> Seconds | None:
        if self.clock is None or self.state not in (ROBOT_WAITING, HUMAN_WAITING):
            return None
        return self.clock.deadline

    def expire(self, at: Seconds) -> None:
        self.step("limit", at)

    def robot_looks(self, event: UnderWay, clock: LimitClock, *, robot_on: bool, human_since: Seconds | None) -> None:
        """The robot's request. human_since: since when the person looks at the robot's face, None if elsewhere."""
        self._begin(event, clock, robot_on=robot_on, human_on=human_since is not None)
        if human_since is None:
            self.step("robot_looks", event.started)
            return
        event.delay = max(0.0, human_since - event.started)
        self.step("robot_looks_mutual", event.started + event.delay)
        self._share(event.started + event.delay)

    def human_looks(self, event: UnderWay, clock: LimitClock, *, robot_on: bool, in_vain: bool, at: Seconds) -> None:
        """The person looks at the robot's face. in_vain: a fragment's own gaze holds the head elsewhere."""
        self._begin(event, clock, robot_on=robot_on, human_on=True)
        if robot_on:
            event.delay = 0.0
            self.step("human_looks_mutual", at)
            self._share(at)
        else:
            self.step("human_looks_in_vain" if in_vain else "human_looks", at)

    def _begin(self, event: UnderWay, clock: LimitClock, *, robot_on: bool, human_on: bool) -> None:
        self.event, self.clock, self._mutual_since = event, clock, None
        self._robot_on = self._robot_came = robot_on
        self._human_on = human_on

    def gazes(self, *, robot_on: bool, human_on: bool, at: Seconds) -> None:
        """Somebody's gaze has changed: who looks at the other's face now."""
        if self.event is None:
            return
        self._robot_on, self._human_on = robot_on, human_on
        self._robot_came = self._robot_came or robot_on
        if self.state == ROBOT_WAITING and human_on:
            self._answer("human_answers", at)
        elif self.state == ROBOT_WAITING and self._robot_came and not robot_on:
            self.step("robot_leaves", at)
        elif self.state == HUMAN_WAITING and not human_on:
            self.step("human_leaves", at)
        elif self.state == HUMAN_WAITING and robot_on:
            self._answer("robot_answers", at)
        elif self.state == MUTUAL:
            self._share(at)

    def _answer(self, given: str, at: Seconds) -> None:
        assert self.event is not None
        self.event.delay = max(0.0, at - self.event.started)
        self.step(given, at)
        self._share(at)

    def _share(self, at: Seconds) -> None:
        if self._robot_on and self._human_on:
            self._mutual_since = at if self._mutual_since is None else self._mutual_since
        elif self._mutual_since is not None or not self._human_on or self._robot_came:
            self._part("part", at)

    def _part(self, given: str, at: Seconds, until: Seconds | None = None) -> None:
        assert self.event is not None
        since = self._mutual_since
        self.event.duration = 0.0 if since is None else max(0.0, (at if until is None else until) - since)
        self.step(given, at)

    def directed_gaze_begins(self, at: Seconds, *, by_robot: bool) -> None:
        """Eyes go elsewhere: a mutual gaze is over, and the robot takes its own request back."""
        if self.state == MUTUAL:
            self._part("directed_gaze_begins", at)
        elif self.state == ROBOT_WAITING and by_robot:
            self.step("withdraw", at)

    def block_ended(self, at: Seconds, *, aborted: bool) -> None:
        if self.clock is not None:
            self.clock.stop_waiting(at)
        if self.state == ROBOT_WAITING and aborted:
            self.step("withdraw", at)
        elif self.state == MUTUAL and not self._robot_on:
            self._part("part", at)

    def supersede(self, at: Seconds) -> None:
        """The robot asks again: a mutual gaze completes, a pending one gives way."""
        if self.state == MUTUAL:
            self._part("supersede", at)
        elif self.state != IDLE:
            self.step("supersede", at)

    def person_gone(self, at: Seconds, until: Seconds) -> None:
        if self.state == MUTUAL:
            self._part("person_gone", at, until)
        elif self.state != IDLE:
            self.step("person_gone", at)
