"""Directed gaze: one looks or points at objects, so that the other looks there too. Thesis 2.2.1.

The initiator may look away before the responder arrives, most of all when pointing; so the robot's own gaze
matters only for the length of the shared phase. If the person looks there first, while the robot's head is still on
its way, the shared phase begins when the head arrives.
"""

from engage_hri.services.recognition.events.machine import IDLE, EventWriter, Row, table
from engage_hri.services.recognition.events.shared_gaze import SharedGaze

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


class DirectedGaze(SharedGaze):
    """One directed gaze of one person and the robot at `objects`, from idle to idle."""

    TABLE = TABLE
    ROBOT_WAITS, HUMAN_WAITS, TOGETHER = ROBOT_DIRECTING, HUMAN_DIRECTING, SHARED
    ROBOT_BEGINS, HUMAN_BEGINS = "robot_directs", "human_directs"
    ROBOT_JOINS, HUMAN_JOINS = "robot_follows", "human_follows"

    def __init__(self, writer: EventWriter, objects: tuple[str, ...]) -> None:
        super().__init__(writer)
        self.objects = objects
