"""The contract suite for the tests of this driver: the installed one, or the one of a clone from before that."""

from collections.abc import AsyncIterator
from importlib.util import find_spec

import pytest

from engage_hri.services.control.body import Body

IS_INSTALLED = find_spec("engage_hri.services.control.testing") is not None
try:
    from engage_hri.services.control.testing import BodyContract as BodyContract
except ModuleNotFoundError:
    from tests.control.contract import BodyContract as Clone

    class BodyContract(Clone):  # type: ignore[no-redef]
        """The suite of a clone: it neither connects a body, nor judges measurements that come 50 times a second."""

        noise = 0.0

        @pytest.fixture
        async def body(self) -> AsyncIterator[Body]:
            body = self.make()
            body.see(self.world)
            async with body.connected():
                yield body

        async def test_keeps_its_limits_whatever_comes(self) -> None:
            pytest.skip("test_limits.py judges what is sent")

        async def test_holding_keeps_the_limits_of_the_joints(self) -> None:
            pytest.skip("test_limits.py judges what is sent")
