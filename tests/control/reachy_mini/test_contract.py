"""The driver of Reachy Mini, held to the contract of bodies on a daemon that lags as the real one does."""

import asyncio
from collections.abc import AsyncIterator
from random import Random

import pytest
from tests.control.contract import BodyContract
from tests.control.suite import Stage

from engage_hri.services.control.body import Body
from engage_hri.services.control.reachy_mini.body import ReachyMini
from tests.control.reachy_mini.fake import FakeDaemon
from tests.control.reachy_mini.limits import too_much


class TestReachyMini(BodyContract):
    tolerance = 0.06

    @pytest.fixture
    async def daemon(self) -> FakeDaemon:
        return FakeDaemon()

    @pytest.fixture
    async def body(self, daemon: FakeDaemon) -> AsyncIterator[Body]:
        body = ReachyMini(connect=daemon)
        body.see(self.world)
        async with body.connected():
            yield body

    async def test_keeps_its_limits_whatever_comes(self, body: Body, daemon: FakeDaemon):
        for behavior in self.able(body):
            stage = Stage(body, behavior)
            await asyncio.sleep(0.3)
            stage.authority.extend("end")
            other = Stage(body, behavior, "end")
            await asyncio.sleep(0.25)
            other.authority.revoke()
            await asyncio.gather(stage.task, other.task, return_exceptions=True)
        await body.home()

        assert too_much(daemon.commands, body.capabilities.joints) == []

    @pytest.mark.parametrize("seed", range(3))
    async def test_holding_keeps_the_limits_of_the_joints(self, body: Body, daemon: FakeDaemon, seed: int):
        chance = Random(seed)
        for behavior in self.moving(body):
            stage = Stage(body, behavior, "end")
            for _ in range(4):
                await asyncio.sleep(chance.uniform(0.0, 0.4))
                stage.authority.hold()
                await asyncio.sleep(chance.choice((0.02, 0.1, 1.0)))
                stage.authority.go_on()
            await stage.over()

        assert too_much(daemon.commands, body.capabilities.joints) == []
