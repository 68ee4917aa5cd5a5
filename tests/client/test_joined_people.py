"""Two ids turn out to be one person: whoever reads what perception tells sees one person from then on."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import GazeShift
from engage_hri.schemas.fragments import HeadOwner
from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, ActorLost, Utterance
from engage_hri.schemas.summary import Summary
from engage_hri.schemas.units import Stamp, Vector
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.language_models import perform_call
from engage_hri.services.client.people.perceive import perceive
from engage_hri.services.client.robot import Robot, connect
from engage_hri.services.commandline.shell import roster
from engage_hri.services.commandline.shell.config import load
from engage_hri.services.console.follow import following
from engage_hri.services.console.web.picture import Picture
from engage_hri.services.console.web.service import PATTERNS
from engage_hri.services.runtime.service import running
from engage_hri.services.runtime.virtual_time import VirtualTimeLoop

ANN: Vector = (1.2, 0.5, 1.2)
NEXT: Vector = (1.2, -0.5, 1.2)
"""Too far from the other place for a guess."""
LONG = "Ann, this is a very long sentence that I am going to say to you now, whoever else may be in this room."


class Eyes:
    """A robot, and a camera before it."""

    def __init__(self, hub: MemoryHub, robot: Robot, picture: Picture) -> None:
        self.hub, self.robot, self.picture = hub, robot, picture
        self.owners: list[HeadOwner] = []
        self._bus = hub.join("eyes")
        self._bus.declare_alive()

    def see(self, **people: Vector) -> None:
        table = Entity(id="table", kind="surface", position=(0.6, 0.0, 0.72))
        seen = (Entity(id=id, kind="person", position=place) for id, place in people.items())
        self._bus.publish(keys.WORLD, World(entities=(table, *seen), at=self._bus.stamp()))

    def tell(self, kind: type[Any], actor: str, **fields: object) -> None:
        message: Message = kind(actor=actor, at=self._bus.stamp(), **fields)
        self._bus.publish(keys.PERCEIVED_ACTION, message)

    def stamp(self) -> Stamp:
        return self._bus.stamp()

    def say_of(self, actor: str, text: str, began: Stamp) -> None:
        """Tell what somebody has said since then."""
        now = self._bus.stamp()
        self._bus.publish(keys.UTTERANCE, Utterance(actor=actor, id="1", text=text, began=began, ended=now, at=now))

    async def say(self, text: str, **fields: object) -> Summary:
        call = {"turn_status": "full", "parts": [{"say": text}], **fields}
        return await perform_call(self.robot, call, await_answer=True, timeout=5)

    async def people(self) -> list[tuple[str, Vector]]:
        return [(each.id, each.position) for each in (await self.robot.world(timeout=1.0)).people]


def play(story: Callable[[Eyes], Awaitable[None]]) -> None:
    async def main() -> None:
        config = load()
        services = {name: roster.service(name, config) for name in roster.ROBOT}
        async with MemoryHub(config.robot) as hub, running(hub, services), connect(hub=hub) as robot:
            window, picture = hub.join("window"), Picture(config.robot, robot.now())
            shown: Callable[[Message, float], None] = lambda message, at: picture.feed(message, at, robot.now())  # noqa: E731
            async with following(window, (shown,), patterns=PATTERNS):
                eyes = Eyes(hub, robot, picture)

                async def follow() -> None:
                    async for owner in robot.head_owners():
                        eyes.owners.append(owner)

                task = asyncio.create_task(follow())
                eyes.see(ann=ANN)
                eyes.tell(ActorFound, "ann")
                await asyncio.sleep(1.0)
                await story(eyes)
                task.cancel()

    with asyncio.Runner(loop_factory=VirtualTimeLoop) as runner:
        runner.run(main())


async def found_again(eyes: Eyes, *, is_stale: bool = False) -> None:
    """Ann is lost, and there is somebody elsewhere. is_stale: the world goes on to have ann."""
    await eyes.say("Hello Ann.", addressee="ann")
    eyes.tell(ActorLost, "ann")
    eyes.see(face_3=NEXT, **({"ann": ANN} if is_stale else {}))
    eyes.tell(ActorFound, "face_3")
    await asyncio.sleep(3.0)


async def joined(eyes: Eyes) -> None:
    eyes.tell(ActorFound, "face_3", same_as="ann")
    await asyncio.sleep(1.0)


async def answering(eyes: Eyes, asked: Awaitable[Summary]) -> Summary:
    task = asyncio.ensure_future(asked)
    await asyncio.sleep(2.5)
    eyes.tell(ActionBegan, "face_3", action="speak")
    await asyncio.sleep(1.0)
    eyes.tell(ActionEnded, "face_3", action="speak")
    return await task


@pytest.mark.parametrize("is_stale", [False, True])
def test_one_person_is_there_once_for_all(is_stale: bool) -> None:
    async def story(eyes: Eyes) -> None:
        await found_again(eyes, is_stale=is_stale)
        assert {id for id, _ in await eyes.people()} >= {"face_3"}
        await joined(eyes)
        assert await eyes.people() == [("ann", NEXT)]
        assert eyes.picture.present == ("ann",)
        assert "face_3" not in str(eyes.picture.section("scene"))
        assert (eyes.owners[-1].owner.target, eyes.owners[-1].owner.reason) == ("ann", "spoken with last")
        before = len(eyes.owners)

        told = await answering(eyes, eyes.say("Do you like tea?"))
        assert told.answer == "speak", "said to the only one there"
        told = await answering(eyes, eyes.say("And coffee?", addressee="face_3"))
        assert told.answer == "speak"
        told = await answering(eyes, eyes.say("And milk?", addressee="ann"))
        assert told.answer == "speak"
        assert {each.owner.target for each in eyes.owners[before:]} - {"table"} == {"ann"}, (
            "it looks away now and then"
        )

    play(story)


def test_who_is_named_while_the_robot_speaks_may_interrupt_it() -> None:
    async def story(eyes: Eyes) -> None:
        await found_again(eyes)
        speaking = asyncio.create_task(eyes.say(LONG, addressee="face_3"))
        await asyncio.sleep(1.0)
        await joined(eyes)
        eyes.tell(ActionBegan, "face_3", action="speak")
        await asyncio.sleep(3.0)
        eyes.tell(ActionEnded, "face_3", action="speak")
        told = await speaking

        assert (told.status, told.answered_by) == ("interrupted", "ann")
        assert [(each.who, each.reading) for each in told.interjections] == [("ann", "interruption")]

    play(story)


def test_what_a_person_has_said_by_another_id_is_heard_of_that_person() -> None:
    async def story(eyes: Eyes) -> None:
        await found_again(eyes)
        eyes.tell(ActionBegan, "face_3", action="speak")
        began = eyes.stamp()
        await asyncio.sleep(1.0)
        eyes.tell(ActionEnded, "face_3", action="speak")
        eyes.say_of("face_3", "It is me.", began)
        await asyncio.sleep(0.5)
        await joined(eyes)
        told = await answering(eyes, eyes.say("Do you like tea?"))

        assert [(each.who, each.text) for each in told.heard] == [("ann", "It is me.")]

    play(story)


def test_the_robot_looks_at_a_person_by_any_id() -> None:
    async def story(eyes: Eyes) -> None:
        await found_again(eyes)
        await joined(eyes)
        for id in ("ann", "face_3"):
            outcome = await eyes.robot.realize(f"look-{id}", [GazeShift(id="look", target=id)])
            assert outcome.status == "done"

    play(story)


def test_a_guess_is_taken_back_for_all() -> None:
    async def story(eyes: Eyes) -> None:
        eyes.tell(ActorLost, "ann")
        eyes.see()
        await asyncio.sleep(0.5)
        eyes.see(face_3=ANN)
        await asyncio.sleep(0.5)
        assert await eyes.people() == [("ann", ANN)]
        eyes.see(face_3=ANN, ann=NEXT)
        await asyncio.sleep(0.5)
        assert sorted(await eyes.people()) == [("ann", NEXT), ("face_3", ANN)]
        assert sorted(eyes.picture.present) == ["ann", "face_3"]

    play(story)


@pytest.mark.parametrize("correction", ["bob", "face_3"])
def test_a_later_word_corrects_an_earlier_one_for_all(correction: str) -> None:
    """Each person has a reporter of their own."""

    async def story(eyes: Eyes) -> None:
        eyes.tell(ActorLost, "ann")
        eyes.see()
        told: list[tuple[str, str, str]] = []

        async def follow() -> None:
            async for each in eyes.robot.actions():
                if isinstance(each, ActorFound | ActorLost):
                    told.append(
                        (type(each).__name__, each.actor, each.same_as if isinstance(each, ActorFound) else "")
                    )

        task = asyncio.create_task(follow())
        async with perceive("bob", hub=eyes.hub, position=NEXT) as bob, perceive("face_3", hub=eyes.hub) as face:
            async with perceive("ann", hub=eyes.hub, position=ANN) as ann:
                for person in (ann, bob, face):
                    await person.look_at(person.robot)
                await asyncio.sleep(0.5)
                face.same_as("ann")
                await asyncio.sleep(0.5)
                assert {id for id, _ in await eyes.people()} == {"ann", "bob"}
                face.same_as(correction)
                await asyncio.sleep(0.5)
                after = {"ann", "bob", correction}
                assert {id for id, _ in await eyes.people()} == after == set(eyes.picture.present)
                assert all(not same_as or actor == "face_3" for _, actor, same_as in told)
                outcome = await eyes.say("Hello Ann.", addressee="ann")
                assert outcome.eye_contact
            await asyncio.sleep(0.5)
            assert {id for id, _ in await eyes.people()} == after - {"ann"} == set(eyes.picture.present)
            assert told[-1][:2] == ("ActorLost", "ann"), "the reporter of the face sees ann no more"
        task.cancel()

    play(story)


def test_two_who_come_one_after_the_other_are_two_people() -> None:
    """Who tells of them says nothing of places, and that the first leaves."""

    async def story(eyes: Eyes) -> None:
        eyes.see()
        async with perceive("cleo", hub=eyes.hub) as cleo:
            await cleo.say("Hello there.")
        await asyncio.sleep(1.0)
        async with perceive("ben", hub=eyes.hub) as ben:
            await ben.say("Good day.")
            assert [id for id, _ in await eyes.people()] == ["ben"]

    play(story)
