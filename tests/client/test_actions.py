"""`Robot.actions`: what people and the robot do, until it is over, also if who told it was killed."""

import asyncio

from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, ActorLost
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.feeds import Feed
from engage_hri.services.client.people.perceived_person import PerceivedPerson
from engage_hri.services.client.robot import connect
from engage_hri.services.reports.action_reports import REPORT_GRACE

Event = ActionBegan | ActionEnded | ActorFound | ActorLost


def arrive(hub: MemoryHub) -> tuple[Bus, PerceivedPerson]:
    """A perceiver with a person who sits there and looks at the robot."""
    bus = hub.join("camera", role="perception")
    bus.declare_alive()
    person = PerceivedPerson("ann", bus)
    person._enter(None)
    person.begin("look", bus.robot)
    return bus, person


async def all_of(actions: Feed[Event]) -> list[tuple[str, str]]:
    """All that is told within a tenth of a second, in short."""
    told = []
    while (event := await actions.next(0.1)) is not None:
        assert event.actor == "ann"
        told.append((type(event).__name__, getattr(event, "action", "")))
    return told


async def test_a_person_whose_perceiver_was_killed_ends_the_look_and_goes(hub: MemoryHub) -> None:
    async with connect(hub=hub) as robot:
        with robot.actions() as actions:
            camera, _ = arrive(hub)
            assert await all_of(actions) == [("ActorFound", ""), ("ActionBegan", "look")]
            await camera.leave()
            assert await actions.next(REPORT_GRACE - 0.05) is None

            assert await all_of(actions) == [("ActionEnded", "look"), ("ActorLost", "")]


async def test_who_comes_late_is_told_who_is_there_and_what_goes_on(hub: MemoryHub) -> None:
    camera, person = arrive(hub)
    await asyncio.sleep(60.0)
    async with connect(hub=hub) as robot:
        with robot.actions() as actions:
            assert await all_of(actions) == [("ActorFound", ""), ("ActionBegan", "look")]
            await person.leave()
            assert await all_of(actions) == [("ActionEnded", "look"), ("ActorLost", "")]
    await camera.leave()


async def test_the_feed_of_actions_ends_with_its_client(hub: MemoryHub) -> None:
    async with connect(hub=hub) as robot:
        actions = robot.actions()

    assert await actions.next() is None
