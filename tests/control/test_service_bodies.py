"""Control with bodies of others: it refuses what no body is asked about, tells their faults, and connects once."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import partial

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import BlockBehavior, Locomotion, Pointing, Speech
from engage_hri.schemas.body import (
    BodyPose,
    Capabilities,
    DescribeBody,
    Estimate,
    EstimateBehaviors,
    EstimateItem,
    Estimates,
    GoHome,
    NoPointZone,
)
from engage_hri.schemas.faults import Fault, RunFailed
from engage_hri.schemas.world import World
from engage_hri.services.bus import journal
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.control.config import ControlConfig
from engage_hri.services.control.contract.body import BodyFailed
from engage_hri.services.control.service import embody
from engage_hri.services.control.testing.suite import WORLD
from engage_hri.services.control.torso.body import SimulatedBody
from engage_hri.services.requests.ends import RequestRefused
from engage_hri.services.runtime.service import running
from tests.control.directing import robot

ZONE = NoPointZone(center=(0.45, -0.25, 0.73), radius=0.1)
POINT, SPEECH = Pointing(id="p", target="near-right"), Speech(id="s", text="hello")


class Blunt(SimulatedBody):
    """A driver that knows no zones, claims to do all, and has no voice."""

    asked: list[BlockBehavior]

    def __init__(self) -> None:
        super().__init__()
        self.asked = []
        able = self.capabilities
        self.capabilities = Capabilities(body="blunt", types=("pointing",), parts=able.parts, joints=able.joints)

    def estimate(self, behavior: BlockBehavior, pose: BodyPose | None, world: World) -> Estimate:
        self.asked.append(behavior)
        return super().estimate(behavior, pose, world)


class Plugged(SimulatedBody):
    """A driver that counts its connections, and whose hardware may be gone."""

    def __init__(self, *, is_gone: bool = False) -> None:
        super().__init__()
        self.is_gone, self.told = is_gone, list[str]()
        self.is_stuck = False

    async def home(self, parts: tuple[str, ...] = ()) -> None:
        if self.is_stuck:
            raise BodyFailed(Fault(reason="its arm is stuck", service="control"))

    @asynccontextmanager
    async def connected(self) -> AsyncIterator[None]:
        if self.is_gone:
            raise RunFailed(Fault(reason="no robot on that port", advice="plug it in"))
        self.told.append("open")
        try:
            yield
        finally:
            self.told.append("closed")


@pytest.mark.parametrize(
    ("behavior", "warning", "reason"),
    [
        (POINT, "CANNOT_CREATE_BEHAVIOR", "'near-right' is in a no-point zone"),
        (SPEECH, "BEHAVIOR_TYPE_NOT_SUPPORTED", "this body has no speech; give it a voice: --voice espeak"),
        (Locomotion(id="l", target="human"), "BEHAVIOR_TYPE_NOT_SUPPORTED", "this body has no locomotion"),
    ],
)
async def test_no_body_is_asked_about_what_is_nothing_for_it_or_forbidden(
    hub: MemoryHub, behavior: BlockBehavior, warning: str, reason: str
) -> None:
    body = Blunt()
    async with robot(hub, body=body, no_point_zones=(ZONE,)) as client:
        await asyncio.sleep(0.1)
        answer = await client.bus.query(keys.ESTIMATE, EstimateBehaviors(items=(EstimateItem(behavior=behavior),)))
        with pytest.raises(RequestRefused, match=reason):
            await client.perform(behavior).accepted

    assert isinstance(answer, Estimates)
    (estimate,) = answer.items
    assert (estimate.feasible, estimate.warning) == (False, warning)
    assert reason in str(estimate.fault)
    assert body.asked == []


async def test_zones_of_the_configuration_are_told_whatever_the_body_says(hub: MemoryHub) -> None:
    async with robot(hub, body=Blunt(), no_point_zones=(ZONE,)) as client:
        able = await client.bus.query(keys.DESCRIBE, DescribeBody())

    assert isinstance(able, Capabilities)
    assert able.no_point_zones == (ZONE,)


async def test_a_fault_outside_of_any_behavior_is_told(hub: MemoryHub) -> None:
    body = Plugged()
    async with robot(hub, body=body) as client:
        body.on_fault(Fault(reason="the daemon is gone", advice="start it", service="control"))
        await asyncio.sleep(0.1)
        told = client.of(Fault)

    assert [str(fault) for fault in told] == ["the daemon is gone (start it)"]
    assert body.told == ["open", "closed"]


async def test_a_fault_of_the_body_its_end_and_a_way_home_that_failed_are_what_a_person_has_to_see_to(
    hub: MemoryHub, caplog: pytest.LogCaptureFixture
) -> None:
    body = Plugged()
    async with robot(hub, body=body) as client:
        body.on_fault(Fault(reason="the daemon is gone", advice="start it", service="control"))
        body.on_recovery("the daemon is back")
        body.is_stuck = True
        for id in ("first", "second"):
            with pytest.raises(RunFailed):
                await client.requests.send(keys.BEHAVIOR, GoHome(id=id, requester="realizer")).outcome
        body.is_stuck = False
        for id in ("third", "fourth"):
            await client.requests.send(keys.BEHAVIOR, GoHome(id=id, requester="realizer")).outcome
    alerts = [record.getMessage() for record in caplog.records if getattr(record, journal.ALERT, False)]

    assert alerts == [
        "control: the daemon is gone (start it)", "control: the daemon is back", "control: its arm is stuck",
        "control: its arm is stuck", "control: the body is at home",
    ]  # fmt: skip


@pytest.mark.parametrize("connects", [True, False])
async def test_hardware_that_is_not_there_is_told_and_nobody_needs_it_for_estimates(
    hub: MemoryHub, connects: bool
) -> None:
    hub.join("simulation").publish(keys.WORLD, WORLD)
    service = partial(embody, config=ControlConfig(), body=Plugged(is_gone=True), connects=connects)
    if connects:
        with pytest.raises(ExceptionGroup) as failed:
            async with running(hub, {"control": service}):
                pass
        assert failed.group_contains(RunFailed, match=r"no robot on that port \(plug it in\)")
    else:
        async with running(hub, {"control": service}):
            bus = hub.join("asking")
            answer = await bus.query(keys.ESTIMATE, EstimateBehaviors(items=(EstimateItem(behavior=SPEECH),)))
        assert isinstance(answer, Estimates)
        assert answer.items[0].feasible
