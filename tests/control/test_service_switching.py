"""Faults switched over the bus: who asks, what is answered, and what those who come late are told."""

import asyncio

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Pointing, Speech
from engage_hri.schemas.body import BehaviorOutcome, Capabilities, DescribeBody
from engage_hri.schemas.body_faults import BodyFault, BodyFaults
from engage_hri.schemas.faults import InputRefused
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.robot import Robot
from engage_hri.services.control.config import ControlConfig, Variability
from engage_hri.services.control.contract.body import Body
from engage_hri.services.control.service import embody
from engage_hri.services.control.torso.body import SimulatedBody
from engage_hri.services.runtime.service import running
from tests.control.directing import robot

POINT = Pointing(id="point-1", target="near-right", mode="RIGHT_HAND")
SLOW, MUTE = BodyFault(kind="slow", part="right_arm", amount=3.0), BodyFault(kind="mute")


async def test_an_operator_switches_a_fault_on_in_the_middle_of_a_behavior_and_off_again(hub: MemoryHub) -> None:
    async with robot(hub) as client, Robot.on(hub.join("guard", "operator")) as guard:
        await client.outcome(client.perform(POINT, block="one"))
        healthy = client.reached("point-1")
        client.heard.clear()
        pending = client.perform(POINT, block="two")
        await asyncio.sleep(0.2)
        assert await guard.switch_faults([SLOW]) == (SLOW,)
        await asyncio.sleep(1.0)
        assert await guard.switch_faults() == ()
        assert (await client.outcome(pending)).status == "done"
    late = client.reached("point-1")

    took = [at["stroke"] - at["start"] for at in (healthy, late)]
    assert took[1] > took[0] + 0.5


async def test_who_comes_late_is_told_what_is_on(hub: MemoryHub) -> None:
    async with robot(hub, variability=Variability(lost=0.5)), Robot.on(hub.join("guard", "operator")) as guard:
        assert await guard.faults_on(1.0) == (BodyFault(kind="lost", amount=0.5),)
        with guard.body_faults() as told:
            configured = await told.next(1.0)
        assert configured is not None
        assert configured.by == ""  # nobody but the configuration
        await guard.switch_faults([SLOW, MUTE])
        await asyncio.sleep(60.0)
        async with Robot.on(hub.join("late")) as late:
            with late.body_faults() as told:
                first = await told.next(1.0)
                await guard.switch_faults([MUTE])
                then = await told.next(1.0)

    assert isinstance(first, BodyFaults)
    assert (first.faults, first.by) == ((SLOW, MUTE), "guard")
    assert then is not None
    assert then.faults == (MUTE,)


async def test_two_who_switch_within_one_round_trip_do_not_undo_one_another(hub: MemoryHub) -> None:
    async with robot(hub), Robot.on(hub.join("one", "operator")) as one, Robot.on(hub.join("two", "operator")) as two:
        await asyncio.gather(one.switch_on(SLOW), two.switch_on(MUTE))
        assert await one.faults_on(1.0) == (SLOW, MUTE)

        noise = BodyFault(kind="noise")
        await asyncio.gather(one.switch_off(BodyFault(kind="slow")), two.switch_on(noise))
        assert await two.faults_on(1.0) == (MUTE, noise)
        with pytest.raises(InputRefused, match=r"slow.*is not on \(on: mute, noise 0.1\)"):
            await two.switch_off(SLOW)


async def test_one_that_cannot_be_played_is_refused_and_nothing_changes(hub: MemoryHub) -> None:
    async with robot(hub), Robot.on(hub.join("guard", "operator")) as guard:
        await guard.switch_faults([MUTE])
        with pytest.raises(InputRefused, match=r"cannot play 'sleepy'; it can play slow.*engage fault list"):
            await guard.switch_faults([SLOW, BodyFault(kind="sleepy")])
        with pytest.raises(InputRefused, match="slow of 'wing': known are head"):
            await guard.switch_faults([BodyFault(kind="slow", part="wing")])

        assert await guard.faults_on(1.0) == (MUTE,)
        assert "slow" in (await guard.capabilities()).faults


async def test_sync_points_get_lost_from_then_on_and_outcomes_do_not(hub: MemoryHub) -> None:
    async with robot(hub) as client, Robot.on(hub.join("guard", "operator")) as guard:
        await guard.switch_faults([BodyFault(kind="lost", amount=1.0)])
        assert (await client.outcome(client.perform(POINT, block="one"))).status == "done"
        assert client.reached("point-1") == {}
        await guard.switch_faults()
        await client.outcome(client.perform(POINT, block="two"))
        assert len(client.reached("point-1")) == 7


async def test_a_voice_that_goes_fails_by_name(hub: MemoryHub) -> None:
    async with robot(hub) as client, Robot.on(hub.join("guard", "operator")) as guard:
        pending = client.perform(Speech(id="s", text="one two three four five"))
        await asyncio.sleep(0.5)
        await guard.switch_faults([BodyFault(kind="voiceless")])
        outcome = await client.outcome(pending)

    assert isinstance(outcome, BehaviorOutcome)
    assert outcome.status == "failed"
    assert outcome.fault is not None
    assert outcome.fault.reason == "the voice cannot speak"
    assert outcome.spoken == "one two"


class RealBody(SimulatedBody):
    """Plays nothing, as a body of metal."""

    faults = Body.faults
    switch_faults = Body.switch_faults


async def test_a_real_body_plays_no_faults(hub: MemoryHub) -> None:
    body = RealBody()
    body.capabilities = Capabilities(body="real", types=("gaze",), parts=("head",))

    async def serve(bus, ready):  # type: ignore[no-untyped-def]
        await embody(bus, ready, ControlConfig(), body)

    async with running(hub, {"control": serve}), Robot.on(hub.join("guard", "operator")) as guard:
        assert await guard.faults_on(1.0) == ()
        with pytest.raises(InputRefused, match=r"cannot play 'slow'; it can play no fault"):
            await guard.switch_faults([SLOW])
        await guard.switch_faults([])
        described = await hub.join("test").query(keys.DESCRIBE, DescribeBody())
    assert isinstance(described, Capabilities)
    assert described.faults == ()
