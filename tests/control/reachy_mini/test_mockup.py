"""The driver of Reachy Mini on the real daemon with its mock-up: the contract in real time, and real outages.

All of the contract takes minutes, so that it runs on request: REACHY_MINI_FULL=1.
"""

import os
from collections.abc import AsyncIterator, Iterator

import pytest

from engage_hri.services.control.body import Body
from engage_hri.services.control.reachy_mini.body import ReachyMini
from engage_hri.services.control.reachy_mini.settings import ReachyMiniSettings
from tests.control.contract import BodyContract
from tests.control.reachy_mini.daemon import Mockup, running

pytestmark = pytest.mark.real_time
SOME = (
    BodyContract.test_reports_every_sync_point_once_and_in_order,
    BodyContract.test_takes_the_time_that_it_predicted,
    BodyContract.test_a_shift_on_its_way_is_taken_over_by_another,
    BodyContract.test_a_look_that_comes_over_a_shift_on_its_way_goes_home_to_where_that_leads,
    BodyContract.test_home_is_reached_from_anything,
    BodyContract.test_refuses_what_it_cannot_do_before_anything_moves,
)
"""Claims of the contract that need no long waits."""


@pytest.fixture(scope="module")
def mockup(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Mockup]:
    with running(tmp_path_factory.mktemp("daemon")) as mockup:
        yield mockup


class OnTheMockup(BodyContract):
    tolerance = 0.2  # of a machine with other work

    @pytest.fixture
    async def body(self, mockup: Mockup) -> AsyncIterator[Body]:
        body = ReachyMini(ReachyMiniSettings(url=mockup.url))
        body.see(self.world)
        async with body.connected():
            yield body


@pytest.mark.skipif(not os.environ.get("REACHY_MINI_FULL"), reason="takes minutes: REACHY_MINI_FULL=1")
class TestAll(OnTheMockup):
    """All of the contract."""


@pytest.mark.parametrize("claim", SOME, ids=lambda claim: claim.__name__)
class TestClaims:
    async def test_on_the_mockup(self, mockup: Mockup, claim) -> None:
        suite = OnTheMockup()
        body = ReachyMini(ReachyMiniSettings(url=mockup.url))
        body.see(suite.world)
        async with body.connected():
            await claim(suite, body)
