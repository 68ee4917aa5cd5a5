"""A voice that is measured and known some time later gives the same events as one that is told at once.

This holds unless the robot does something within that time after a speech has begun or ended: then recognition has
taken it for earlier. Nothing waits for what a sensor has not told yet (decision 0009). And the time is at most 0.1 s:
the end of a speech is known 0.25 s later, and nothing waits longer than 0.35 s.
"""

import random

import pytest

from engage_hri.schemas.behaviors import Event, TurnSignal
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, VoiceActivity
from engage_hri.schemas.recognition import ConnectionEvent, RequestEvent, SignalTurn
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.recognizer import Perceived, Recognizer
from tests.recognition.observations import HUMAN, ROBOT, stamp, world

Speeches = list[tuple[float, float]]
LEVEL_EVERY = 0.05
UNTIL = 40.0


def drawn(chance: random.Random, *, lag: float) -> tuple[Speeches, Speeches]:
    """Speeches of a person, and of the robot, which does nothing within `lag` after the person's begin or end."""
    own: Speeches = []
    at = 1.0
    while at < UNTIL:
        lasts = chance.choice((0.2, 0.4, 0.6, 1.0, 2.0))
        own.append((round(at, 2), round(at + lasts, 2)))
        at += lasts + chance.choice((0.4, 0.6, 1.0, 3.0))
    edges = [edge for speech in own for edge in speech]

    def free(at: float) -> float:
        while any(edge - 1e-6 <= at <= edge + lag + 1e-6 for edge in edges):
            at += 0.013
        return at

    robots: Speeches = []
    at = 1.33
    while at < UNTIL:
        begins = free(at)
        ends = free(begins + 0.5 + 3.0 * chance.random())
        robots.append((begins, ends))
        at = ends + 0.3 + 5.0 * chance.random()
    return own, robots


def events(observed: list[tuple[float, float, Perceived]]) -> list[tuple[object, ...]]:
    """Events of observations, each with the time when it came and its own, but for their ids."""
    recognizer = Recognizer(ROBOT, RecognitionConfig())
    results = recognizer.feed(world(), 0.0, 0.0)
    for now, at, each in sorted(observed, key=lambda one: one[0]):
        while (due := recognizer.deadline) is not None and due < now:
            results += recognizer.advance(due)
        results += recognizer.feed(each, at, now)
    results += recognizer.advance(UNTIL + 60.0)
    told = [each for each in results if isinstance(each, ConnectionEvent)]
    return sorted(
        (
            round(each.started.seconds, 6),
            each.kind,
            each.initiator,
            each.state,
            _rounded(each.delay),
            _rounded(each.duration),
        )
        for each in told
        if not each.retold
    )


def _rounded(seconds: float | None) -> float:
    return -1000.0 if seconds is None else round(seconds, 6)


def of_robot(speeches: Speeches) -> list[tuple[float, float, Perceived]]:
    """Questions to the person."""
    told: list[tuple[float, Perceived]] = [(0.0, ActorFound(actor=HUMAN, at=stamp(0.0)))]
    for number, (begins, ends) in enumerate(speeches):
        block, turn = f"block-{number}", f"turn-{number}"
        asked = Event(id="ask", kind="adjacency_pair", responder=HUMAN, turn=turn)
        ended = TurnSignal(id="end", turn=turn, actor=HUMAN, signal="ended")
        behavior = f"{block}:speech"
        request = RequestEvent(id=f"ask-{number}", requester="realizer", block=block, at=stamp(begins), event=asked)
        signal = SignalTurn(id=f"end-{number}", requester="realizer", block=block, at=stamp(ends), signal=ended)
        told += [
            (begins, request),
            (begins, ActionBegan(actor=ROBOT, action="speak", at=stamp(begins), behavior=behavior)),
            (ends, ActionEnded(actor=ROBOT, action="speak", at=stamp(ends), behavior=behavior)),
            (ends, signal),
        ]
    return [(at, at, each) for at, each in told]


@pytest.mark.parametrize("lag", [0.0, 0.02, 0.05, 0.1])
@pytest.mark.parametrize("seed", range(8))
def test_a_voice_that_is_known_late_has_been_heard_early(seed: int, lag: float) -> None:
    own, robots = drawn(random.Random(seed), lag=lag)
    spoken: list[tuple[float, Perceived]] = []
    for begins, ends in own:
        spoken.append((begins, ActionBegan(actor=HUMAN, action="speak", at=stamp(begins))))
        spoken.append((ends, ActionEnded(actor=HUMAN, action="speak", at=stamp(ends))))
    times = [round(LEVEL_EVERY * number, 2) for number in range(10, int((UNTIL + 5.0) / LEVEL_EVERY))]
    heard = [
        (
            at + lag,
            at,
            VoiceActivity(actor=HUMAN, active=any(begins <= at < ends for begins, ends in own), at=stamp(at)),
        )
        for at in times
    ]
    told = events([*of_robot(robots), *((at, at, each) for at, each in spoken)])

    assert len(told) > 20
    assert events([*of_robot(robots), *heard]) == told
