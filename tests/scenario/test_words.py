"""Words of people, with a whole robot: from who says them to what its manager is told."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import partial
from typing import Any

import pytest
from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.fragments import FragmentOutcome, TurnFragment
from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import ActionBegan, ActionEnded, Utterance
from engage_hri.schemas.recognition import ConnectionEvent
from engage_hri.schemas.summary import summary
from engage_hri.schemas.world import World
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.language_models import perform_call
from engage_hri.services.client.people.perceive import perceive
from engage_hri.services.client.people.perceived_person import PerceivedPerson
from engage_hri.services.client.robot import Robot, connect
from engage_hri.services.commandline.embedding import play_tangram
from engage_hri.services.commandline.shell import roster
from engage_hri.services.commandline.shell.config import Config, load
from engage_hri.services.console.follow import following
from engage_hri.services.generation.turns.outcomes import WORDS_PATIENCE
from engage_hri.services.runtime.service import running
from engage_hri.services.simulation.still import show_world, table_world

TABLE = table_world()
EMPTY = World(entities=tuple(each for each in TABLE.entities if each.kind not in ("person", "hand")))


@asynccontextmanager
async def robot_in(hub: MemoryHub, world: World = EMPTY, *, is_attentive: bool = False) -> AsyncIterator[Robot]:
    config = Config()
    services = {name: roster.service(name, config) for name in keys.SERVICES}
    perception = partial(show_world, world=world, is_attentive=is_attentive)
    async with running(hub, {"simulation": perception, **services}), connect(hub=hub) as robot:
        yield robot


def asks(id: str, text: str = "Which one do you want?", **fields: Any) -> dict[str, Any]:
    return {"id": id, "addressee": "ann", "behaviors": [{"type": "speech", "id": "s", "text": text}], **fields}


async def turn_over(robot: Robot) -> None:
    """Wait until the robot has fallen silent."""
    with robot.actions() as actions:
        async for each in actions:
            if isinstance(each, ActionEnded) and each.actor == "robot" and each.action == "speak":
                return


async def answered(robot: Robot, ann: PerceivedPerson, fragment: dict[str, Any], answer: Any) -> FragmentOutcome:
    """Perform a turn, which is answered when it is over."""
    performing = asyncio.create_task(robot.perform(fragment, await_answer=True))
    await turn_over(robot)
    await answer()
    return await performing


async def test_a_manager_gets_the_words_that_answer_its_question(hub: MemoryHub) -> None:
    async with robot_in(hub) as robot, perceive("ann", hub=hub) as ann:

        async def answer() -> None:
            await asyncio.sleep(0.5)
            await ann.say("the blue one", delay=1.5)

        told = summary(await answered(robot, ann, asks("q"), answer))

    assert (told.answer, told.answered_by, round(told.answer_delay or 0.0, 2)) == ("speak", "ann", 0.5)
    assert [(each.who, each.text) for each in told.heard] == [("ann", "the blue one")]
    assert told.text.endswith('Answered by ann: speak, after 0.5 s. Heard from ann: "the blue one"')


async def test_words_that_never_come_are_waited_for_only_so_long(hub: MemoryHub) -> None:
    patience = WORDS_PATIENCE
    async with robot_in(hub) as robot, perceive("ann", hub=hub) as ann:

        async def answer() -> None:
            stamp = hub.join("microphone").stamp()
            ann.tell(Utterance(actor="ann", id="u", text="", began=stamp, at=stamp, final=False))
            ann.begin("speak")
            await asyncio.sleep(1.0)
            ann.end("speak")
            silent.append(asyncio.get_running_loop().time())

        silent: list[float] = []
        told = summary(await answered(robot, ann, asks("q"), answer))
        waited = asyncio.get_running_loop().time() - silent[0]

    assert (told.answer, told.heard) == ("speak", ())
    assert waited == pytest.approx(patience, abs=0.05)


async def test_who_has_lost_the_microphone_is_waited_for_once(hub: MemoryHub) -> None:
    patience = WORDS_PATIENCE
    async with robot_in(hub) as robot, perceive("ann", hub=hub) as ann:
        await ann.look_at("robot")
        await ann.say("hello")
        waited: list[float] = []
        for number in range(2):
            ended: list[float] = []

            async def answer(ended: list[float] = ended) -> None:
                ann.begin("speak")
                await asyncio.sleep(1.0)
                ann.end("speak")
                ended.append(asyncio.get_running_loop().time())

            await answered(robot, ann, asks(f"q{number}"), answer)
            waited.append(asyncio.get_running_loop().time() - ended[0])
            await asyncio.sleep(5.0)

    assert waited == [pytest.approx(patience, abs=0.05), 0.0]  # the second time it has not waited for the end


async def test_nobody_waits_for_words_where_nobody_tells_any(hub: MemoryHub) -> None:
    async with robot_in(hub) as robot, perceive("ann", hub=hub) as ann:
        await ann.look_at("robot")

        async def answer() -> None:
            began.append(asyncio.get_running_loop().time())
            ann.begin("speak")

        began: list[float] = []
        await answered(robot, ann, asks("q"), answer)
        assert asyncio.get_running_loop().time() == pytest.approx(began[0], abs=0.05)


async def test_a_typed_line_answers_too(hub: MemoryHub) -> None:
    async with robot_in(hub) as robot, perceive("ann", hub=hub) as ann:

        async def answer() -> None:
            await asyncio.sleep(1.0)
            await ann.type("blue")

        told = summary(await answered(robot, ann, asks("q"), answer))

    assert (told.answer, told.answered_by, told.answer_delay) == ("speak", "ann", 1.0)
    assert [each.text for each in told.heard] == ["blue"]


@pytest.mark.parametrize(("within", "answer"), [(None, "none"), (10.0, "speak")])
async def test_a_fragment_says_how_long_its_answer_may_take(
    hub: MemoryHub, within: float | None, answer: str
) -> None:
    async with robot_in(hub) as robot, perceive("ann", hub=hub) as ann:

        async def think() -> None:
            await asyncio.sleep(7.0)
            await ann.say("the blue one")

        told = summary(await answered(robot, ann, asks("q", within=within), think))

    assert told.answer == answer
    assert told.answer_delay == (7.0 if within else told.answer_delay)


async def test_a_tool_call_says_so_as_well(hub: MemoryHub) -> None:
    call = {"turn_status": "full", "addressee": "ann", "within": 6, "parts": [{"say": "Which one?"}]}
    async with robot_in(hub) as robot, perceive("ann", hub=hub) as ann:
        calling = asyncio.create_task(perform_call(robot, call, await_answer=True))
        await turn_over(robot)
        await asyncio.sleep(4.0)
        await ann.say("blue")
        told = await calling

    assert (told.answer, [each.text for each in told.heard]) == ("speak", ["blue"])


async def test_what_everybody_says_is_told_once_in_order_whoever_it_is(hub: MemoryHub) -> None:
    async with robot_in(hub) as robot, perceive("ann", hub=hub) as ann, perceive("bob", hub=hub) as bob:
        await ann.say("hello")

        async def talk() -> None:
            await asyncio.gather(ann.say("the red one", delay=1.0), bob.say("no the blue one"))

        first = await answered(robot, ann, asks("q"), talk)
        await bob.say("or both")
        await asyncio.sleep(5.0)
        second = await answered(robot, ann, asks("r", "Thanks."), partial(ann.nod, 0.5))

    assert [(each.actor, each.text) for each in first.heard] == [
        ("ann", "hello"), ("ann", "the red one"), ("bob", "no the blue one"),
    ]  # fmt: skip
    assert [(each.actor, each.text) for each in second.heard] == [("bob", "or both")]


async def test_a_manager_that_does_not_wait_is_told_with_its_next_turn(hub: MemoryHub) -> None:
    async with robot_in(hub) as robot, perceive("ann", hub=hub) as ann:
        first = await robot.perform(asks("q"))
        await ann.say("the red one")
        await asyncio.sleep(3.0)
        second = await robot.perform(asks("r", "I see."))
        third = await robot.perform(asks("s", "Well."))

    assert first.heard == ()
    assert [each.text for each in second.heard] == ["the red one"]
    assert third.heard == ()


async def test_utterances_can_be_followed_as_they_come(hub: MemoryHub) -> None:
    async with robot_in(hub) as robot, perceive("ann", hub=hub) as ann:
        with robot.utterances() as words:
            await ann.say("yes please", to="robot")
            told = [each for _ in range(4) if (each := await words.next(0.0)) is not None]

    assert [(each.text, each.final, each.to) for each in told] == [
        ("", False, ("robot",)), ("yes", False, ("robot",)), ("yes please", False, ("robot",)),
        ("yes please", True, ("robot",)),
    ]  # fmt: skip


async def test_what_a_person_does_ends_when_its_program_is_killed(hub: MemoryHub) -> None:
    async with robot_in(hub) as robot, perceive("ann", hub=hub, name="camera") as ann:
        with robot.connection_events("ann", "adjacency_pair") as events:
            ann.begin("speak")
            await events.next(1.0)
            await asyncio.sleep(2.0)
            hub.kill("camera")
            gone = asyncio.get_running_loop().time()
            ended = await events.next(60.0)

    assert ended is not None
    assert (ended.state, ended.at.seconds - gone) == ("withdrawn", pytest.approx(2.0, abs=0.01))


@pytest.mark.parametrize("perception", ["symbolic", "raw"])
async def test_all_that_the_simulated_person_says_are_words_of_events(perception: str) -> None:
    """Told as actions, or only as levels of a voice."""
    settings = ["simulation.human=stochastic", f"simulation.perception={perception}", "simulation.seed=4"]
    told: list[Message] = []
    await play_tangram(load(settings=settings), (lambda message, at: told.append(message),))

    last = {each.id: each for each in told if isinstance(each, ConnectionEvent)}
    said = [each.text for each in told if isinstance(each, Utterance) and each.final]
    assert len(said) >= 3
    assert sorted(each.words for each in last.values() if each.words) == sorted(said)


# -- perceive() and the simulated person -----------------------------------------------------------------------

STORY = (
    TurnFragment,
    {"id": "show", "behaviors": [
        {"type": "speech", "id": "s", "text": "Look at"}, {"type": "reference", "id": "r", "target": "blue-square"},
    ]},
    {"id": "ask", "behaviors": [{"type": "speech", "id": "s", "text": "Do you see it?"}]},
    {"id": "tell", "behaviors": [
        {"type": "speech", "id": "s", "text": "And here is"}, {"type": "reference", "id": "r", "target": "trapezoid",
         "minimum_reliability": 0.95}, {"type": "speech", "id": "t", "text": "for you."},
    ]},
)[1:]  # fmt: skip


async def played(hub: MemoryHub, robot: Robot) -> list[Message]:
    """Everything that is told while the story is played."""
    told: list[Message] = []
    async with following(hub.join("log"), [lambda message, at: told.append(message)]):
        for fragment in STORY:
            await robot.perform({"addressee": "human", **fragment}, await_answer=True)
        await asyncio.sleep(5.0)
    return told


def events(told: list[Message]) -> list[ConnectionEvent]:
    """The connection events, without what names the life of recognition."""
    return [
        replace(each, id=each.id.partition("-")[2])
        for each in told
        if isinstance(each, ConnectionEvent)
    ]  # fmt: skip


async def test_perceive_tells_of_a_person_as_the_simulation_does() -> None:
    """The attentive person plays the story; what it did is then done by `perceive`, at the same times."""
    async with MemoryHub() as hub, robot_in(hub, TABLE, is_attentive=True) as robot:
        simulated = await played(hub, robot)
    deeds = [each for each in simulated if isinstance(each, ActionBegan | ActionEnded) and each.actor == "human"]
    words = [each for each in simulated if isinstance(each, Utterance)]
    assert {each.action for each in deeds} == {"look", "nod", "speak"}
    assert [each.text for each in words if each.final] == ["Yes."]

    loop, offset = asyncio.get_running_loop(), asyncio.get_running_loop().time()

    async def act(person: PerceivedPerson) -> None:
        steps: list[Any] = sorted([*words, *deeds], key=lambda each: each.at.seconds)
        for each in steps:
            if (left := offset + each.at.seconds - loop.time()) > 0:
                await asyncio.sleep(left)
            match each:
                case Utterance():
                    began, at = (replace_clock(stamp, offset) for stamp in (each.began, each.at))
                    ended = None if each.ended is None else replace_clock(each.ended, offset)
                    person.tell(replace(each, began=began, at=at, ended=ended))
                case ActionBegan():
                    person.begin(each.action, *each.targets)
                case ActionEnded() if each.action != "look":  # the next look ends it
                    person.end(each.action, *each.targets)

    async with (
        MemoryHub() as hub,
        robot_in(hub, TABLE) as robot,
        perceive("human", hub=hub, position=None) as person,
        asyncio.TaskGroup() as tasks,
    ):
        acting = tasks.create_task(act(person))
        perceived = await played(hub, robot)
        acting.cancel()

    def shifted(event: ConnectionEvent) -> tuple[Any, ...]:
        at, started = event.at.seconds - offset, event.started.seconds - offset
        return (*summed(event), round(at, 3), round(started, 3))

    def summed(event: ConnectionEvent) -> tuple[Any, ...]:
        delay = None if event.delay is None else round(event.delay, 3)
        return event.id, event.kind, event.initiator, event.state, event.response, event.words, event.retold, delay

    expected = [
        (*summed(each), round(each.at.seconds, 3), round(each.started.seconds, 3)) for each in events(simulated)
    ]
    assert len(expected) > 20
    assert [shifted(each) for each in events(perceived)] == expected


def replace_clock(stamp: Any, offset: float) -> Any:
    return type(stamp)(stamp.clock, stamp.seconds + offset)
