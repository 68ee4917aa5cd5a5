"""What a Reachy Mini does when its daemon, its motors or somebody else interferes: on loop time."""

import asyncio
import math
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from itertools import pairwise

import pytest

from engage_hri.schemas.behaviors import FaceLexeme, Gaze, Head
from engage_hri.schemas.faults import Fault, RunFailed
from engage_hri.services.control.contract.body import BehaviorRefused, BodyFailed
from engage_hri.services.control.reachy_mini.body import ReachyMini
from engage_hri.services.control.reachy_mini.settings import ReachyMiniSettings
from engage_hri.services.control.testing import WORLD, Stage, performed
from engage_hri.services.control.testing.findings import aside
from engage_hri.services.control.testing.suite import ON_AXIS
from tests.control.reachy_mini.fake import HOME, FakeDaemon
from tests.control.reachy_mini.limits import too_much

GAZE = Gaze(id="look", target="near-right")


class Robot:
    """A body on a fake daemon, and the faults that it has told."""

    def __init__(self, settings: ReachyMiniSettings) -> None:
        self.daemon = FakeDaemon()
        self.body = ReachyMini(settings, self.daemon)
        self.body.see(WORLD)
        self.faults: list[Fault] = []
        self.recoveries: list[str] = []
        self.body.on_fault = self.faults.append
        self.body.on_recovery = self.recoveries.append

    def angle(self, joint: str) -> float:
        return {each.joint: each.angle for each in self.body.state().pose.joints}[joint]

    def off(self, target: str = "near-right") -> float:
        gaze, entity = self.body.state().gaze, WORLD.entity(target)
        assert gaze is not None
        assert entity is not None
        return aside(gaze, entity.position)


@asynccontextmanager
async def robot(**settings: object) -> AsyncIterator[Robot]:
    made = Robot(ReachyMiniSettings(**settings))  # type: ignore[arg-type]
    async with made.body.connected():
        yield made


async def failure(stage: Stage) -> Fault:
    with pytest.raises(BodyFailed) as failed:
        await stage.over()
    return failed.value.fault


def kill(daemon: FakeDaemon) -> None:
    daemon.kill()


def freeze(daemon: FakeDaemon) -> None:
    daemon.freeze()


def switch_off(daemon: FakeDaemon) -> None:
    daemon.mode = "disabled"


def lose_itself(daemon: FakeDaemon) -> None:
    daemon.is_upside_down = True


def talk_nonsense(daemon: FakeDaemon) -> None:
    daemon.garbage = '{"hello": 1}'


OUTAGES = {
    kill: "closed the connection", freeze: "no measurement for 1 s", switch_off: "motors are disabled",
    lose_itself: "a pose that no head can have", talk_nonsense: "no measurement",
}  # fmt: skip


def mend(daemon: FakeDaemon) -> None:
    daemon.garbage = ""
    daemon.mode = "enabled"
    daemon.thaw()
    daemon.kill()
    daemon.start()


@pytest.mark.parametrize("outage", OUTAGES)
async def test_an_outage_fails_what_is_under_way_by_name_and_once(outage):
    async with robot() as made:
        held = Stage(made.body, GAZE, "stroke_start")
        await asyncio.sleep(3.0)
        nod = Stage(made.body, Head(id="nods", lexeme="NOD", repetition=9), "end")
        await asyncio.sleep(0.5)
        began = asyncio.get_running_loop().time()
        outage(made.daemon)

        for stage in (held, nod):
            fault = await failure(stage)
            assert OUTAGES[outage] in fault.reason
            assert fault.advice
            assert fault.where in ("look", "nods")
            assert "end" not in stage.passed
        assert asyncio.get_running_loop().time() - began < 1.1
        await asyncio.sleep(20.0)
        assert [OUTAGES[outage] in fault.reason for fault in made.faults] == [True]
        assert made.recoveries == []
        assert made.faults[0].where == "reachy_mini"
        assert not made.body.estimate(GAZE, None, WORLD).feasible
        with pytest.raises(BehaviorRefused, match=OUTAGES[outage]):
            await performed(made.body, GAZE)


@pytest.mark.parametrize("outage", OUTAGES)
async def test_after_an_outage_it_goes_home_within_its_limits_and_works_again(outage):
    async with robot() as made:
        stage = Stage(made.body, GAZE, "stroke_start")
        await asyncio.sleep(3.0)
        outage(made.daemon)
        await failure(stage)
        await asyncio.sleep(5.0)
        mend(made.daemon)
        before = len(made.daemon.commands)
        await asyncio.sleep(5.0)

        assert made.body.state().moving is False
        assert abs(made.angle("head_pitch")) < 0.001
        assert made.daemon.commands[-1][1] == pytest.approx({**HOME, "x": 0.0, "y": 0.0, "z": 0.0})
        progress = await performed(made.body, GAZE)
        assert progress[-1].sync == "end"  # type: ignore[union-attr]
        assert len(made.faults) == 1
        assert made.recoveries == ["reachy_mini: it can be moved again, and goes home"]
        assert too_much(made.daemon.commands[before:], made.body.capabilities.joints) == []


async def test_a_daemon_that_was_frozen_carries_out_nothing_of_what_it_had_not_read():
    async with robot() as made:
        stage = Stage(made.body, GAZE, "end")
        await asyncio.sleep(0.25)
        made.daemon.freeze()
        await failure(stage)
        sent = len(made.daemon.commands)
        await asyncio.sleep(10.0)
        made.daemon.thaw()
        await asyncio.sleep(0.1)

        assert len(made.daemon.commands) - sent <= 1 + 1  # what was on its way, and where it stands


async def test_after_a_hiccup_the_head_goes_on_from_where_it_stood():
    async with robot() as made:
        stage = Stage(made.body, GAZE, "end")
        await asyncio.sleep(0.25)
        made.daemon.freeze()
        await asyncio.sleep(0.6)
        made.daemon.thaw()
        await stage.over()

        assert stage.passed[-1] == "end"
        assert made.faults == []
        # No command jumps: the greatest step is what the speed permits in one period, not what the plan had gone on.
        yaws = [pose["yaw"] for _, pose in made.daemon.commands]
        steps = [abs(b - a) for a, b in pairwise(yaws)]
        assert max(steps) < made.body.capabilities.joints[0].speed * 0.03


async def test_joints_that_do_not_come_are_named_with_how_far_they_are_off():
    async with robot() as made:
        made.daemon.stuck = {"pitch"}
        stage = Stage(made.body, GAZE, "end")
        fault = await failure(stage)

        assert stage.passed == ["start", "ready", "stroke_start"]
        assert fault.where == "look"
        assert fault.reason.startswith(
            "head_pitch stands at 0.0 degrees, 24.5 from where it should be for its stroke"
        )


async def test_late_is_late():
    async with robot() as made:
        promised = made.body.estimate(GAZE, None, WORLD).phases[2].natural
        made.daemon.slow = math.radians(30.0)
        stage = Stage(made.body, GAZE, "stroke_start")
        await asyncio.sleep(0.9)
        assert "stroke" not in stage.waits_at
        await asyncio.sleep(1.0)

        assert stage.waits_at == ["stroke"]
        assert stage.progress[-1].at - stage.progress[0].at > promised + 0.3
        assert made.off() < ON_AXIS
        stage.authority.extend("end")
        await stage.over()


@pytest.mark.parametrize(
    ("settings", "is_there"),
    [({"correction": 0.0}, False), ({"correction": 0.0, "on_target": 3.0}, True), ({}, True)],
)
async def test_a_head_that_sags_is_on_target_once_it_is_corrected_or_that_is_near_enough(settings, is_there):
    made = Robot(ReachyMiniSettings(**settings))
    async with made.body.connected():
        made.daemon.sag = math.radians(2.0)
        stage = Stage(made.body, GAZE, "stroke_start")
        await asyncio.sleep(4.0)

        assert (stage.waits_at == ["stroke"]) is is_there
        if is_there:
            assert made.off() < math.radians(settings.get("on_target", 0.8))
            stage.authority.extend("end")
            await stage.over()
        else:
            assert "2.0 from where it should be" in (await failure(stage)).reason


async def test_noise_of_the_encoders_changes_nothing_but_when():
    async with robot() as made:
        made.daemon.noise = math.radians(0.3)
        for behavior in (GAZE, Head(id="nod", lexeme="NOD"), FaceLexeme(id="smile", lexeme="SMILE")):
            progress = await performed(made.body, behavior)
            assert progress[-1].sync == "end"  # type: ignore[union-attr]
        await made.body.home()
        assert made.faults == []


async def test_what_another_app_has_moved_is_taken_on_from_where_it_is():
    async with robot() as made:
        made.daemon.move_by_hand(yaw=0.9, pitch=-0.3, body_yaw=0.4)
        await asyncio.sleep(2.0)
        before = len(made.daemon.commands)
        progress = await performed(made.body, GAZE)

        assert progress[-1].sync == "end"  # type: ignore[union-attr]
        first = made.daemon.commands[before][1]
        assert abs(first["yaw"] - 0.9) < 0.05
        assert too_much(made.daemon.commands[before:], made.body.capabilities.joints) == []


async def test_without_a_daemon_it_says_how_to_start_one():
    made = Robot(ReachyMiniSettings())
    made.daemon.kill()
    with pytest.raises(RunFailed) as failed:
        async with made.body.connected():
            raise AssertionError("connected to nothing")

    assert "cannot be reached" in failed.value.fault.reason
    assert made.faults == []


async def test_it_begins_from_where_it_was_folded_down_within_its_limits():
    async with robot() as made:
        assert too_much(made.daemon.commands, made.body.capabilities.joints) == []
        assert made.daemon.commands[0][1]["pitch"] == pytest.approx(0.43, abs=0.01)
        assert made.daemon.commands[-1][1] == pytest.approx({**HOME, "x": 0.0, "y": 0.0, "z": 0.0})


async def test_it_sends_nothing_while_it_rests():
    async with robot() as made:
        before = len(made.daemon.commands)
        await asyncio.sleep(60.0)

        assert len(made.daemon.commands) == before
