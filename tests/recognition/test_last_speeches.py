"""The speeches that are told with the floor when they are over: what turns out to be a cough is never among them."""

from collections.abc import Callable

import pytest

from engage_hri.services.recognition.events.scene import Worded
from tests.recognition.observations import ROBOT, Log

Step = tuple[float, Callable[[Log], object]]
Told = tuple[str, tuple[str, ...]]
"""Who has said something, and to whom."""


def looks(who: str, face: str, at: float) -> list[Step]:
    return [(at, lambda log: log.looks(who, face, at))]


def says(who: str, at: float, lasts: float) -> list[Step]:
    return [
        (at, lambda log: log.begins(who, "speak", at)),
        (at + lasts, lambda log: log.ends(who, "speak", at + lasts)),
    ]


def words(who: str, since: float, text: str, at: float, *to: str) -> list[Step]:
    worded = Worded(actor=who, since=since, text=text, to=frozenset(to) or None)
    return [(at, lambda log: log.feed(worded, at))]


def robot_asks(who: str, at: float, lasts: float) -> list[Step]:
    return [
        (at, lambda log: log.requests_event("adjacency_pair", at, responder=who, turn="turn-1")),
        (at, lambda log: log.begins(ROBOT, "speak", at, behavior="block-1:speech-1")),
        (at + lasts, lambda log: log.ends(ROBOT, "speak", at + lasts, behavior="block-1:speech-1")),
    ]


WORDS_ARE_TOLD = words("ann", 0.0, "good morning", 0.1)


def played(*steps: list[Step], until: float) -> Log:
    """What is left of it. Checks that the floor is told again whenever its last speeches have changed."""
    log = Log("ann", "bob", "cy", adjacency_pair_limit=4.0)
    flat = sorted((step for each in steps for step in each if step[0] <= until), key=lambda step: step[0])
    before: tuple[int, list[Told]] = (0, [])
    for at, step in [*flat, (until, lambda log: None)]:
        while (due := log.session.deadline) is not None and due < at:
            log.until(due)
            before = _checked(log, before)
        step(log)
        before = _checked(log, before)
    return log


def _checked(log: Log, before: tuple[int, list[Told]]) -> tuple[int, list[Told]]:
    changes, ended = log.session.scene.floor_changes, told(log)
    assert ended == before[1] or changes > before[0], "nobody is told"
    return changes, ended


def told(log: Log) -> list[Told]:
    """What people have said, of the last speeches."""
    return [(each.actor, tuple(each.named)) for each in log.session.scene.ended() if each.actor != ROBOT]


@pytest.mark.parametrize("face", [ROBOT, "bob", ""])
@pytest.mark.parametrize("who", ["ann", "cy"])
def test_a_cough_in_the_robots_words_is_never_told(who: str, face: str) -> None:
    cough = [WORDS_ARE_TOLD, looks(who, face, 0.5) if face else [], robot_asks("ann", 1.0, 8.0), says(who, 3.0, 0.3)]

    for until in (3.4, 4.2, 4.6, 8.0, 20.0):
        assert told(played(*cough, until=until)) == []


def test_a_cough_goes_not_where_the_words_before_went() -> None:
    before = [WORDS_ARE_TOLD, says("cy", 0.2, 0.5), words("cy", 0.2, "bob, look", 0.8)]
    cough = [robot_asks("ann", 1.0, 8.0), says("cy", 3.0, 0.3)]

    assert told(played(*before, *cough, until=20.0)) == [("cy", ("bob",))]


@pytest.mark.parametrize("heard", [3.5, 6.0])
@pytest.mark.parametrize("text", ["uh-huh", "wait"])
def test_words_in_the_robots_words_are_told_as_soon_as_they_are_known(text: str, heard: float) -> None:
    said = [WORDS_ARE_TOLD, looks("ann", ROBOT, 0.5), robot_asks("ann", 1.0, 8.0), says("ann", 3.0, 0.3)]
    said += [words("ann", 3.0, text, heard)]

    assert told(played(*said, until=heard - 0.1)) == []
    assert told(played(*said, until=heard + 0.1)) == [("ann", (ROBOT,))]


def test_where_nobody_tells_words_a_sound_in_the_robots_words_is_told() -> None:
    said = [looks("ann", ROBOT, 0.5), robot_asks("ann", 1.0, 8.0), says("ann", 3.0, 0.3)]

    assert told(played(*said, until=3.4)) == [("ann", (ROBOT,))]


@pytest.mark.parametrize("face", ["bob", ""])
def test_the_first_words_of_all_are_told_to_be_for_whom_they_call(face: str) -> None:
    said = [looks("ann", face, 0.5) if face else [], says("ann", 1.0, 1.0), words("ann", 1.0, "robot, help me", 2.3)]

    assert told(played(*said, until=2.2)) == ([("ann", ("bob",))] if face else [])
    assert told(played(*said, until=2.4)) == [("ann", (ROBOT,))]


def test_words_that_come_late_and_call_nobody_change_nothing() -> None:
    said = [looks("ann", "bob", 0.5), says("ann", 1.0, 1.0), words("ann", 1.0, "help me", 2.3)]

    assert told(played(*said, until=20.0)) == [("ann", ("bob",))]
