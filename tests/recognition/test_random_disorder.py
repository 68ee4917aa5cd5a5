"""Observations that come twice change nothing; those of different persons may come in any order."""

import random
from collections import Counter
from contextlib import ExitStack
from types import ModuleType
from typing import Any
from unittest import mock

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, ActorLost
from engage_hri.schemas.recognition import ConnectionEvent, RequestEvent, SignalTurn
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.events import exchange, gazes, person, presence, session
from engage_hri.services.recognition.events.machine import Effect
from engage_hri.services.recognition.events.session import Observation, Session
from tests.random_cases import share_of
from tests.recognition.observations import ROBOT, world
from tests.recognition.test_random_streams import Chance, Stream, streams

PEOPLE = ("ann", "bob")
CELL = 0.04
"""Within this from each full second things happen, and come in whatever order."""
CONFIG = RecognitionConfig(manipulation_limit=8.3, adjacency_pair_limit=4.3, third_turn_limit=1.83)
TIMES: dict[ModuleType, dict[str, Any]] = {
    presence: {"FACE_GRACE": 2.3},
    exchange: {"TURN_PATIENCE": 12.3},
    session: {"TURN_PATIENCE": 12.3},
    gazes: {"AFTER_ROBOT_DIRECTED": 2.3},
    person: {"LONGEST": {"speak": 60.3, "act": 120.3}, "LONGEST_GESTURE": 10.3},
}
"""No limit, nor the time of a lost face, is a number of full seconds: none passes between observations of a cell."""


def effects_of(stream: Stream) -> list[Effect]:
    with ExitStack() as changed:
        for module, times in TIMES.items():
            changed.enter_context(mock.patch.multiple(module, **times))
        played = Session(ROBOT, CONFIG)
        played.feed(world(*PEOPLE), 0.0)
        effects = [effect for at, observation in stream for effect in played.feed(observation, at)]
        return effects + played.advance(1e6)


def by_content(effects: list[Effect]) -> Counter[ConnectionEvent]:
    """The connection events; only their numbers depend on the order."""
    return Counter(replace(effect, id="") for effect in effects if isinstance(effect, ConnectionEvent))


@settings(max_examples=share_of(60), deadline=None)
@given(streams, st.integers(0, 99))
def test_what_comes_twice_changes_nothing(stream, seed):
    """Actions and presence also after others have come; what travels by itself on its key, at once."""
    chance = random.Random(seed)
    once = [one for index, one in enumerate(stream) if one not in stream[:index]]
    twice: Stream = []
    later: Stream = []
    for at, observation in once:
        twice.append((at, observation))
        if isinstance(observation, ActionBegan | ActionEnded | ActorFound | ActorLost):
            later.append((at, observation))
        elif not isinstance(observation, RequestEvent | SignalTurn):
            twice.append((at, observation))  # requests come through a desk that lets none pass twice
        while later and chance.random() < 0.6:
            twice.append(later.pop(chance.randrange(len(later))))

    assert effects_of(twice) == effects_of(once)


def independent(seed: int) -> tuple[Stream, Stream]:
    """The same observations in two orders: each person's own in order, those of others before or after.

    What everybody is concerned with (the robot's actions, head, blocks and turns) has cells of its own. So has who
    leaves or comes back: to whom others speak depends on who is there.
    """
    chance = Chance(random.Random(seed).choice)
    one: Stream = []
    other: Stream = []
    lost: set[str] = set()
    for second in range(40):
        cell = [(second + number * CELL / 8, chance.observation(second + number * CELL / 8)) for number in range(8)]
        cell = [(at, _own(it)) for at, it in cell]
        whose = {person: [it for it in cell if concerns(it[1]) == person] for person in PEOPLE}
        common = [it for it in cell if concerns(it[1]) == ""]
        if any(isinstance(it, ActorLost) or concerns(it) in lost for _, it in cell):
            one += cell
            other += cell
            for _, it in cell:
                (lost.add if isinstance(it, ActorLost) else lost.discard)(concerns(it))
        elif common and chance.pick((True, False)):
            one += common
            other += common
        else:
            for stream in (one, other):
                queues = {person: list(own) for person, own in whose.items() if own}
                while queues:
                    person = chance.pick(tuple(queues))
                    stream.append(queues[person].pop(0))
                    queues = {name: left for name, left in queues.items() if left}
    return one, other


def _own(observation: Observation) -> Observation:
    """No two persons' requests have the same id: the later of two such is taken for a repetition."""
    if isinstance(observation, RequestEvent):
        return replace(observation, id=f"{observation.id} {observation.event.responder}")
    return observation


def concerns(observation: Observation) -> str:
    """The only person that it is about; empty: all."""
    match observation:
        case ActionBegan(actor=actor) | ActionEnded(actor=actor) | ActorFound(actor=actor) | ActorLost(actor=actor):
            return actor if actor != ROBOT else ""
        case RequestEvent(event=event):
            return event.responder
    return ""


FIRST_COME = {50}
"""Streams in which it matters who is told first: two act while a question waits for either."""


@pytest.mark.parametrize("seed", [seed for seed in range(share_of(100)) if seed not in FIRST_COME])
def test_what_different_persons_do_may_come_in_any_order_unless_a_limit_passes_between(seed: int) -> None:
    one, other = independent(seed)

    assert by_content(effects_of(one)) == by_content(effects_of(other))
