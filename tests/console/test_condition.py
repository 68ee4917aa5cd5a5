"""The condition of a study in the window and in the log."""

from engage_hri.schemas.conditions import StudyCondition
from engage_hri.services.console.log import Telling, line
from engage_hri.services.console.view import empty, feed
from tests.console.scenes import at
from tests.console.test_picture import picture, section


def test_a_condition_is_told_once_somebody_has_set_it() -> None:
    unset, told = StudyCondition(at=at(10.0)), StudyCondition(at=at(11.0), name="b", speech_only=True, by="Anna")
    over = StudyCondition(at=at(12.0), by="Anna")

    found = [section(picture(*((each, 13.0) for each in seen)), "switched")["condition"]
             for seen in ((), (unset,), (unset, told), (unset, told, over))]  # fmt: skip

    assert found == [
        "", "", "condition of the study: b, speech only, set by Anna", "condition of the study: none, set by Anna",
    ]  # fmt: skip


def test_the_log_and_the_terminal_tell_it_but_not_what_nobody_has_set() -> None:
    before = empty("robot", 0.0)
    unset, told = StudyCondition(at=at(0.0)), StudyCondition(at=at(1.0), name="b", speech_only=True, by="Anna")

    assert line(unset, before, feed(before, unset, 0.0), 0.0, Telling()) is None
    after = feed(before, told, 1.0)
    words = line(told, before, after, 1.0, Telling())
    assert words is not None
    assert words.endswith("condition of the study: b, speech only, set by Anna")
    over = line(unset, after, feed(after, unset, 2.0), 2.0, Telling())
    assert over is not None
    assert over.endswith("condition of the study: none")
