"""Directed gaze: one looks or points at objects, so that the other looks there too. Thesis 2.2.1.

The initiator may look away before the responder arrives, most of all when pointing; so the robot's own gaze
matters only for the length of the shared phase. If the robot points while its head is still on its way, the shared
phase begins when the head arrives.
"""

from engage_hri.services.recognition.events.machine import IDLE, EventWriter, TransitionRow, table
from engage_hri.services.recognition.events.shared_gaze import ROBOT_COMING, SharedGaze

ROBOT_DIRECTING, HUMAN_DIRECTING, SHARED = "robot_directing", "human_directing", "shared"

TABLE = table(
    TransitionRow(IDLE, "robot_asks", ROBOT_COMING),
    TransitionRow(IDLE, "human_directs", HUMAN_DIRECTING, ("started",)),
    TransitionRow(IDLE, "human_directs_shared", SHARED, ("started", "succeeded")),
    TransitionRow(IDLE, "human_directs_in_vain", IDLE, ("started", "preempted")),
    TransitionRow(ROBOT_COMING, "robot_directs", ROBOT_DIRECTING, ("started",)),
    TransitionRow(ROBOT_COMING, "robot_directs_shared", SHARED, ("started", "succeeded")),
    TransitionRow(ROBOT_COMING, "person_gone", IDLE, ("started", "failed")),
    TransitionRow(ROBOT_COMING, "withdraw", IDLE, ("started", "withdrawn")),
    TransitionRow(ROBOT_COMING, "supersede", IDLE, ("started", "superseded")),
    TransitionRow(ROBOT_DIRECTING, "human_follows", SHARED, ("succeeded",)),
    TransitionRow(ROBOT_DIRECTING, "robot_leaves", ROBOT_DIRECTING),
    TransitionRow(ROBOT_DIRECTING, "limit", IDLE, ("failed",)),
    TransitionRow(ROBOT_DIRECTING, "person_gone", IDLE, ("failed",)),
    TransitionRow(ROBOT_DIRECTING, "withdraw", IDLE, ("withdrawn",)),
    TransitionRow(ROBOT_DIRECTING, "supersede", IDLE, ("superseded",)),
    TransitionRow(HUMAN_DIRECTING, "robot_follows", SHARED, ("succeeded",)),
    TransitionRow(HUMAN_DIRECTING, "human_leaves", HUMAN_DIRECTING),
    TransitionRow(HUMAN_DIRECTING, "limit", IDLE, ("failed",)),
    TransitionRow(HUMAN_DIRECTING, "person_gone", IDLE, ("withdrawn",)),
    TransitionRow(HUMAN_DIRECTING, "fragment_takes_head", IDLE, ("preempted",)),
    TransitionRow(SHARED, "part", IDLE, ("completed",)),
    TransitionRow(SHARED, "supersede", IDLE, ("completed",)),
    TransitionRow(SHARED, "person_gone", IDLE, ("completed",)),
)


class DirectedGaze(SharedGaze):
    """One directed gaze of one person and the robot at `objects`, from idle to idle."""

    TABLE = TABLE
    ROBOT_WAITS, HUMAN_WAITS, TOGETHER = ROBOT_DIRECTING, HUMAN_DIRECTING, SHARED
    ROBOT_BEGINS, HUMAN_BEGINS = "robot_directs", "human_directs"
    ROBOT_JOINS, HUMAN_JOINS = "robot_follows", "human_follows"

    def __init__(self, writer: EventWriter, objects: tuple[str, ...]) -> None:
        super().__init__(writer)
        self.objects = objects
