"""The driver of Reachy Mini, held to the contract of bodies on a daemon that lags as the real one does."""

from collections.abc import AsyncIterator

import pytest

from engage_hri.services.control.body import Body
from engage_hri.services.control.reachy_mini.body import ReachyMini
from tests.control.contract import BodyContract
from tests.control.reachy_mini.fake import FakeDaemon


class TestReachyMini(BodyContract):
    tolerance = 0.06

    @pytest.fixture
    async def body(self) -> AsyncIterator[Body]:
        body = ReachyMini(connect=FakeDaemon())
        body.see(self.world)
        async with body.connected():
            yield body
