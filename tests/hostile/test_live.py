"""Random messages into `engage up`, over Zenoh."""

import pytest

from tests.hostile.live import attack_live

pytestmark = pytest.mark.real_time


async def test_no_service_of_a_running_system_ends_under_random_messages() -> None:
    result = await attack_live(200)

    assert result.restarted == []
    assert result.failures == {}
    assert not [line for line in result.log if "Traceback" in line or "starting it again" in line]
