"""People measured and reported at once, late, double and with gaps: every event ends exactly once."""

from random import Random

from hypothesis import given, settings
from hypothesis import strategies as st

from engage_hri.schemas.perception import ActorFound, ActorLost
from engage_hri.schemas.recognition import ENDINGS, ConnectionEvent, EventOutcome, SignalTurn
from engage_hri.schemas.requests import Accepted, Refused
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.events.machine import DECISIONS
from engage_hri.services.recognition.recognizer import Recognizer
from engage_hri.services.reports.action_reports import FACE_GRACE
from tests.recognition.observations import ROBOT, stamp
from tests.recognition.raw import EYES, PLACES, face, hand, pose, table, voice
from tests.recognition.test_random_streams import ACTORS, Chance

EYES_OF = {"ann": EYES, "bob": (1.3, 0.6, 1.2)}


def stream(seed, length):
    """(arrival, time, observation)"""
    random, arrivals, at = Random(seed), [], 1.0
    others = Chance(random.choice)
    target = dict.fromkeys(ACTORS, "table")
    for _ in range(length):
        at += random.choice((0.03, 0.03, 0.03, 0.1, 0.1, 0.6))
        actor = random.choice(ACTORS)
        if random.random() < 0.2:
            target[actor] = random.choice((*PLACES, ROBOT, "table", ""))
        kind = random.random()
        if kind < 0.5:
            one = pose(target[actor], at, actor=actor, eyes=EYES_OF[actor], confidence=random.choice((1.0, 0.9, 0.3)))
        elif kind < 0.75:
            one = voice(random.random() < 0.7, at, actor=actor)
        elif kind < 0.85:
            place = (random.uniform(0.4, 0.8), -0.2, 0.7)
            one = table(*map(face, ACTORS), hand((*place[:2], 0.73), owner=actor), blue=place)
        else:
            one = others.observation(at)
        late = random.choice((0.0, 0.0, 0.0, 0.05, 0.4, 1.0))
        arrivals += [(at + late, at, one)] * random.choice((0, 1, 1, 1, 2))
    return sorted(arrivals, key=lambda arrival: arrival[0])


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 200))
def test_every_event_ends_once_and_every_request_is_answered(seed, length):
    recognizer = Recognizer(ROBOT, RecognitionConfig())
    results, asked = recognizer.feed(table(*map(face, ACTORS)), 0.0, 0.0), []
    for arrival, at, one in stream(seed, length):
        while (due := recognizer.deadline) is not None and due < arrival:
            results += recognizer.advance(due)
            assert recognizer.deadline is None or recognizer.deadline > due, "something was done"
        if hasattr(one, "event") or isinstance(one, SignalTurn):
            if one.id in asked:
                continue
            asked.append(one.id)
        results += recognizer.feed(one, at, arrival)
    for at in (1000.0, 1001.0):
        for actor in ACTORS:
            results += recognizer.advance(at)
            kind = ActorFound if at == 1000.0 else ActorLost
            results += recognizer.feed(kind(actor=actor, at=stamp(at)), at, at)
    results += recognizer.advance(1001.0 + FACE_GRACE + 1.0)

    lives: dict[str, list[str]] = {}
    for event in results:
        if isinstance(event, ConnectionEvent) and not event.retold:
            lives.setdefault(event.id, []).append(event.state)
    for states in lives.values():
        assert states[0] == "started"
        assert sum(state in DECISIONS for state in states) == 1
        assert [state in ENDINGS for state in states] == [False] * (len(states) - 1) + [True]
    accepted = [one.id for one in results if isinstance(one, Accepted)]
    refused = [one.id for one in results if isinstance(one, Refused)]
    outcomes = [one.id for one in results if isinstance(one, EventOutcome)]
    assert sorted(accepted + refused) == sorted(id for id in asked if id.startswith("request"))
    assert sorted(outcomes) == sorted(accepted)
    assert recognizer.deadline is None
