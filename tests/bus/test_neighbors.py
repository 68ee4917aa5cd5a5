"""Who waits for a robot that is not there is told which are: over real sockets."""

import logging

import pytest

from engage_hri.services.bus.zenoh.hub import open_hub
from engage_hri.services.bus.zenoh.neighbors import robots, tell_if_alone
from tests.bus.places import free_endpoint

pytestmark = pytest.mark.real_time


async def test_a_robot_of_another_name_is_named(caplog: pytest.LogCaptureFixture) -> None:
    endpoint = free_endpoint()
    async with (
        await open_hub("melvin", listen=[endpoint]) as there,
        await open_hub("robot", connect=[endpoint]) as here,
    ):
        there.join("generation").declare_alive()
        with caplog.at_level(logging.WARNING, logger="engage"):
            await tell_if_alone(here.join("me"), [endpoint], after=0.0)

    assert "no robot 'robot' here yet; there are: 'melvin'; waiting" in caplog.text


async def test_nobody_is_named_where_nobody_is_and_nothing_is_said_where_the_robot_is(
    caplog: pytest.LogCaptureFixture,
) -> None:
    endpoint = free_endpoint()
    assert await robots([free_endpoint()]) == ()
    async with await open_hub("robot", listen=[endpoint]) as hub:
        hub.join("generation").declare_alive()
        with caplog.at_level(logging.WARNING, logger="engage"):
            await tell_if_alone(hub.join("me"), [endpoint], after=0.2)

    assert caplog.text == ""
