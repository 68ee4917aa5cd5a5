"""Certificates of running processes: their end is told ahead, on a clock that jumps."""

import asyncio

import pytest

from engage_hri.schemas.units import A_DAY, span
from engage_hri.services.bus.keyring import REMEDY, Expiry
from engage_hri.services.runtime.virtual_time import run_virtual

BEGAN = 1_700_000_000.0
NAME = "robot/control/control"
EXPIRED = f"the certificate of {NAME} has expired: its links end, and it gets no new ones; {REMEDY}"


def expires(left: str) -> str:
    return f"the certificate of {NAME} expires in {left}, and its links end then; {REMEDY}"


def told(days: float, *, left: float, set_forward: float = 0.0) -> list[tuple[float, str]]:
    """What a process tells in so many days, with the day on which it does.

    left: days to the end of its certificate. set_forward: days by which its wall clock is set forward after a day.
    """

    async def run() -> None:
        loop = asyncio.get_running_loop()

        def wall() -> float:
            return BEGAN + loop.time() + (set_forward * A_DAY if loop.time() > A_DAY else 0.0)

        alarm = Expiry(NAME, BEGAN + left * A_DAY, lambda line: lines.append((loop.time() / A_DAY, line)), wall)
        await asyncio.sleep(days * A_DAY)
        alarm.close()

    lines: list[tuple[float, str]] = []
    run_virtual(run())
    return lines


def test_the_end_is_told_30_days_7_days_and_a_day_ahead_and_as_it_comes() -> None:
    lines = told(400, left=365)

    assert [line for _, line in lines] == [expires("30 days"), expires("7 days"), expires("24 hours"), EXPIRED]
    assert [day for day, _ in lines] == pytest.approx([335, 358, 364, 365], abs=1e-6)


def test_it_is_told_at_its_instant_and_not_at_the_next_full_hour() -> None:
    minute = 1 / 24 / 60

    assert [day for day, _ in told(10, left=8 + minute)] == pytest.approx([0, 1 + minute, 7 + minute, 8 + minute])


def test_a_process_that_starts_late_tells_it_at_once_and_then_as_others_do() -> None:
    assert told(10, left=5) == [(0.0, expires("5 days")), (4.0, expires("24 hours")), (5.0, EXPIRED)]


def test_a_clock_that_is_set_is_believed_within_an_hour() -> None:
    (day, line), *rest = told(10, left=50, set_forward=45)

    assert line == expires("3 days")
    assert 1.0 <= day <= 1.0 + 1 / 24 + 1e-6
    assert [line for _, line in rest] == [expires("24 hours"), EXPIRED]


def test_nothing_is_told_of_an_end_that_is_far() -> None:
    assert told(300, left=365) == []


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (30 * A_DAY, "30 days"),
        (3 * A_DAY - 100, "3 days"),
        (A_DAY, "24 hours"),
        (7000, "117 minutes"),
        (20, "a minute"),
    ],
)
def test_times_are_written_in_days_hours_or_minutes(seconds: float, text: str) -> None:
    assert span(seconds) == text
