"""What somebody says into the robot's turn is told at once, and once more when it is decided what it is."""

import random
from typing import NamedTuple

import pytest

from engage_hri.schemas.recognition import Interjection
from engage_hri.services.recognition.events.scene import Worded
from tests.random_cases import share_of
from tests.recognition.observations import HUMAN, ROBOT, Log

LIMIT = 0.8
"""Longest backchannel of a person whose words nobody tells."""
WAIT = 1.5
"""Time from the beginning in which words have to come, where somebody tells words."""
TURN = (1.0, 20.0)


class Said(NamedTuple):
    """A speech in the robot's turn. words: "": none come. known: seconds from its beginning to its words."""

    since: float
    lasts: float
    words: str = ""
    known: float = 0.0


def told(*speeches: Said, worded: bool, end: float = TURN[1]) -> list[tuple[float, str, float]]:
    """Each new reading: start of the speech, reading, and when it was told. worded: words came before."""
    log, changes = Log(adjacency_pair_limit=4.0), []
    if worded:
        log.begins(HUMAN, "speak", 0.1)
        log.ends(HUMAN, "speak", 0.3)
        log.feed(Worded(actor=HUMAN, since=0.1, text="good morning"), 0.4)
    steps = [
        (TURN[0], 0, lambda: log.begins(ROBOT, "speak", TURN[0], behavior="block-1:speech-1")),
        (TURN[0], 1, lambda: log.requests_event("adjacency_pair", TURN[0], turn="turn-1")),
        (end, 3, lambda: log.ends(ROBOT, "speak", end, behavior="block-1:speech-1")),
        (end, 4, lambda: log.signals("ended", end)),
    ]
    for one in speeches:
        over, heard = one.since + one.lasts, one.since + one.known
        steps.append((one.since, 2, lambda one=one: log.begins(HUMAN, "speak", one.since)))
        steps.append((over, 2, lambda over=over: log.ends(HUMAN, "speak", over)))
        if one.words:
            worded_as = Worded(actor=HUMAN, since=one.since, text=one.words)
            steps.append((heard, 3, lambda worded_as=worded_as, heard=heard: log.feed(worded_as, heard)))
    for at, _, step in sorted(steps, key=lambda each: each[:2]):
        while (due := log.session.deadline) is not None and due < at:
            seen = len(log.effects)
            log.until(due)
            changes += [(each, due) for each in log.effects[seen:]]
        seen = len(log.effects)
        step()
        changes += [(each, at) for each in log.effects[seen:]]
    readings: dict[float, str] = {}
    found = []
    for each, at in changes:
        if isinstance(each, Interjection) and readings.get(each.since.seconds) != each.reading:
            readings[each.since.seconds] = each.reading
            found.append((each.since.seconds, each.reading, round(at, 6)))
    return found


CASES = [
    ("a short one of whom nobody tells words is a backchannel at its end", Said(3.0, 0.5), False, "backchannel", 3.5),
    ("a long one of such a person interrupts at the limit", Said(3.0, 2.0), False, "interruption", 3.8),
    ("a listener's words", Said(3.0, 0.5, "uh-huh", 0.7), True, "backchannel", 3.7),
    ("a listener's words that take long", Said(3.0, 1.4, "yes yes okay", 1.2), True, "backchannel", 4.4),
    ("stop", Said(3.0, 0.4, "stop", 0.6), True, "interruption", 3.6),
    ("stop, known while it is said", Said(3.0, 0.9, "stop it now", 0.5), True, "interruption", 3.5),
    ("laughter", Said(3.0, 1.2), True, "noise", 4.5),
    ("a cough", Said(3.0, 0.4), True, "noise", 4.5),
    (
        "a long speech whose words come at its end",
        Said(3.0, 4.0, "but what about this", 4.3),
        True,
        "interruption",
        4.5,
    ),
]


@pytest.mark.parametrize(
    ("said", "worded", "reading", "at"), [each[1:] for each in CASES], ids=[each[0] for each in CASES]
)
def test_it_is_decided_once(said: Said, worded: bool, reading: str, at: float) -> None:
    assert told(said, worded=worded) == [(3.0, "open", 3.0), (3.0, reading, at)]


def test_what_goes_on_when_the_turn_is_over_is_the_answer() -> None:
    assert told(Said(19.8, 2.0), worded=False) == [(19.8, "open", 19.8), (19.8, "answer", 20.0)]


def test_a_second_one_decides_the_first() -> None:
    found = told(Said(3.0, 0.4), Said(3.6, 0.4, "stop", 0.5), worded=True)

    assert found == [(3.0, "open", 3.0), (3.6, "open", 3.6), (3.0, "noise", 3.6), (3.6, "interruption", 4.1)]


@pytest.mark.parametrize("seed", range(share_of(200)))
def test_each_is_told_open_and_then_decided_in_time(seed: int) -> None:
    chance = random.Random(seed)
    worded, at, speeches = chance.random() < 0.5, 2.0, []
    for _ in range(chance.randint(1, 4)):
        at += chance.uniform(0.05, 3.0)
        lasts = chance.uniform(0.1, 2.5)
        words = chance.choice(("", "uh-huh", "stop", "and the red one")) if worded else ""
        speeches.append(Said(round(at, 3), round(lasts, 3), words, round(lasts + chance.uniform(0.05, 1.0), 3)))
        at += lasts
    changes = told(*speeches, worded=worded)

    for one in speeches:
        own = [(reading, when) for since, reading, when in changes if since == one.since]
        assert own[0] == ("open", one.since) or own == [], "after an interruption the turn goes on with it"
        if own:
            decided = [each for each in own if each[0] != "open"]
            assert decided, one
            assert decided[0][1] <= one.since + max(one.lasts, WAIT) + 1e-6


@pytest.mark.parametrize(
    ("begins_with", "turns", "expected"),
    [
        ("bob", None, []),
        ("bob", ROBOT, [("open", 2.3), ("interruption", 2.8)]),
        ("", "bob", [("open", 2.0), ("other", 5.0)]),
        ("", None, [("open", 2.0), ("interruption", 5.0)]),
    ],
)
def test_who_looks_at_a_neighbor_does_not_hold_the_robot(
    begins_with: str, turns: str | None, expected: list[tuple[str, float]]
) -> None:
    """The robot asks ann from 1 to 5; she speaks from 2 to 7, and may turn her head at 2.3. No words are told."""
    log = Log("ann", "bob", adjacency_pair_limit=4.0)
    if begins_with:
        log.looks("ann", begins_with, 0.5)
    log.begins(ROBOT, "speak", 1.0, behavior="block-1:speech-1")
    log.requests_event("adjacency_pair", 1.0, turn="turn-1", responder="ann")
    log.begins("ann", "speak", 2.0)
    if turns is not None:
        log.looks("ann", turns, 2.3)
    log.until(5.0)
    log.ends(ROBOT, "speak", 5.0, behavior="block-1:speech-1")
    log.signals("ended", 5.0)
    log.until(7.0)
    log.ends("ann", "speak", 7.0)
    log.until(20.0)

    told = [each for each in log.effects if isinstance(each, Interjection)]
    assert [(each.reading, each.at.seconds) for each in told] == expected


@pytest.mark.parametrize("lasts", [0.6, 2.0])
@pytest.mark.parametrize(("words", "to"), [("so", "bob"), ("bob, what about the red one", "")])
def test_who_looks_at_the_robot_and_says_something_to_a_neighbor_holds_it_until_that_is_known(
    words: str, to: str, lasts: float
) -> None:
    log = Log("ann", "bob", adjacency_pair_limit=4.0)
    log.feed(Worded(actor="ann", since=0.0, text="good morning"), 0.1)
    log.looks("ann", ROBOT, 0.5)
    log.begins(ROBOT, "speak", 1.0, behavior="block-1:speech-1")
    log.requests_event("adjacency_pair", 1.0, turn="turn-1", responder="ann")
    said = Worded(actor="ann", since=3.0, text=words, to=frozenset((to,)) if to else None)
    steps = [(3.9, lambda: log.feed(said, 3.9)), (3.0 + lasts, lambda: log.ends("ann", "speak", 3.0 + lasts))]
    log.begins("ann", "speak", 3.0)
    for at, step in sorted(steps, key=lambda each: each[0]):
        log.until(at)
        step()
    log.until(20.0)

    told = [each for each in log.effects if isinstance(each, Interjection)]
    assert list(dict.fromkeys((each.reading, each.at.seconds) for each in told)) == [("open", 3.0), ("other", 3.9)]
    assert [each.named for each in log.session.scene.ended() if each.actor == "ann"] == [{"bob"}]


@pytest.mark.parametrize("goes_on", [False, True])
@pytest.mark.parametrize("to", [frozenset({"bob"}), None])
def test_stop_is_decided_as_soon_as_it_is_known_whoever_talks_beside_it(
    to: frozenset[str] | None, *, goes_on: bool
) -> None:
    """Perception may have told addressees before (`to`), and two talk with each other all the time."""
    log = Log("ann", "bob", "cy", adjacency_pair_limit=4.0)
    log.feed(Worded(actor="ann", since=0.0, text="good morning", to=to), 0.1)
    log.looks("ann", ROBOT, 0.5)
    log.looks("bob", "cy", 0.5)
    log.begins(ROBOT, "speak", 1.0, behavior="block-1:speech-1")
    log.requests_event("adjacency_pair", 1.0, turn="turn-1", responder="ann")
    log.begins("bob", "speak", 2.5)
    log.begins("ann", "speak", 3.0)
    if not goes_on:
        log.ends("ann", "speak", 3.4)
    log.feed(Worded(actor="ann", since=3.0, text="stop"), 3.5)
    log.until(3.6)

    told = [(each.reading, each.at.seconds) for each in log.effects if isinstance(each, Interjection)]
    assert told == [("open", 3.0), ("interruption", 3.5)]


def test_words_beside_the_nod_that_answers_are_of_that_answer() -> None:
    log = Log(adjacency_pair_limit=4.0)
    log.begins(ROBOT, "speak", 1.0, behavior="block-1:speech-1")
    log.requests_event("adjacency_pair", 1.0, turn="turn-1")
    log.begins(HUMAN, "nod", 2.7)
    log.begins(HUMAN, "speak", 2.8)
    log.ends(ROBOT, "speak", 3.0, behavior="block-1:speech-1")
    log.signals("ended", 3.0)
    log.ends(HUMAN, "nod", 3.2)
    log.ends(HUMAN, "speak", 4.0)
    log.feed(Worded(actor=HUMAN, since=2.8, text="yes, the red one"), 4.3)
    log.until(60.0)

    assert (log.last("ap-1").response, log.last("ap-1").words) == ("nod", "yes, the red one")
    told = [(each.since.seconds, each.reading) for each in log.effects if isinstance(each, Interjection)]
    assert list(dict.fromkeys(told)) == [(2.8, "open"), (2.8, "answer")]
