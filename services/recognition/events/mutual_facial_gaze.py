"""Mutual facial gaze: each looks at the other's face. Thesis 2.2.2.

The robot asks for it when its head begins to move, and it starts when the head is there. That the robot turns away
counts only after its gaze has been on the face since the request; before that its gaze is still on the way.
"""

from engage_hri.schemas.units import Seconds
from engage_hri.services.recognition.events.machine import IDLE, TransitionRow, table
from engage_hri.services.recognition.events.shared_gaze import ROBOT_COMING, SharedGaze

ROBOT_WAITING, HUMAN_WAITING, MUTUAL = "robot_waiting", "human_waiting", "mutual"

TABLE = table(
    TransitionRow(IDLE, "robot_asks", ROBOT_COMING),
    TransitionRow(IDLE, "human_looks", HUMAN_WAITING, ("started",)),
    TransitionRow(IDLE, "human_looks_mutual", MUTUAL, ("started", "succeeded")),
    TransitionRow(IDLE, "human_looks_in_vain", IDLE, ("started", "preempted")),
    TransitionRow(ROBOT_COMING, "robot_looks", ROBOT_WAITING, ("started",)),
    TransitionRow(ROBOT_COMING, "robot_looks_mutual", MUTUAL, ("started", "succeeded")),
    TransitionRow(ROBOT_COMING, "person_gone", IDLE, ("started", "failed")),
    TransitionRow(ROBOT_COMING, "withdraw", IDLE, ("started", "withdrawn")),
    TransitionRow(ROBOT_COMING, "supersede", IDLE, ("started", "superseded")),
    TransitionRow(ROBOT_WAITING, "human_answers", MUTUAL, ("succeeded",)),
    TransitionRow(ROBOT_WAITING, "limit", IDLE, ("failed",)),
    TransitionRow(ROBOT_WAITING, "robot_leaves", IDLE, ("withdrawn",)),
    TransitionRow(ROBOT_WAITING, "withdraw", IDLE, ("withdrawn",)),
    TransitionRow(ROBOT_WAITING, "person_gone", IDLE, ("failed",)),
    TransitionRow(ROBOT_WAITING, "supersede", IDLE, ("superseded",)),
    TransitionRow(HUMAN_WAITING, "robot_answers", MUTUAL, ("succeeded",)),
    TransitionRow(HUMAN_WAITING, "limit", IDLE, ("failed",)),
    TransitionRow(HUMAN_WAITING, "human_leaves", IDLE, ("failed",)),
    TransitionRow(HUMAN_WAITING, "fragment_takes_head", IDLE, ("preempted",)),
    TransitionRow(HUMAN_WAITING, "person_gone", IDLE, ("withdrawn",)),
    TransitionRow(MUTUAL, "part", IDLE, ("completed",)),
    TransitionRow(MUTUAL, "directed_gaze_begins", IDLE, ("completed",)),
    TransitionRow(MUTUAL, "supersede", IDLE, ("completed",)),
    TransitionRow(MUTUAL, "person_gone", IDLE, ("completed",)),
)


class MutualFacialGaze(SharedGaze):
    """The mutual facial gaze of one person and the robot."""

    TABLE = TABLE
    ROBOT_WAITS, HUMAN_WAITS, TOGETHER = ROBOT_WAITING, HUMAN_WAITING, MUTUAL
    ROBOT_BEGINS, HUMAN_BEGINS = "robot_looks", "human_looks"
    ROBOT_JOINS, HUMAN_JOINS = "robot_answers", "human_answers"

    def directed_gaze_begins(self, at: Seconds, *, by_robot: bool) -> None:
        """End the mutual gaze because a directed gaze takes the eyes elsewhere; the robot withdraws its request."""
        if self.state == MUTUAL:
            self._part("directed_gaze_begins", at)
        elif by_robot and self._asked is not None:
            self._drop("withdrawn", at)
        elif self.state in (ROBOT_COMING, ROBOT_WAITING) and by_robot:
            self.step("withdraw", at)
