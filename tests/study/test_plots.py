"""Every plot is drawn from whatever there is; warnings are errors."""

import struct

import pytest

from engage_hri.services.study.records import EventRecord, SessionRecord
from tests.study.sessions import kind, session

NAMES = {"events.png", "delays.png", "failure_rates.png", "mtbce.png", "completion_time.png"}


def width(png: bytes) -> int:
    assert png.startswith(b"\x89PNG\r\n\x1a\n")
    return int(struct.unpack(">I", png[16:20])[0])


def events(count: int, delay: float | None) -> list[EventRecord]:
    return [
        EventRecord(
            session=number, condition="operational", kind="adjacency_pair", initiator="robot", cause="turn",
            outcome="succeeded", optional=False, start=1.0, delay=delay,
        )
        for number in range(count)
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("records", "seen"),
    [
        pytest.param([session("operational", 0, reason="died")], events(1, 1.0), id="none finished"),
        pytest.param([session("operational", 0, mtbce=5.0, completion=9.0)], events(1, None), id="one session"),
        pytest.param(
            [session(f"c{k % 4}", k, kind("adjacency_pair", 2, 1), mtbce=5.0, completion=9.0) for k in range(12)],
            events(12, 0.0), id="identical values, four conditions",
        ),
    ],
)  # fmt: skip
def test_all_plots_are_drawn(records: list[SessionRecord], seen: list[EventRecord]):
    from engage_hri.services.study.plots import draw  # here: no other worker needs matplotlib

    drawn = draw(records, seen)

    assert set(drawn) == NAMES
    assert all(width(png) > 800 for png in drawn.values())
