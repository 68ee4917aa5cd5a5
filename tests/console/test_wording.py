"""Words for single facts."""

import pytest

from engage_hri.schemas.recognition import ConnectionEvent, EventState
from engage_hri.schemas.units import Stamp
from engage_hri.services.console.wording import decision


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (0.0, "succeeded 0.42 s"),
        (0.004, "succeeded 0.42 s"),
        (0.04, "succeeded 0.42 s ± 0.04 s"),
        (None, "succeeded 0.42 s (clocks not measured yet)"),
    ],
)
def test_a_delay_is_told_with_the_error_that_can_be_seen(error: float | None, words: str) -> None:
    at = Stamp("loop", 1.0)
    event = ConnectionEvent(
        id="1", kind="directed_gaze", initiator="robot", responder="human", state="succeeded", at=at, started=at,
        delay=0.42, delay_error=error,
    )  # fmt: skip
    assert decision(event) == words


@pytest.mark.parametrize(
    ("state", "optional", "words"),
    [("failed", True, "failed (optional)"), ("failed", False, "failed"), ("succeeded", True, "succeeded")],
)
def test_of_an_optional_event_a_failure_is_told_as_none(state: EventState, optional: bool, words: str) -> None:
    at = Stamp("loop", 1.0)
    event = ConnectionEvent(
        id="1", kind="mutual_facial_gaze", initiator="robot", responder="human", state=state, at=at, started=at,
        optional=optional,
    )  # fmt: skip
    assert decision(event) == words
