"""Payloads that hold no text, no instant or no duration are refused where they are decoded, for all who listen."""

from math import inf, nan

import msgspec
import pytest

from engage_hri.schemas.body import Estimates, SyncPointReached
from engage_hri.schemas.faults import InputRefused
from engage_hri.schemas.messages import decode
from engage_hri.schemas.units import Stamp


@pytest.mark.parametrize("form", ["json", "msgpack"])
@pytest.mark.parametrize("letter", [b"\xe9", b"\xed\xa0\x80"])
def test_text_that_is_not_utf_8_is_refused(form: str, letter: bytes) -> None:
    encode = msgspec.json.encode if form == "json" else msgspec.msgpack.encode
    mark = "x" * len(letter)
    payload = encode({"type": "cancel", "id": mark, "requester": "y"}).replace(mark.encode(), letter)

    with pytest.raises(InputRefused):
        decode(payload, f"application/{form}")


@pytest.mark.parametrize("seconds", [nan, inf, -inf])
def test_a_message_with_an_instant_that_is_none_is_refused(seconds: float) -> None:
    good = SyncPointReached(id="1", block="b", behavior="g", sync="end", at=Stamp("c", 1.0), arrived=Stamp("c", 0.5))
    payload = msgspec.msgpack.encode({**msgspec.to_builtins(good), "at": ["c", seconds]})

    with pytest.raises(InputRefused, match=r"at `\$.at\[1\]`"):
        decode(payload)


@pytest.mark.parametrize("seconds", [nan, inf, -1.0, 1e308, 86_401.0])
@pytest.mark.parametrize("field", ["shortest", "natural", "longest"])
def test_an_estimate_of_a_phase_that_takes_no_time_of_this_world_is_refused(seconds: float, field: str) -> None:
    phase = {"since": "start", "to": "end", "shortest": 1.0, "natural": 1.0, field: seconds}
    payload = msgspec.msgpack.encode(
        {"type": "estimates", "items": [{"behavior": "g", "feasible": True, "phases": [phase]}]}
    )

    with pytest.raises(InputRefused):
        decode(payload)


def test_an_estimate_of_any_length_up_to_a_day_is_taken() -> None:
    phase = {"since": "start", "to": "end", "shortest": 0.0, "natural": 86_400.0}
    payload = msgspec.msgpack.encode(
        {"type": "estimates", "items": [{"behavior": "g", "feasible": True, "phases": [phase]}]}
    )

    assert isinstance(decode(payload), Estimates)
