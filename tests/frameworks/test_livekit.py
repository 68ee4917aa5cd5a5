"""Sessions of LiveKit Agents, played as its own tests are (`session.run`), whose output is a robot."""

import asyncio
import warnings
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from typing import Any

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.perception import ActionBegan
from engage_hri.schemas.summary import Summary
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.robot import Robot
from tests.cancelling import whole_robot

with warnings.catch_warnings():
    warnings.simplefilter("ignore", DeprecationWarning)  # of modules that it loads
    try:
        from livekit.agents import Agent, AgentSession, llm
    except ModuleNotFoundError:
        pytest.skip("needs the extra `livekit`", allow_module_level=True)

from engage_hri.services.frameworks.livekit import RobotOutput

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::ResourceWarning")
BLUE = ("Hello th", "ere. Please ta", "ke [blue-", "square] and put it", " down.")
LONG = ("one two three four five six seven eight nine ten. And ", "so on.")


class WrittenModel(llm.LLM):
    """A model that writes what stands there, one reply after the other."""

    def __init__(self, replies: Sequence[Sequence[str]]) -> None:
        super().__init__()
        self.replies = [*replies]

    def chat(self, *, chat_ctx: Any, tools: Any = None, conn_options: Any = None, **more: Any) -> Any:
        return WrittenReply(self, chat_ctx=chat_ctx, tools=tools or [], conn_options=conn_options)


class WrittenReply(llm.LLMStream):
    async def _run(self) -> None:
        for piece in self._llm.replies.pop(0):
            delta = llm.ChoiceDelta(role="assistant", content=piece)
            self._event_ch.send_nowait(llm.ChatChunk(id="reply", delta=delta))
            await asyncio.sleep(0.05)


class Scene:
    """told: what became of each turn. heard: every word of the robot, as a listener of the bus has it."""

    def __init__(self, robot: Robot, hub: MemoryHub, session: Any) -> None:
        self.robot, self.hub, self.session = robot, hub, session
        self.told: list[Summary] = []
        self.words = robot.words()
        self.states: list[str] = []
        session.on("agent_state_changed", lambda event: self.states.append(event.new_state))

    def heard(self) -> str:
        found = []
        while (received := self.words._subscription.take()) is not None:
            found += [received.message.word] if hasattr(received.message, "word") else []
        return " ".join(found)

    @property
    def history(self) -> list[tuple[str, bool]]:
        items = [each for each in self.session.history.items if each.type == "message" and each.role == "assistant"]
        return [(each.text_content, each.interrupted) for each in items]


@asynccontextmanager
async def scene(*replies: Sequence[str]) -> AsyncIterator[Scene]:
    async with MemoryHub() as hub, whole_robot(hub) as robot:
        output = RobotOutput(robot, on_turn_over=lambda told: here.told.append(told))
        session: Any = AgentSession(llm=WrittenModel(replies), tts=output.tts)
        here = Scene(robot, hub, session)
        output.attach(session)
        await session.start(Agent(instructions="You are a robot."))
        try:
            yield here
        finally:
            await session.aclose()
            await output.aclose()


async def test_a_reply_is_said_by_the_robot_which_looks_where_it_refers_to() -> None:
    async with scene(BLUE) as here:
        result = await here.session.run(user_input="What shall I do?")
        result.expect.next_event().is_message(role="assistant")
        heard = here.heard()

    assert heard == "Hello there. Please take the blue square and put it down."
    assert here.history == [("".join(BLUE), False)]
    assert here.told[0].status == "done"
    assert [(each.object, each.by) for each in here.told[0].references] == [("blue-square", "a look")]
    assert here.states[-2:] == ["speaking", "listening"]


async def test_it_points_where_the_text_is_certain() -> None:
    async with scene(("Please take [blue-", "square!].")) as here:
        await here.session.run(user_input="What shall I do?")

    assert [(each.object, each.by) for each in here.told[0].references] == [("blue-square", "pointing")]


@pytest.mark.parametrize("after", [0.23 * number for number in range(1, 14)])
async def test_the_history_of_an_interrupted_reply_has_what_was_said_and_no_more(after: float) -> None:
    async with scene(LONG, ("Sorry.",)) as here:
        running = here.session.run(user_input="Count.")
        await asyncio.sleep(after)
        await here.session.interrupt()
        await running
        said = here.heard()
        await here.session.run(user_input="Thank you.")

    assert here.history == [*([(said, True)] if said else []), ("Sorry.", False)]
    assert here.told[0].said == said
    assert here.told[0].cut_short
    assert "on." not in said
    assert after < 1.0 or said.startswith("one two")


async def test_a_person_who_takes_the_floor_interrupts_the_session() -> None:
    async with scene(LONG) as here:
        running = here.session.run(user_input="Count.")
        await asyncio.sleep(2.5)
        person = here.hub.join("perception-too")
        person.publish(keys.PERCEIVED_ACTION, ActionBegan(actor="human", action="speak", at=person.stamp()))
        await running
        await person.leave()

    said = here.told[0].said
    assert here.history == [(said, True)]
    assert said == here.heard()
    assert said.startswith("one two")
    assert "on." not in said


async def test_a_pause_of_the_session_holds_the_robot_at_a_word() -> None:
    async with scene(LONG) as here:
        running = here.session.run(user_input="Count.")
        await asyncio.sleep(2.0)
        here.session.output.audio.pause()
        await asyncio.sleep(1.0)
        before = here.heard()
        await asyncio.sleep(3.0)
        during = here.heard()
        here.session.output.audio.resume()
        await running
        after = here.heard()

    assert during == ""
    assert f"{before} {after}" == "".join(LONG)
    assert here.history == [("".join(LONG), False)]
