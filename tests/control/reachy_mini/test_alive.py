"""Idle motion of a Reachy Mini: seen by people, and in nothing that counts; on loop time."""

import asyncio
import math
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from itertools import pairwise

import pytest

from engage_hri.schemas.behaviors import FaceLexeme, FaceShift, Gaze, Head, Pose, Posture
from engage_hri.services.control.bases.drivers import made
from engage_hri.services.control.config import ControlConfig
from engage_hri.services.control.contract.body import Reached
from engage_hri.services.control.reachy_mini.body import LEAN, SWAY, ReachyMini
from engage_hri.services.control.testing import WORLD, Stage, performed
from tests.control.reachy_mini.fake import HOME, FakeDaemon
from tests.control.reachy_mini.limits import too_much

ANTENNAS = ("right_antenna", "left_antenna")


@asynccontextmanager
async def living(daemon: FakeDaemon, *, alive: bool = True) -> AsyncIterator[ReachyMini]:
    body = ReachyMini(connect=daemon, alive=alive)
    body.see(WORLD)
    async with body.connected():
        yield body


def told(daemon: FakeDaemon, since: float, name: str) -> list[float]:
    return [pose[name] for at, pose in daemon.commands if at >= since]


async def test_it_breathes_and_its_antennas_sway_though_its_pose_is_still() -> None:
    daemon = FakeDaemon()
    async with living(daemon) as body:
        await asyncio.sleep(5.0)
        since = asyncio.get_running_loop().time()
        poses, shown = [], []
        for _ in range(800):
            await asyncio.sleep(0.05)
            state, added = body.state(), body.idle().added
            assert not state.moving
            poses.append([each.angle for each in state.pose.joints])
            shown.append(added.get("body_lean", 0.0))

    spread = [math.degrees(max(angles) - min(angles)) for angles in zip(*poses, strict=True)]
    assert max(spread) < 0.5  # of a sway of 5: the lag that is supposed is not quite that of the daemon
    assert max(spread[:3]) == 0.0  # the head
    assert max(shown) == pytest.approx(LEAN, rel=0.05)
    assert min(shown) == pytest.approx(-LEAN, rel=0.05)
    assert 0.002 < max(told(daemon, since, "x")) - min(told(daemon, since, "x")) < 0.004  # metres of the head
    for name in ("right", "left"):
        sways = [angle - HOME[name] for angle in told(daemon, since, name)]
        assert 0.6 * SWAY < max(map(abs, sways)) <= SWAY
    breaths = sum(before < 0.0 <= after for before, after in pairwise(told(daemon, since, "x")))
    assert breaths == pytest.approx(10, abs=1)  # 15 a minute
    assert max(map(abs, told(daemon, since, "yaw") + told(daemon, since, "pitch"))) < 1e-12
    assert too_much(daemon.commands, body.capabilities.joints) == []


async def test_off_by_the_setting_nothing_is_sent_while_nothing_is_done() -> None:
    daemon = FakeDaemon()
    async with living(daemon, alive=False) as body:
        await asyncio.sleep(5.0)
        before = len(daemon.commands)
        await asyncio.sleep(20.0)

        assert len(daemon.commands) == before
        assert body.idle().added == {}


async def test_the_setting_is_that_of_every_body() -> None:
    for alive in (True, False):
        body = made(ControlConfig(body="reachy_mini", alive=alive))
        assert isinstance(body, ReachyMini)
        assert body._idling._is_alive is alive


async def test_breath_gives_way_to_a_look_that_waits_and_antennas_to_a_face_that_waits() -> None:
    daemon = FakeDaemon()
    async with living(daemon) as body:
        await asyncio.sleep(6.3)
        look = Stage(body, Gaze(id="look", target="near-right"), "stroke_start")
        await asyncio.sleep(1.0)
        since = asyncio.get_running_loop().time()
        await asyncio.sleep(10.0)

        assert look.waits_at
        assert len(set(told(daemon, since, "x"))) <= 1
        assert len(set(told(daemon, since, "right"))) > 100
        smile = Stage(body, FaceLexeme(id="smile", lexeme="SMILE"), "stroke")
        await asyncio.sleep(1.0)
        since = asyncio.get_running_loop().time()
        await asyncio.sleep(10.0)

        assert smile.waits_at
        assert told(daemon, since, "right") == []
        assert not body.idle().added
        for stage in (look, smile):
            stage.authority.extend("end")
            await stage.over()
        await asyncio.sleep(4.0)
        assert body.idle().added


async def test_estimates_and_points_are_the_same_with_it_and_without() -> None:
    """Poses to a rounding; times to a measurement, which may come before or after the instant."""
    stories = []
    for alive in (True, False):
        async with living(FakeDaemon(), alive=alive) as body:
            await asyncio.sleep(5.0)
            begin = asyncio.get_running_loop().time()
            estimates, points = [], []
            for behavior in (
                Gaze(id="look", target="near-right"), Head(id="nod", lexeme="NOD"),
                Posture(id="lean", lexeme="LEAN_FORWARD"), FaceShift(id="grin", lexeme="SMILE"),
                Gaze(id="far", target="far-left"),
            ):  # fmt: skip
                estimates.append(body.estimate(behavior, None, WORLD))
                points += [each for each in await performed(body, behavior) if isinstance(each, Reached)]
                await asyncio.sleep(1.7)
            stories.append((estimates, [(each.sync, each.at - begin) for each in points]))

    (estimates, points), (others, same) = stories
    assert [each.phases for each in estimates] == [each.phases for each in others]
    for one, other in zip(estimates, others, strict=True):
        for pose, still in ((one.pose_after, other.pose_after), (one.pose_end, other.pose_end)):
            if pose is not None and still is not None:
                angles = [each.angle for each in pose.joints]
                assert angles == pytest.approx([each.angle for each in still.joints], abs=1e-9)
    assert [sync for sync, _ in points] == [sync for sync, _ in same]
    assert [at for _, at in points] == pytest.approx([at for _, at in same], abs=0.05)


async def test_after_an_outage_or_a_gap_nothing_jumps() -> None:
    daemon = FakeDaemon()
    async with living(daemon) as body:
        await asyncio.sleep(6.0)
        daemon.freeze()
        await asyncio.sleep(0.7)
        daemon.thaw()
        await asyncio.sleep(4.0)
        daemon.freeze()
        await asyncio.sleep(5.0)
        daemon.thaw()
        await asyncio.sleep(6.0)
        lean = [math.asin(pose["x"] / 0.177) for _, pose in daemon.commands]
        right = [pose["right"] for at, pose in daemon.commands if at > 5.0]

        assert max(abs(b - a) for a, b in pairwise(lean[200:])) < math.radians(0.1)
        assert max(abs(b - a) for a, b in pairwise(right)) < math.radians(0.5)
        assert body.idle().added


async def test_a_lean_that_stays_leaves_room_for_what_the_joint_can_do() -> None:
    daemon = FakeDaemon()
    async with living(daemon) as body:
        await performed(body, Pose(id="lean", part="TORSO", lexeme="LEAN_FORWARD"))
        await asyncio.sleep(20.0)

        assert too_much(daemon.commands, body.capabilities.joints) == []
