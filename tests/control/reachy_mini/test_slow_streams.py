"""What a Reachy Mini does by measurements that come seldom, or by fits and starts: on loop time."""

import asyncio
import math
import re
from collections.abc import Sequence
from itertools import cycle, pairwise, repeat

import pytest

from engage_hri.schemas.behaviors import BlockBehavior, FaceLexeme, Gaze, Head, Posture
from engage_hri.services.control.contract.body import Reached
from engage_hri.services.control.reachy_mini.body import ReachyMini
from engage_hri.services.control.testing import WORLD, BodyContract, Stage, performed
from tests.control.reachy_mini.fake import PERIOD, FakeDaemon
from tests.control.reachy_mini.test_outages import GAZE, failure, robot

BUSY = (0.4, 0.001, 0.001, 0.12, 0.03, 0.2, 0.2, 0.05)
"""Of a machine with far too much work: a few measurements at once, and then none for long."""
STREAMS: dict[str, Sequence[float]] = {"a third as often": (0.07,), "just often enough": (0.14,),
    "just too seldom": (0.16,), "twice a second": (0.5,), "all but lost": (0.95,), "busy": BUSY}  # fmt: skip
FEW: Sequence[BlockBehavior] = (
    GAZE, Gaze(id="far", target="far-left"), Head(id="nods", lexeme="NOD"), FaceLexeme(id="smiles", lexeme="SMILE"),
    Posture(id="leans", lexeme="LEAN_FORWARD"),
)  # fmt: skip


@pytest.mark.parametrize("stream", STREAMS)
@pytest.mark.parametrize("behavior", FEW, ids=lambda behavior: behavior.id)
async def test_it_comes_to_its_end_late_and_says_so(stream: str, behavior: BlockBehavior) -> None:
    async with robot() as made:
        natural = sum(phase.natural for phase in made.body.estimate(behavior, None, WORLD).phases)
        made.daemon.periods = cycle(STREAMS[stream])
        before = len(made.daemon.commands)
        progress = await Stage(made.body, behavior, "end").over(60.0)

        assert [each.sync for each in progress][-1] == "end"
        times = [each.at for each in progress if isinstance(each, Reached)]
        assert times == sorted(times)
        assert times[-1] - times[0] > natural - 0.1
        assert times[-1] <= asyncio.get_running_loop().time()
        yaws = [pose["yaw"] for _, pose in made.daemon.commands[before:]]
        assert all(abs(b - a) < math.radians(18.0) for a, b in pairwise(yaws))


async def test_a_look_is_never_said_to_be_on_target_before_it_is() -> None:
    async with robot() as made:
        made.daemon.periods = cycle(BUSY)
        for target in ("near-right", "far-left"):
            stage = Stage(made.body, Gaze(id="look", target=target), "stroke_start")
            await stage.holding()
            assert stage.waits_at == ["stroke"]
            assert made.off(target) < math.radians(0.8)
            stage.authority.extend("end")
            await stage.over()


async def test_measurements_that_are_too_few_are_told_once_until_there_are_enough() -> None:
    async with robot() as made:
        made.daemon.periods = repeat(0.25)
        await asyncio.sleep(20.0)
        assert len(made.faults) == 1
        assert re.match(
            "the daemon sends [4-6].. measurements a second: the robot moves by fits", made.faults[0].reason
        )
        assert "it takes 7" in made.faults[0].advice
        assert made.faults[0].where == "reachy_mini"
        made.daemon.periods = repeat(PERIOD)
        await asyncio.sleep(5.0)
        await performed(made.body, GAZE)
        assert len(made.faults) == 1
        assert made.recoveries == ["reachy_mini: the daemon sends enough measurements again"]
        made.daemon.periods = repeat(0.25)
        await asyncio.sleep(8.0)
        assert len(made.faults) == 2


async def test_a_driver_that_had_no_time_itself_says_nothing_of_the_daemon() -> None:
    async with robot() as made:
        stage = Stage(made.body, GAZE, "end")
        await asyncio.sleep(0.3)
        asyncio.get_running_loop()._virtual_now += 3.0  # type: ignore[attr-defined]
        await stage.over()
        assert stage.passed[-1] == "end"
        assert made.faults == []


async def test_one_hiccup_is_no_slow_stream() -> None:
    async with robot() as made:
        made.daemon.periods = cycle((*(PERIOD,) * 60, 0.8))
        await asyncio.sleep(30.0)
        assert made.faults == []


async def test_a_stuck_motor_is_told_by_seldom_measurements_too() -> None:
    async with robot() as made:
        made.daemon.periods = cycle(BUSY)
        made.daemon.stuck = {"pitch"}
        fault = await failure(Stage(made.body, GAZE, "end"))
        assert fault.reason.startswith("head_pitch stands at 0.0 degrees, ")


class Busy(BodyContract):
    """The laws of truth, by measurements that come by fits and starts. What is told is told late."""

    tolerance = 1.0

    def make(self) -> ReachyMini:
        daemon = FakeDaemon()
        daemon.periods = cycle(BUSY)
        return ReachyMini(connect=daemon)


@pytest.mark.parametrize("crowd", [None, "looks", "nods", "all but nods"])
async def test_no_point_that_the_joints_do_not_bear_out(crowd: str | None) -> None:
    suite = Busy()
    async with suite.connected(suite.make) as body:
        if crowd is None:
            await suite.test_each_point_is_where_the_joints_are(body)
        else:
            await suite.test_no_sync_point_that_the_joints_do_not_bear_out(body, crowd, 1)
