"""Events of the robot's turns, as far as generation knows them."""

import pytest

from engage_hri.schemas.recognition import ConnectionEvent, EventState
from engage_hri.schemas.units import Stamp
from engage_hri.services.generation.turns.outcomes import TurnEvents


def event(id: str, state: EventState, at: float = 0.0) -> ConnectionEvent:
    began = Stamp("s", at)
    return ConnectionEvent(
        id=id, kind="directed_gaze", initiator="robot", responder="human", state=state, at=began, started=began,
        block="b",
    )  # fmt: skip


@pytest.mark.parametrize(
    ("session", "states"), [("", ["lost", "lost", "failed"]), ("new", ["lost", "started", "failed"])]
)
def test_what_a_life_of_recognition_that_is_over_has_not_decided_is_lost_and_nothing_else(
    session: str, states: list[str]
) -> None:
    events = TurnEvents()
    events.expect("b", "turn")
    events.feed(event("old-1", "started", 1.0), 1.0)
    events.feed(event("new-1", "started", 2.0), 2.0)
    events.feed(event("old-2", "started", 3.0), 3.0)
    events.feed(event("old-2", "failed", 3.0), 4.0)

    events.lose(5.0, session)

    assert [each.state for each in events.of_turn("turn")] == states
