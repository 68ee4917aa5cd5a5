"""The robot asks several people at once: whoever answers first has answered for all."""

import random

import pytest

from engage_hri.schemas.behaviors import TurnSignal
from engage_hri.schemas.recognition import ConnectionEvent, Interjection, SignalTurn
from engage_hri.services.recognition.events.scene import Worded
from engage_hri.services.recognition.statistics.tally import EventTally
from tests.random_cases import share_of
from tests.recognition.observations import ROBOT, Log, request_event, stamp

PEOPLE = ("ann", "bob", "cy", "dan")
LIMIT = 4.0
ASKS, OVER = 2.0, 4.0
"""When the robot begins to ask, and when its turn is over."""


def lives(events: list[ConnectionEvent]) -> dict[str, list[ConnectionEvent]]:
    """The robot's pairs, by who was asked."""
    found: dict[str, list[ConnectionEvent]] = {}
    for each in events:
        if each.kind == "adjacency_pair" and each.initiator == ROBOT:
            found.setdefault(each.responder, []).append(each)
    return found


def asked(people: tuple[str, ...], speeches: list[tuple[float, float, str]]) -> list[ConnectionEvent]:
    """Ask these people; others, and they, say this to the robot: from when, until when, and who."""
    log = Log(*PEOPLE, adjacency_pair_limit=LIMIT)
    over = TurnSignal(id="over", turn="t", signal="ended")
    steps = [(ASKS, 1, lambda: log.begins(ROBOT, "speak", ASKS, behavior="t:s"))]
    for one in people:
        request = request_event("adjacency_pair", ASKS, request=f"t/{one}", block="t", turn="t", responder=one)
        steps.append((ASKS, 0, lambda request=request: log.feed(request, ASKS)))
    steps.append((OVER, 3, lambda: log.ends(ROBOT, "speak", OVER, behavior="t:s")))
    ended = SignalTurn(id="over", requester="realizer", signal=over, at=stamp(OVER), block="t")
    steps.append((OVER, 4, lambda: log.feed(ended, OVER)))
    for since, until, who in speeches:
        to = Worded(actor=who, since=since, text="", to=frozenset((ROBOT,)))
        steps.append((since, 5, lambda to=to, since=since: log.feed(to, since)))
        steps.append((since, 6, lambda who=who, since=since: log.begins(who, "speak", since)))
        steps.append((until, 2, lambda who=who, until=until: log.ends(who, "speak", until)))
    for at, _, step in sorted(steps, key=lambda each: each[:2]):
        log.until(at - 1e-6)
        step()
    log.until(100.0)
    return log.events


@pytest.mark.parametrize("seed", range(share_of(200)))
def test_the_first_answer_is_that_of_all(seed: int) -> None:
    chance = random.Random(seed)
    people = tuple(chance.sample(PEOPLE, chance.randint(2, 4)))
    speeches, at = [], OVER
    for _ in range(chance.randint(0, 3)):
        at = round(at + chance.uniform(0.1, 3.0), 3)
        until = round(at + chance.uniform(0.1, 1.5), 3)
        speeches.append((at, until, chance.choice(PEOPLE)))
        at = until
    pairs = lives(asked(people, speeches))
    answers = [(since, who) for since, _, who in speeches if since <= OVER + LIMIT]

    assert {*pairs} == {*people}
    for asked_one, life in pairs.items():
        assert life[0].state == "started"
        if not answers:
            assert [each.state for each in life if not each.retold] == ["started", "failed"]
            continue
        first, by = answers[0]
        decided = life[1]
        assert (decided.answered_by, decided.response) == (by, "speak")
        assert decided.delay == pytest.approx(first - OVER)
        assert decided.state == ("succeeded" if by in people else "preempted")
        assert life[-1].state == ("completed" if by in people else "preempted")
        assert (asked_one == by) == (life[-1].duration is not None)


@pytest.mark.parametrize("seed", range(share_of(50)))
def test_of_several_answers_into_the_turn_the_first_is_that_of_who_is_silent(seed: int) -> None:
    chance = random.Random(seed)
    silent, *speak = chance.sample(PEOPLE, chance.randint(3, 4))
    speeches = [(round(OVER - chance.uniform(0.1, 0.7), 3), OVER + 0.5, who) for who in speak]
    people = tuple(chance.sample((silent, *speak), len(speak) + 1))
    decided = {who: life[1] for who, life in lives(asked(people, sorted(speeches))).items()}

    assert {who: decided[who].answered_by for who in speak} == {who: who for who in speak}
    first, _, by = min(speeches)
    assert decided[silent].answered_by == by
    assert decided[silent].delay == pytest.approx(first - OVER)


def test_who_is_announced_after_the_first_word_is_addressed_too() -> None:
    log = Log("ann", "bob", adjacency_pair_limit=LIMIT)
    for number, one in enumerate(("ann", "bob")):
        request = request_event("adjacency_pair", ASKS, request=f"t/{one}", block="t", turn="t", responder=one)
        log.feed(request, ASKS)
        if number == 0:
            log.begins(ROBOT, "speak", ASKS, behavior="t:s")
    said_to = log.session.scene.robot_spoken
    assert said_to is not None
    assert said_to.to == {"ann", "bob"}
    log.looks("bob", ROBOT, 2.2)
    log.begins("bob", "speak", 2.5)

    assert [(each.actor, each.reading) for each in log.effects if isinstance(each, Interjection)] == [("bob", "open")]


def test_only_who_answers_has_succeeded_in_the_statistics() -> None:
    tally = {who: EventTally(120.0) for who in ("ann", "bob")}
    for event in asked(("ann", "bob"), [(5.0, 6.0, "bob")]):
        tally[event.person(ROBOT)].feed(event)

    counts = {who: next(k for k in each.session().kinds if k.kind == "adjacency_pair") for who, each in tally.items()}
    assert [(each.count, each.succeeded, each.failed) for each in counts.values()] == [(1, 0, 0), (1, 1, 0)]
