"""The judge: every law, asked of one story."""

from collections.abc import Callable, Iterator, Mapping

from tests.judge import laws_custom, laws_feedback, laws_held, laws_motion, laws_time
from tests.judge.case import Case, Finding
from tests.judge.record import Record
from tests.judge.story import Story

LAWS: Mapping[str, str] = {
    "hang": "a block did not end",
    "crash": "a bug was logged, or the clock ran out",
    "end": "an end that is not one, or that feedback and outcome tell differently",
    "points": "sync points out of order, twice, too late, or missing",
    "losses": "a behavior was lost without its one warning",
    "required": "something required was dropped, and the block is done",
    "words": "other words were told than heard",
    "robbed": "another behavior took a part before the stroke was made, though the body is exact",
    "talked over": "words were lost because another block was speaking",
    "broken": "a constraint within a block was broken in silence",
    "broken across blocks": "a constraint with a point of another block was broken in silence",
    "broken, point was past": "the same, where that point asks for a time before the block began",
    "inexact": "a constraint was off by more than 10 ms, though not noticeably, and the body is exact",
    "wrong length": "a wait did not take its time",
    "left too early": "a look, a face or a posture did not last",
    "out of turn": "a behavior of which nothing is said began before the one before it had ended",
    "pointless": "a stroke, or an arrival on target, was told without its motion",
    "unmade end of a stroke": "the end of a stroke was told without motion since the stroke",
    "parts": "two behaviors had one part at one time",
    "in the air": "in the end the arms are not home, or something moves",
    "off its prediction": "a point came more than 10 ms off the last prediction before it, and nothing was disturbed",
    "moves though held": "what was held has begun, or has gone on speaking",
    "late for a hold": "something was late that is not, if nothing is held",
    "spoken order": "sentences came in another order than they could",
    "needless loss": "something was dropped or refused that an order of the sentences can serve",
}
"""All that can be found, with its meaning."""

CHECKS: tuple[Callable[[Case], Iterator[Finding]], ...] = (
    laws_feedback.one_end, laws_feedback.points, laws_feedback.losses, laws_feedback.words, laws_feedback.talked_over,
    laws_feedback.robbed,
    laws_time.constraints, laws_custom.customs, laws_time.predictions, laws_time.spoken_order, laws_motion.motion,
    laws_motion.parts, laws_motion.home, laws_held.held, laws_held.late,
)  # fmt: skip


def judge(story: Story, record: Record) -> list[Finding]:
    """Everything about the record of a story that is not as it must be."""
    case = Case(story, record)
    return [finding for check in CHECKS for finding in check(case)]
