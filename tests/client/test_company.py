"""What a manager learns of people among themselves: how engaged each is, who speaks to whom, who breaks in."""

import asyncio
from itertools import pairwise

from engage_hri import embedded, perceive
from engage_hri.schemas import keys
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound
from engage_hri.schemas.recognition import Floor, Interjection, Statistics
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.robot import connect
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.service import recognize
from engage_hri.services.runtime.service import running
from engage_hri.services.runtime.virtual_time import VirtualTimeLoop

PEOPLE = {"ann": (1.2, 0.4, 1.2), "ben": (1.2, -0.4, 1.2)}


def played() -> tuple[list[Statistics], list[Floor], list[Interjection]]:
    """Ann looks at the robot for 20 s, then away for 40; ben asks her something meanwhile, looking at her."""
    levels: list[Statistics] = []
    floors: list[Floor] = []
    interjections: list[Interjection] = []

    async def main() -> None:
        services = {"recognition": lambda bus, ready: recognize(bus, ready, RecognitionConfig())}
        async with MemoryHub() as hub, running(hub, services), connect(hub=hub) as robot:
            eyes = hub.join("eyes")
            eyes.declare_alive()
            entities = tuple(Entity(id=id, kind="person", position=place) for id, place in PEOPLE.items())
            eyes.publish(keys.WORLD, World(entities=entities, at=eyes.stamp()))

            def tells(kind: type[ActionBegan | ActionEnded], who: str, what: str, *targets: str) -> None:
                eyes.publish(keys.PERCEIVED_ACTION, kind(actor=who, action=what, at=eyes.stamp(), targets=targets))  # type: ignore[arg-type]

            for who in PEOPLE:
                eyes.publish(keys.PERCEIVED_ACTION, ActorFound(actor=who, at=eyes.stamp()))
            with robot.engagement() as engagement, robot.floor() as floor, robot.interjections() as between:

                async def follow(feed, into) -> None:  # type: ignore[no-untyped-def]
                    async for each in feed:
                        into.append(each)

                tasks = [
                    asyncio.create_task(follow(*each))
                    for each in ((engagement, levels), (floor, floors), (between, interjections))
                ]
                tells(ActionBegan, "ann", "look", robot.id)
                tells(ActionBegan, "ben", "look", "ann")
                await asyncio.sleep(10)
                tells(ActionBegan, "ben", "speak")
                await asyncio.sleep(2)
                tells(ActionEnded, "ben", "speak")
                await asyncio.sleep(8)
                tells(ActionBegan, "ann", "look", "ben")
                await asyncio.sleep(40)
                for task in tasks:
                    task.cancel()

    with asyncio.Runner(loop_factory=VirtualTimeLoop) as runner:
        runner.run(main())
    return levels, floors, interjections


def test_each_level_is_told_once_and_the_floor_with_its_addressees() -> None:
    levels, floors, interjections = played()

    ann = [each.level for each in levels if each.actor == "ann"]
    assert (ann[:2], ann[-1]) == (["engaging", "engaged"], "disengaged")
    assert all(one != other for one, other in pairwise(ann))
    assert all(each.reasons for each in levels if each.actor == "ann")
    assert {each.level for each in levels if each.actor == "ben"} == {"disengaged"}
    # To whom ben speaks is known when he has ended.
    assert [[(speech.actor, speech.to) for speech in each.speeches] for each in floors] == [[("ben", ())], []]
    assert interjections == [], "the robot has said nothing"


async def test_an_id_that_turns_out_to_be_somebody_elses_has_no_level_any_more() -> None:
    async with (
        embedded(human="none") as robot,
        perceive("ann", hub=robot.hub) as ann,
        perceive("face_3", hub=robot.hub) as face,
    ):
        with robot.engagement() as engagement:
            await ann.look_at(ann.robot)
            await face.look_at(face.robot)
            await asyncio.sleep(4.0)
            face.same_as("ann")
            await asyncio.sleep(2.0)
            face.same_as("face_3")
            await face.look_at(face.robot)
            await asyncio.sleep(2.0)
            told: dict[str, list[str]] = {"ann": [], "face_3": []}
            while (each := await engagement.next(0.0)) is not None:
                told[each.actor].append(each.level)

    assert told["ann"] == ["engaging", "engaged"]
    assert told["face_3"][:3] == ["engaging", "engaged", "unknown"]
    assert "engaging" in told["face_3"][3:]


async def test_the_statistics_of_a_person_come_under_each_id_that_they_have() -> None:
    async with (
        embedded(human="none") as robot,
        perceive("ann", hub=robot.hub) as ann,
        perceive("face_3", hub=robot.hub) as face,
    ):
        with robot.statistics_updates("face_3") as followed:
            await ann.look_at(ann.robot)
            await face.look_at(face.robot)
            await asyncio.sleep(4.0)
            face.same_as("ann")
            await asyncio.sleep(2.0)
            late, own = await robot.statistics("face_3", timeout=1.0), await robot.statistics("ann", timeout=1.0)
            told = []
            while (each := await followed.next(0.0)) is not None:
                told.append(each)
            face.same_as("face_3")
            await face.look_at(face.robot)
            await asyncio.sleep(2.0)
            apart = await robot.statistics("face_3", timeout=1.0)

    assert late == own
    assert late.actor == "ann"
    assert told[-1] == own, "who follows the other id goes on with the person"
    assert apart.actor == "face_3"
