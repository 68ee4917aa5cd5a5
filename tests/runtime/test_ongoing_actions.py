"""The states that follow from events, as reporters publish them."""

import random

from hypothesis import given
from hypothesis import strategies as st

from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, ActorLost, OngoingActions
from engage_hri.schemas.units import Stamp
from engage_hri.services.bus.deadlines import FORGOTTEN_AFTER
from engage_hri.services.reports.ongoing_actions import MOST, ActionEvent, OngoingActionTracker
from tests.ongoing import going_on, is_seen


def stamp(at: float, clock: str = "loop") -> Stamp:
    return Stamp(clock, at)


def event(chance: random.Random, at: float) -> ActionEvent:
    actor, pick = chance.choice(("ann", "bob")), chance.choice
    kind = pick((ActionBegan, ActionBegan, ActionEnded, ActionEnded, ActorFound, ActorLost))
    if kind in (ActorFound, ActorLost):
        return kind(actor=actor, at=stamp(at))
    targets = pick(((), ("cup",), ("robot",)))
    action = pick(("look", "look", "speak", "point"))
    return kind(actor=actor, action=action, at=stamp(at), targets=targets, behavior=pick(("", "b:s")))


@given(st.integers(0, 10**6), st.integers(1, 40))
def test_a_state_is_what_no_later_event_has_ended(seed: int, length: int):
    chance, tracker = random.Random(seed), OngoingActionTracker()
    told: list[ActionEvent] = []
    for number in range(length):
        now = [event(chance, float(number)) for _ in range(chance.randint(1, 3))]
        told += now
        states = tracker.feed(now, stamp(number))

        assert {state.actor for state in states} == {one.actor for one in now}
        for state in states:
            assert state.actions == going_on(told, state.actor)
            assert state.seen == is_seen(told, state.actor)


def test_a_state_is_not_older_than_the_event_before_it():
    tracker = OngoingActionTracker()
    speech = ActionBegan(actor="ann", action="speak", at=stamp(2.5))
    of_another_clock = ActionBegan(actor="bob", action="speak", at=stamp(99.0, "camera"))

    assert tracker.feed([speech, of_another_clock], stamp(2.0)) == [
        OngoingActions(actor="ann", at=stamp(2.5), actions=(speech,)),
        OngoingActions(actor="bob", at=stamp(2.0), actions=(of_another_clock,)),
    ]


def test_messages_of_other_kinds_change_nothing():
    assert OngoingActionTracker().feed([OngoingActions(actor="ann", at=stamp(1.0))], stamp(1.0)) == []


def test_who_is_gone_for_long_is_forgotten_but_not_whoever_is_seen_or_does_something():
    tracker = OngoingActionTracker()
    speech = ActionBegan(actor="carl", action="speak", at=stamp(0.0))
    tracker.feed([ActorFound(actor=name, at=stamp(0.0)) for name in ("ann", "bob")], stamp(0.0))
    tracker.feed([speech, ActorLost(actor="ann", at=stamp(1.0))], stamp(1.0))

    assert tracker.forget(0.9 + FORGOTTEN_AFTER) == []
    assert tracker.forget(1.0 + FORGOTTEN_AFTER) == ["ann"]
    assert tracker.forget(1e6) == []


def test_who_comes_back_is_not_forgotten():
    tracker = OngoingActionTracker()
    for at, kind in enumerate((ActorFound, ActorLost, ActorFound)):
        tracker.feed([kind(actor="ann", at=stamp(at))], stamp(at))

    assert tracker.forget(1e6) == []


def test_an_actor_does_no_more_than_so_many_things_at_once():
    tracker = OngoingActionTracker()
    points = [ActionBegan(actor="ann", action="point", at=stamp(0.0), targets=(f"t{n}",)) for n in range(MOST + 2)]

    [state] = tracker.feed(points, stamp(1.0))

    assert state.actions == tuple(points[2:])
