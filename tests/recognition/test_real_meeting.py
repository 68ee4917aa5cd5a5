"""A quarter of an hour of a real meeting of four, one of them played as the robot; people talk over each other.

`real_meeting.csv`: beginning, end, person; of speech in the AMI Meeting Corpus (CC BY 4.0), by its public diarization
annotation. To whom each speech is, is drawn at random, and told by perception: two of three are for somebody else.
"""

import csv
import random
from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

from engage_hri.schemas.behaviors import TurnSignal
from engage_hri.schemas.recognition import ConnectionEvent, SignalTurn
from engage_hri.services.recognition.events.scene import Worded
from tests.recognition.observations import ROBOT, Log, request_event, stamp

Speech = tuple[float, float, str, str]
"""Beginning, end, who, and to whom."""


Step = tuple[float, int, Callable[[], object]]


@cache
def speech(seed: int) -> tuple[Speech, ...]:
    """All that is said. One of the four is the robot."""
    chance = random.Random(seed)
    rows = csv.reader(Path(__file__).with_name("real_meeting.csv").read_text().splitlines())
    said = [(float(began), float(ended), name) for began, ended, name in rows]
    robot = chance.choice("ABCD")
    names = {name: ROBOT if name == robot else name for name in "ABCD"}
    found, over = [], dict.fromkeys("ABCD", 0.0)
    for began, ended, name in sorted(said):
        since = max(began, over[name] + 0.01)  # of one person the corpus has pieces that overlap by a hair
        if ended - since < 0.1:
            continue
        over[name] = ended
        others = [each for each in names.values() if each != names[name]]
        others += [each for each in others if each != ROBOT]
        found.append((since, ended, names[name], chance.choice(others)))
    return tuple(found)


def told(seed: int, *, early: bool) -> list[ConnectionEvent]:
    """All changes. early: perception tells addressees when the speech begins, not with the words."""
    log = Log("A", "B", "C", "D", adjacency_pair_limit=4.0)
    steps: list[Step] = []
    for number, (began, ended, who, to) in enumerate(speech(seed)):
        if who == ROBOT:
            steps += _turn(log, number, began, ended, to)
            continue
        known = began + 0.05 if early else ended + 0.3
        words = Worded(actor=who, since=began, text="" if early else "so", to=frozenset((to,)))
        steps.append((began, 0, lambda at=began, who=who: log.begins(who, "speak", at)))
        steps.append((ended, 0, lambda at=ended, who=who: log.ends(who, "speak", at)))
        steps.append((known, 0, lambda at=known, words=words: log.feed(words, at)))
    for at, _, step in sorted(steps, key=lambda each: each[:2]):
        while (due := log.session.deadline) is not None and due < at:
            log.until(due)
        step()
    log.until(10_000.0)
    return log.events


def _turn(
    log: Log, number: int, began: float, ended: float, to: str
) -> list[tuple[float, int, Callable[[], object]]]:
    block = f"block-{number}"
    asked = request_event("adjacency_pair", began, request=block, block=block, turn=block, responder=to)
    signal = TurnSignal(id="e", turn=block, signal="ended", actor=to)
    over = SignalTurn(id=f"{block}/e", requester="realizer", signal=signal, at=stamp(ended), block=block)
    return [
        (began, 0, lambda: log.feed(asked, began)),
        (began, 1, lambda: log.begins(ROBOT, "speak", began, behavior=f"{block}:s")),
        (ended, 0, lambda: log.ends(ROBOT, "speak", ended, behavior=f"{block}:s")),
        (ended, 1, lambda: log.feed(over, ended)),
    ]


@pytest.mark.parametrize("early", [True, False], ids=["told early", "told with the words"])
@pytest.mark.parametrize("seed", range(4))
def test_no_pair_with_the_robot_is_made_of_what_is_said_to_others(seed: int, *, early: bool) -> None:
    to = {(who, round(began, 3)): addressee for began, _, who, addressee in speech(seed)}
    turn_ends = {round(began, 3): ended for began, ended, who, _ in speech(seed) if who == ROBOT}
    events, own, answers = told(seed, early=early), 0, 0
    for each in events:
        if each.kind == "backchannel" and each.responder != ROBOT:
            assert to[each.responder, round(each.started.seconds, 3)] == ROBOT, each
        if each.kind != "adjacency_pair":
            continue
        if each.initiator != ROBOT and each.state == "started":
            own += 1
            assert to[each.initiator, round(each.started.seconds, 3)] == ROBOT, each
        if each.initiator == ROBOT and each.response == "speak" and each.state != "completed":
            answers += 1
            answered = turn_ends[round(each.started.seconds, 3)] + (each.delay or 0.0)
            assert to[each.answered_by or each.responder, round(answered, 3)] == ROBOT, each

    assert own >= 4
    assert answers >= 3
