"""The condition of a study in the window and in the log."""

from engage_hri.schemas.fragments import StudyCondition
from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.services.console.terminal.log import Telling, line
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


HERE, AGAIN = (PeerAlive(participant="generation", run=run) for run in "12")
GONE = PeerGone(participant="generation")
UNSET, SET = StudyCondition(at=at(10.0)), StudyCondition(at=at(11.0), name="b", speech_only=True, by="Anna")
LOST = (
    "condition of the study: none, for generation has gone, and with it 'b, speech only', set by Anna: begin it again"
)


def test_a_condition_that_went_with_its_generation_is_told_as_lost_until_one_is_set() -> None:
    over = StudyCondition(at=at(12.0), by="Anna")
    lost = (HERE, UNSET, SET, GONE)
    seen = (lost, (*lost, AGAIN, UNSET), (*lost, AGAIN, UNSET, over), (*lost, HERE), (HERE, UNSET, GONE))

    pictures = [picture(*((each, 13.0) for each in messages)) for messages in seen]

    assert [section(made, "switched")["condition"] for made in pictures] == [
        LOST, LOST, "condition of the study: none, set by Anna", SET.sentence, "",
    ]  # fmt: skip
    warnings = [[note["text"] for note in section(made, "notes") if note["level"] == "warning"] for made in pictures]
    assert warnings == [[LOST], [LOST], [LOST], [LOST], []]


def test_the_log_tells_once_that_a_condition_is_lost() -> None:
    scene, told = empty("robot", 0.0), list[str]()
    for message in (HERE, SET, GONE, AGAIN, UNSET, GONE):
        before, scene = scene, feed(scene, message, 1.0)
        told += filter(None, [line(message, before, scene, 1.0, Telling())])

    assert [text.split("  ")[-1] for text in told] == [SET.sentence, f"! {LOST}"]
