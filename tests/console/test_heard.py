"""What people are shown of actions and of the world: it is over when who told it was killed."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from engage_hri.schemas import keys
from engage_hri.schemas.messages import Message
from engage_hri.schemas.participants import PeerGone
from engage_hri.schemas.perception import ActionBegan, ActorFound, OngoingActions
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.people.perceived_person import PerceivedActions, PerceivedPerson
from engage_hri.services.console.follow import following
from engage_hri.services.console.web.picture import Picture
from engage_hri.services.console.web.service import PATTERNS
from engage_hri.services.reports.action_reports import REPORT_GRACE

CUP = Entity(id="cup", kind="object", position=(0.5, 0.0, 0.7))


@asynccontextmanager
async def shown(hub: MemoryHub, told: list[Message] | None = None) -> AsyncIterator[Picture]:
    """A picture that follows the bus. told: gets each message."""
    bus = hub.join(f"window-{bus_number(hub)}")
    picture = Picture(bus.robot, bus.now())

    def feed(message: Message, at: Seconds) -> None:
        picture.feed(message, at, bus.now())
        if told is not None:
            told.append(message)

    async with following(bus, (feed,), patterns=PATTERNS):
        yield picture


def bus_number(hub: MemoryHub) -> int:
    return len(hub._buses)


def arrive(hub: MemoryHub, name: str = "camera") -> tuple[Bus, PerceivedPerson]:
    """A perceiver with a person who sits there and looks at a cup that it has brought."""
    bus = hub.join(name, role="perception")
    bus.declare_alive()
    person = PerceivedPerson("ann", bus)
    person._enter(None)
    person.bring(CUP)
    person.begin("look", "cup")
    return bus, person


def people(picture: Picture) -> list[tuple[str, bool, tuple[str, ...] | None]]:
    scene = picture.made("scene")
    return [(each.id, each.present, each.looks) for each in scene.people]


async def test_a_person_and_things_of_a_killed_perceiver_go_after_the_grace(hub: MemoryHub) -> None:
    async with shown(hub) as picture:
        camera, _ = arrive(hub)
        await asyncio.sleep(1.0)
        await camera.leave()
        await asyncio.sleep(REPORT_GRACE - 0.1)
        before = people(picture)
        await asyncio.sleep(0.2)

        assert before == [("ann", True, ("cup",))]
        assert people(picture) == []
        assert picture.world.entities == ()


async def test_a_window_that_comes_late_knows_who_is_there_and_loses_them_too(hub: MemoryHub) -> None:
    camera, person = arrive(hub)
    await asyncio.sleep(60.0)
    async with shown(hub) as picture:
        await asyncio.sleep(0.1)
        assert people(picture) == [("ann", True, ("cup",))]

        person.begin("look")
        await asyncio.sleep(0.1)
        assert people(picture) == [("ann", True, ())]

        await camera.leave()
        await asyncio.sleep(REPORT_GRACE + 0.1)
        assert people(picture) == []


async def test_what_the_robot_does_is_over_when_its_body_was_killed(hub: MemoryHub) -> None:
    async with shown(hub) as picture:
        body = hub.join("control")
        body.declare_alive()
        body.publish(keys.ROBOT_ACTION, ActionBegan(actor="robot", action="point", targets=("cup",), at=body.stamp()))
        await asyncio.sleep(0.1)
        before = picture._scene.actor("robot").doing
        await body.leave()
        await asyncio.sleep(REPORT_GRACE + 0.1)

        assert [each.action for each in before] == ["point"]
        assert picture._scene.actor("robot").doing == ()


async def test_messages_that_are_no_actions_are_passed_on_as_they_came(hub: MemoryHub) -> None:
    told: list[Message] = []
    async with shown(hub, told):
        camera = hub.join("camera", role="perception")
        camera.declare_alive()
        PerceivedActions(camera).tell(ActorFound(actor="ann", at=camera.stamp()))
        await asyncio.sleep(0.1)
        await camera.leave()
        await asyncio.sleep(0.1)

    kinds = [type(each) for each in told]
    assert kinds.count(ActorFound) == 1
    assert OngoingActions in kinds
    assert PeerGone in kinds
    assert World not in kinds
