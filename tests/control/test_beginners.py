"""Drivers with the mistakes that beginners make, and the words in which the contract tells them of it."""

import asyncio
import math
from collections.abc import Callable
from select import select

import pytest

from engage_hri.services.control.testing.check import check
from engage_hri.services.control.testing.report import BodyReport, Stated
from tests.control.test_docs import driver

Angles = dict[str, float]
PanTilt = driver().PanTilt


class WrongSign(PanTilt):  # type: ignore[misc]
    """One motor turns the other way than it is told to."""

    def go(self, goal: Angles, seconds: float) -> None:
        super().go({**goal, "pan": -goal["pan"]}, seconds)


class Degrees(PanTilt):  # type: ignore[misc]
    """Its SDK measures degrees."""

    def angles(self) -> Angles:
        return {joint: math.degrees(angle) for joint, angle in super().angles().items()}


class Stale(PanTilt):  # type: ignore[misc]
    """Its SDK tells angles four times a second."""

    read, last = -1.0, {"pan": 0.0, "tilt": 0.0}

    def angles(self) -> Angles:
        if (now := asyncio.get_running_loop().time()) - self.read >= 0.25:
            self.read, self.last = now, super().angles()
        return dict(self.last)


class Blocking(PanTilt):  # type: ignore[misc]
    """Its SDK blocks for each command."""

    def go(self, goal: Angles, seconds: float) -> None:
        select([], [], [], 0.04)  # seconds in which nothing comes, as on a port
        super().go(goal, seconds)


def checked(make: Callable[[], object], law: str) -> BodyReport:
    return check(make, Stated(tolerance=0.15, noise=0.0, accuracy=0.02), driver="mine", law=law)  # type: ignore[arg-type]


def test_a_motor_that_turns_the_other_way_is_told_so() -> None:
    report = checked(WrongSign, "on target")

    assert not report.is_good
    assert all("pan stands" in cause.what for cause in report.causes)
    assert all(cause.what.endswith("and has turned the other way") for cause in report.causes)


def test_degrees_are_asked_about_once() -> None:
    report = checked(Degrees, "")

    (cause,) = report.causes
    assert cause.what.startswith("degrees or radians? pan was read at ")
    assert cause.what.endswith(" degrees, and it goes from -85.9 degrees to 85.9 degrees")
    assert len(cause.laws) > 40
    assert not report.of("holds")
    assert report.seconds < 60.0


def test_readings_that_are_old_are_no_jumps() -> None:
    report = checked(Stale, "keeps its limits")

    (law,) = report.of("broken")
    assert {finding.measured for finding in law.findings} == {"each comes again for 252 ms"}
    assert {finding.cause for finding in law.findings} == {"the readings of its joints are old"}


@pytest.mark.parametrize(("driver", "verdict"), [(PanTilt, "holds"), (Blocking, "broken")])
def test_a_driver_that_blocks_is_told_what_to_do(driver: Callable[[], object], verdict: str) -> None:
    (law,) = checked(driver, "loop free").laws

    assert law.verdict == verdict
    assert "await asyncio.to_thread(...)" in law.usually
    assert all("it waits" in finding.advice for finding in law.findings)
