"""The head, when who told of people was killed: what it said is over after the grace."""

import asyncio

from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.perception import ActionBegan, ActorFound
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.people.perceived_person import PerceivedActions
from engage_hri.services.reports.action_reports import REPORT_GRACE
from tests.generation.partners import TABLE, Partners, stage

LOST = "lost: hold the direction"
FACE_LOST = 2.0
HAND = Entity(id="ann-hand", kind="hand", owner="ann", position=(0.5, 0.1, 0.8), velocity=(0.3, 0.0, 0.0))


def perceiver(hub: MemoryHub) -> Bus:
    bus = hub.join("camera", role="perception")
    bus.declare_alive()
    return bus


def owner(partners: Partners) -> tuple[str, str, str]:
    last = partners.owners[-1].owner
    return last.kind, last.target, last.reason


async def test_a_person_whose_perceiver_was_killed_is_not_looked_at_for_ever(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        camera = perceiver(hub)
        PerceivedActions(camera).tell(ActorFound(actor="human", at=camera.stamp()))
        await asyncio.sleep(1.0)
        await camera.leave()
        await asyncio.sleep(REPORT_GRACE + FACE_LOST - 0.1)
        before = owner(partners)
        await asyncio.sleep(0.5)

        assert before == ("face", "human", "nearest when it came")
        assert owner(partners) == ("face", "", LOST)


async def test_a_generation_that_comes_late_learns_it_too(hub: MemoryHub) -> None:
    camera = perceiver(hub)
    PerceivedActions(camera).tell(ActorFound(actor="human", at=camera.stamp()))
    await asyncio.sleep(60.0)
    async with stage(hub) as partners:
        await asyncio.sleep(1.0)
        await camera.leave()
        await asyncio.sleep(REPORT_GRACE + FACE_LOST + 0.5)

        assert owner(partners) == ("face", "", LOST)


async def test_a_person_whom_another_sees_as_well_stays(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        camera = perceiver(hub)
        for bus in (camera, partners.client):
            PerceivedActions(bus).tell(ActorFound(actor="human", at=bus.stamp()))
        await asyncio.sleep(1.0)
        await camera.leave()
        await asyncio.sleep(20.0)

        assert owner(partners)[:2] == ("face", "human")


async def test_the_hand_of_somebody_who_vanished_in_the_middle_of_an_act_lets_the_head_go(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        camera = perceiver(hub)
        act = ActionBegan(actor="ann", action="act", targets=("left",), at=camera.stamp())
        PerceivedActions(camera).tell(ActorFound(actor="ann", at=camera.stamp()), act)
        partners.see(World(entities=(*TABLE.entities, HAND)))
        await asyncio.sleep(1.0)
        held = owner(partners)
        await camera.leave()
        await asyncio.sleep(REPORT_GRACE + 2.5)

        assert held[:1] == ("hands",)
        assert owner(partners)[:2] == ("face", "human")


async def test_a_moving_hand_of_a_world_that_nobody_tells_any_more_lets_the_head_go(hub: MemoryHub) -> None:
    async with stage(hub) as partners:
        camera = perceiver(hub)
        camera.publish(keys.WORLD, World(entities=(*TABLE.entities, replace(HAND, owner="human"))))
        await asyncio.sleep(1.0)
        held = owner(partners)
        await camera.leave()
        await asyncio.sleep(REPORT_GRACE + FACE_LOST + 0.5)

        assert held[:2] == ("hands", "ann-hand")
        assert owner(partners) == ("face", "", LOST)
