"""Pipecat's own test harness with a robot in it: what its pipeline and its context are told of what was said."""

import asyncio
import warnings
from collections.abc import AsyncIterator
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
        from pipecat.frames.frames import (
            BotStartedSpeakingFrame,
            BotStoppedSpeakingFrame,
            Frame,
            InterruptionFrame,
            LLMFullResponseEndFrame,
            LLMFullResponseStartFrame,
            LLMTextFrame,
            TTSSpeakFrame,
            TTSTextFrame,
        )
        from pipecat.pipeline.pipeline import Pipeline
        from pipecat.processors.aggregators.llm_context import LLMContext
        from pipecat.processors.aggregators.llm_response_universal import LLMContextAggregatorPair
        from pipecat.tests.utils import SleepFrame, run_test
    except ModuleNotFoundError:
        pytest.skip("needs the extra `pipecat`", allow_module_level=True)

from engage_hri.services.frameworks.pipecat import RobotSpeech

WHOLE = "Hello there. Please take the blue square and put it down."


def response(*pieces: str) -> list[Frame]:
    return [LLMFullResponseStartFrame(), *map(LLMTextFrame, pieces), LLMFullResponseEndFrame()]


BLUE = response("Hello th", "ere. Please ta", "ke [blue-", "square] and put it", " down.")
LONG = response("one two three four five six seven eight nine ten. And ", "so on.")


class Heard:
    """One who only listens to the robot's bus."""

    def __init__(self, robot: Robot) -> None:
        self._feed = robot.words()

    def words(self) -> list[str]:
        told = []
        while (received := self._feed._subscription.take()) is not None:
            told += [received.message.word] if hasattr(received.message, "word") else []
        return told


class Scene:
    def __init__(self, robot: Robot, hub: MemoryHub) -> None:
        self.hub, self.robot, self.heard = hub, robot, Heard(robot)
        self.speech, self.context = RobotSpeech(robot), LLMContext()
        self.told: list[Summary] = []
        self.down: list[Any] = []
        self.up: list[Any] = []
        self.speech.add_event_handler("on_turn_over", self._over)

    async def _over(self, speech: RobotSpeech, told: Summary) -> None:
        self.told.append(told)

    async def play(self, *frames: Frame) -> None:
        """Play frames with the harness. The context is that of the model, behind the robot."""
        keeps = LLMContextAggregatorPair(self.context).assistant()
        down, up = await run_test(Pipeline([self.speech, keeps]), frames_to_send=frames)
        self.down, self.up = [*down], [*up]

    async def play_alone(self, *frames: Frame) -> None:
        """The same without a context, which keeps the words for itself."""
        down, up = await run_test(self.speech, frames_to_send=frames)
        self.down, self.up = [*down], [*up]

    def kinds(self, frames: list[Any], *kinds: type) -> list[str]:
        return [type(each).__name__ for each in frames if isinstance(each, kinds)]

    @property
    def kept(self) -> list[str]:
        return [each["content"] for each in self.context.get_messages() if each["role"] == "assistant"]


@asynccontextmanager
async def scene() -> AsyncIterator[Scene]:
    async with MemoryHub() as hub, whole_robot(hub) as robot:
        yield Scene(robot, hub)


async def test_a_response_is_spoken_and_its_words_go_on_as_they_sound() -> None:
    async with scene() as here:
        await here.play_alone(*BLUE)

        assert [each.text for each in here.down if isinstance(each, TTSTextFrame)] == WHOLE.split()
        assert here.heard.words() == WHOLE.split()
    ends = (LLMFullResponseStartFrame, LLMFullResponseEndFrame, BotStartedSpeakingFrame, BotStoppedSpeakingFrame)
    assert here.kinds(here.down, *ends) == [
        "LLMFullResponseStartFrame", "BotStartedSpeakingFrame", "BotStoppedSpeakingFrame", "LLMFullResponseEndFrame"
    ]  # fmt: skip
    assert here.kinds(here.up, *ends) == ["BotStartedSpeakingFrame", "BotStoppedSpeakingFrame"]
    assert not here.kinds(here.down, LLMTextFrame)
    assert [each.object for each in here.told[0].references] == ["blue-square"]
    assert here.told[0].references[0].by == "a look"


async def test_it_points_where_the_text_is_certain() -> None:
    async with scene() as here:
        await here.play(*response("Please take [blue-", "square!]."))

    assert [(each.object, each.by) for each in here.told[0].references] == [("blue-square", "pointing")]
    assert here.kept == [here.told[0].said]


async def test_the_context_has_what_was_heard_of_several_turns() -> None:
    async with scene() as here:
        await here.play(*BLUE, *response("Thank you."), TTSSpeakFrame("Goodbye."))

    assert here.kept == [WHOLE, "Thank you.", "Goodbye."]
    assert [each.status for each in here.told] == ["done"] * 3


@pytest.mark.parametrize("after", [0.17 * number for number in range(16)])
async def test_an_interruption_ends_at_a_word_and_the_context_has_no_word_that_nobody_heard(after: float) -> None:
    async with scene() as here:
        await here.play(
            *LONG, SleepFrame(sleep=after), InterruptionFrame(), SleepFrame(sleep=1.0), *response("Sorry.")
        )

        heard = " ".join(here.heard.words())
    said = here.told[0].said if len(here.told) > 1 else ""
    assert f"{said} Sorry.".strip() == heard
    assert here.kept == [*filter(None, [said]), "Sorry."]
    assert after == 0.0 or "on." not in said  # at once, it may come before the text
    assert after < 1.0 or here.told[0].cut_short


async def test_a_person_who_takes_the_floor_interrupts_the_pipeline() -> None:
    async with scene() as here:
        person = here.hub.join("perception-too")

        async def speak() -> None:
            await asyncio.sleep(3.0)
            person.publish(keys.PERCEIVED_ACTION, ActionBegan(actor="human", action="speak", at=person.stamp()))

        speaking = asyncio.create_task(speak())
        await here.play(*LONG, SleepFrame(sleep=6.0))
        await speaking
        await person.leave()

        heard = " ".join(here.heard.words())
    assert here.kinds(here.up, InterruptionFrame) == ["InterruptionFrame"]
    assert here.kept == [here.told[0].said] == [heard]
    assert here.told[0].cut_short
