"""The scripted person: what they do, on which word, and after how long."""

import pytest

from engage_hri.schemas.blocks import BlockProgress
from engage_hri.schemas.body import WordSpoken
from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import ActionBegan
from engage_hri.schemas.units import Stamp
from engage_hri.services.client.people.actions import speaking_time
from engage_hri.services.simulation.human import (
    FACE,
    Begun,
    Ended,
    Human,
    LookAt,
    Pause,
    RobotDoes,
    Rule,
    Start,
    Stop,
    Word,
    speech,
)
from engage_hri.services.tangram.people.appendix_b import rules

AT = Stamp("loop", 0.0)


def begins(block: str) -> Message:
    return BlockProgress(block=block, progress="start", at=AT)


def ends(block: str) -> Message:
    return BlockProgress(block=block, progress="end", status="done", at=AT)


def says(block: str, word: str) -> Message:
    return WordSpoken(block=block, behavior="speech-1", word=word, position=0, at=AT)


def looks(target: str) -> Message:
    return ActionBegan(actor="robot", action="look", targets=(target,), at=AT)


@pytest.mark.parametrize(
    ("when", "seen"),
    [
        (Begun(), begins("step-3")),
        (Ended(), ends("step-3")),
        (Word("see"), says("step-3", "see,")),
        (Word("okay"), says("step-3", "“Okay,")),
        (RobotDoes("look", "table"), looks("table")),
    ],
)
def test_a_rule_fires_its_delay_after_what_it_waits_for(when: object, seen: Message) -> None:
    human = Human([Rule("step-3", when, (LookAt("table"),), 0.25)])  # type: ignore[arg-type]
    human.feed(begins("step-3"), 0.0)

    human.feed(seen, 7.0) if when != Begun() else None

    assert human.deadline == (0.25 if when == Begun() else 7.25)


def test_a_rule_fires_once() -> None:
    human = Human([Rule("step-3", Word("the"), (LookAt("table"),))])

    human.feed(says("step-3", "the"), 1.0)
    assert human.due(1.0) == (LookAt("table"),)
    human.feed(says("step-3", "the"), 2.0)

    assert human.deadline is None


def test_the_second_that_is_another_word_than_the_first() -> None:
    human = Human([Rule("step-18", Word("that", nth=2), (LookAt(FACE),))])

    human.feed(says("step-18", "that"), 1.0)
    assert human.deadline is None
    human.feed(says("step-18", "that"), 2.0)

    assert human.deadline == 2.0


def test_words_of_another_step_are_for_another_rule() -> None:
    human = Human([Rule("step-3", Word("and"), (LookAt("rectangle"),))])

    human.feed(says("step-4", "and"), 1.0)

    assert human.deadline is None


def test_acts_that_follow_wait_until_they_are_handed_back() -> None:
    human = Human([Rule("step-3", Ended(), (Pause(1.0), LookAt("table")))])
    human.feed(ends("step-3"), 1.0)

    first, *then = human.due(1.0)
    human.schedule(tuple(then), 2.0)

    assert first == Pause(1.0)
    assert human.due(1.9) == ()
    assert human.due(2.0) == (LookAt("table"),)


def test_reaction_times_vary_but_nobody_reacts_before_the_cause() -> None:
    human = Human([Rule("step-3", Ended(), (LookAt("table"),), 0.01)], vary=lambda: -0.5)

    human.feed(ends("step-3"), 3.0)

    assert human.deadline == 3.0


def test_the_robots_looks_count_for_the_step_in_progress_whatever_block_they_belong_to() -> None:
    human = Human([Rule("step-20-a", RobotDoes("look", "table"), (LookAt("table"),))])
    human.feed(begins("step-20-a"), 0.0)
    human.feed(begins("maintenance-7"), 0.1)

    human.feed(looks("table"), 1.0)

    assert human.deadline == 1.0


def test_every_step_of_appendix_b_in_which_the_person_acts_has_rules() -> None:
    written = {rule.step for rule in rules()}

    assert {"step-1", "step-3", "step-4", "step-5", "step-18", "step-20-a", "step-20-b", "step-21"} <= written
    assert {"step-23-a", "step-24", "step-25"} <= written
    assert "step-2" not in written


@pytest.mark.parametrize(("given", "seconds"), [(None, speaking_time("Yes, the cup.")), (2.5, 2.5)])
def test_words_take_as_long_as_such_words_do_unless_another_time_is_given(
    given: float | None, seconds: float
) -> None:
    acts = speech("Yes, the cup.", given)

    begin, pause, end = acts[:3]
    assert (begin, pause, end) == (Start("speak", words="Yes, the cup."), Pause(seconds), Stop("speak"))
