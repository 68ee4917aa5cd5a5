"""A conversation that a model leads, on a whole robot: what is said, when, which tools run, what the history has."""

import asyncio
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from itertools import pairwise
from typing import Any

import pytest

from engage_hri import InputRefused, PerceivedPerson, embedded, perceive
from engage_hri.schemas.fragments import TurnClosed
from engage_hri.schemas.perception import ActionBegan
from engage_hri.services.client.conversation import tools
from engage_hri.services.client.conversation.dialects import ModelFailed
from engage_hri.services.client.conversation.history import Entry, PersonSaid, RobotSaid
from engage_hri.services.client.conversation.models import PAUSES, model_of
from engage_hri.services.client.conversation.talk import PHRASES, SAYS_SO_AFTER, Conversation
from engage_hri.services.client.conversation.tools import ToolSource
from engage_hri.services.client.feeds import Feed
from engage_hri.services.commandline.embedding import EmbeddedRobot
from tests.client.conversation.servers import Script, Written

FORMS = ("openai", "anthropic", "ollama")
WAITING, SORRY = PHRASES["en"]
LONG = "One two three four five six seven eight nine ten eleven twelve thirteen fourteen fifteen."


async def until_silence(feed: Feed[TurnClosed]) -> AsyncIterator[TurnClosed]:
    while (told := await feed.next(0.0)) is not None:
        yield told


async def weather(city: str) -> str:
    """Tell the weather of a city."""
    await asyncio.sleep(0.5)
    return f"12 degrees in {city}"


def line(entry: Entry) -> tuple[str, str]:
    return (entry.who, entry.text) if isinstance(entry, PersonSaid) else ("robot", entry.said)


class Scene:
    """A robot, ann, and a conversation of a model that is a script."""

    def __init__(self, robot: EmbeddedRobot, ann: PerceivedPerson, talk: Conversation, model: Written) -> None:
        self.robot, self.ann, self.talk, self.model = robot, ann, talk, model

    async def says(self, text: str, wait: float = 8.0) -> None:
        await self.ann.say(text, delay=0.2)
        await asyncio.sleep(wait)

    @property
    def lines(self) -> list[tuple[str, str]]:
        return [
            (each.who, each.text) if isinstance(each, PersonSaid) else ("robot", each.said) for each in self.history
        ]

    @property
    def history(self) -> Sequence[Entry]:
        return self.talk.history

    @property
    def spoke(self) -> list[RobotSaid]:
        return [each for each in self.history if isinstance(each, RobotSaid)]


@asynccontextmanager
async def scene(
    *scripts: Script, form: str = "openai", tools: Sequence[ToolSource] = (weather,), **more: Any
) -> AsyncIterator[Scene]:
    async with embedded(human="none") as robot, perceive("ann", hub=robot.hub) as ann:
        await ann.look_at(robot.id)
        await asyncio.sleep(2.0)
        model = Written(scripts, form)
        async with Conversation(robot, model, tools=tools, **more) as talk:
            yield Scene(robot, ann, talk, model)


@pytest.mark.parametrize("form", FORMS)
async def test_words_calls_of_ours_and_of_others_are_one_answer(form: str) -> None:
    ours = ("perform_turn_fragment", {"turn_status": "full", "parts": [{"say": "Look at"}, {"refer": "red-square"}]})
    asked = ("weather", {"city": "Ulm"})
    async with scene(("Let me see.", asked), ("It is 12 degrees there.", ours), form=form) as here:
        with here.robot.turns() as turns:
            await here.says("How warm is it in Ulm?", 12.0)
            closed = [turn async for turn in until_silence(turns)]

    assert here.lines == [
        ("ann", "How warm is it in Ulm?"), ("robot", "Let me see."),
        ("robot", "It is 12 degrees there. Look at the red square"),
    ]  # fmt: skip
    one, other = here.spoke
    assert [(each.name, each.result) for each in one.calls] == [("weather", "12 degrees in Ulm")]
    assert '"object":"red-square"' in other.calls[0].result
    assert '"heard"' not in other.calls[0].result
    assert len(here.model.asked) == 2
    assert "12 degrees in Ulm" in str(here.model.asked[1]["messages"])
    assert [turn.status for turn in closed] == ["done"]
    assert here.talk.problems == []


async def test_the_robot_looks_at_who_is_answered_before_its_first_word() -> None:
    async with scene(("Good morning.",)) as here:
        async with here.robot.inhibit_gaze("target", target="table"):
            await asyncio.sleep(1.0)
        began: list[tuple[str, tuple[str, ...]]] = []
        with here.robot.actions() as actions:
            await here.says("Good morning, robot.")
            while (action := await actions.next(0.0)) is not None:
                if isinstance(action, ActionBegan) and action.actor == here.robot.id:
                    began.append((action.action, action.targets))

    looks = [targets for kind, targets in began[: began.index(("speak", ()))] if kind == "look"]
    assert looks[-1] == ("ann",)


async def test_who_interrupts_is_answered_and_the_model_learns_where_it_was_cut() -> None:
    async with scene((LONG,), ("Yes? I am listening.",)) as here:
        await here.says("Count, please.", 2.5)
        await here.says("Stop, please. That is enough.", 8.0)

    first, second = here.spoke
    assert first.is_cut
    assert f"{first.said} {first.unsaid}" == LONG
    assert second.said == "Yes? I am listening."
    assert [who for who, _ in here.lines] == ["ann", "robot", "ann", "robot"]
    told = here.model.asked[1]["messages"]
    assert told[2] == {"role": "assistant", "content": first.said}
    assert f'have not said: "{first.unsaid}"' in told[3]["content"]
    assert "Stop, please." in told[3]["content"]


async def test_a_listeners_uh_huh_is_in_the_history_and_answered_by_nothing() -> None:
    async with scene((LONG,), ("I should not be asked.",)) as here:
        await here.says("Count, please.", 2.5)
        await here.says("Uh-huh.", 10.0)

    assert [each.is_sign for each in here.history if isinstance(each, PersonSaid)] == [False, True]
    assert [each.said for each in here.spoke] == [LONG]


async def test_who_goes_on_before_the_robot_speaks_is_heard_to_the_end_and_answered_once() -> None:
    async with scene(("Where would you like it?",), ("The blue one it is.",)) as here:
        here.model._seconds = 0.5
        await here.ann.say("I would like a square.", delay=0.1)
        await asyncio.sleep(1.0)
        await here.says("The blue one, I mean.", 12.0)

    assert here.lines == [
        ("ann", "I would like a square."), ("ann", "The blue one, I mean."), ("robot", "The blue one it is."),
    ]  # fmt: skip


async def test_while_a_tool_runs_the_robot_says_so_and_keeps_its_eyes_on_the_person() -> None:
    async def slow() -> str:
        """Take long."""
        await asyncio.sleep(12.0)
        return "done"

    looks: list[tuple[float, tuple[str, ...]]] = []
    async with scene(("I look.", ("slow", {})), ("Here it is.",), tools=[slow]) as here:

        async def follow() -> None:
            with here.robot.actions() as actions:
                async for action in actions:
                    if isinstance(action, ActionBegan) and action.actor == here.robot.id and action.action == "look":
                        looks.append((here.robot.now(), action.targets))

        following = asyncio.create_task(follow())
        began = here.robot.now()
        await here.says("Please look it up.", 18.0)
        following.cancel()
        await asyncio.gather(following, return_exceptions=True)

    assert [each.said for each in here.spoke] == [f"I look. {WAITING} {WAITING}", "Here it is."]
    assert [targets for _, targets in looks][-1] == ("ann",)
    gone = [later - at for (at, targets), (later, _) in pairwise(looks) if at > began and targets != ("ann",)]
    assert max(gone, default=0.0) < 3.0, "it looks away now and then, as people do"
    assert SAYS_SO_AFTER == 2.0


async def test_a_tool_that_holds_up_the_program_is_told(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = iter([1.0, 1.1, 2.0, 3.5])
    monkeypatch.setattr(tools, "monotonic", lambda: next(clock))

    def weather(city: str) -> str:
        """The weather in a city."""
        return f"fair in {city}"

    tool = tools.function_tool(weather)

    assert await tool.call({"city": "Oslo"}) == "fair in Oslo"
    assert not caplog.records
    await tool.call({"city": "Oslo"})
    assert "the tool weather has held up the whole program for 1.5 s: make it `async def`" in caplog.text


async def test_who_speaks_while_a_tool_runs_ends_it() -> None:
    ended: list[str] = []

    async def slow() -> str:
        """Take long."""
        try:
            await asyncio.sleep(60.0)
        finally:
            ended.append("ended")
        return "done"

    async with scene(("I look.", ("slow", {})), ("As you like.",), tools=[slow]) as here:
        await here.says("Please look it up.", 3.0)
        await here.says("Never mind, I know it now.", 8.0)

    assert ended == ["ended"]
    assert here.spoke[-1].said == "As you like."
    assert "interrupted" in here.spoke[0].calls[0].result


async def test_a_tool_that_fails_or_is_not_there_or_gets_nonsense_is_told_to_the_model() -> None:
    def fails(number: int) -> str:
        """Fail."""
        raise OSError("no disk")

    calls = (("fails", {"number": 1}), ("nothing", {}), ("fails", {"number": "x"}))
    async with scene(calls, ("It does not work.",), tools=[fails]) as here:
        await here.says("Try it.")

    results = [each.result for each in here.spoke[0].calls]
    assert results[0] == "error: no disk"
    assert results[1] == "error: there is no tool 'nothing'"
    assert results[2].startswith("error: Expected `int`, got `str`")
    assert here.lines[-1] == ("robot", "It does not work.")


async def test_a_call_of_the_robots_own_tool_that_is_wrong_is_handed_back_at_once() -> None:
    wrong = ("perform_turn_fragment", {"turn_status": "full", "parts": [{"tell": "x"}]})
    async with scene((wrong,), ("Hello, then.",)) as here:
        await here.says("Hello.")

    assert '"refused"' in here.spoke[0].calls[0].result
    assert here.lines[-1] == ("robot", "Hello, then.")


async def test_of_two_people_each_is_spoken_to_and_named_and_what_they_say_to_another_is_theirs() -> None:
    async with scene(("Hello ann.",), ("Hello ben.",)) as here, perceive("ben", hub=here.robot.hub) as ben:
        await ben.look_at(here.robot.id)
        await here.says("Good morning, robot.")
        await ben.say("Me, too!", to=[here.robot.id], delay=0.2)
        await asyncio.sleep(8.0)
        await ben.say("Are you coming?", to=["ann"], delay=0.2)
        await asyncio.sleep(8.0)

    assert [each.to for each in here.spoke] == ["ann", "ben"]
    assert "ann: Good morning, robot." in str(here.model.asked[1]["messages"])
    assert len(here.model.asked) == 2
    assert here.lines[-1] == ("ben", "Are you coming?")


async def test_a_function_leads_it_without_any_network_and_may_speak_first() -> None:
    def rules(history: Sequence[Entry]) -> str:
        last = history[-1] if history else None
        return f"You say: {last.text}" if isinstance(last, PersonSaid) else "Hello there."

    async with embedded(human="none") as robot, perceive("ann", hub=robot.hub) as ann:
        await ann.look_at(robot.id)
        told: list[Entry] = []

        async def follow(talk: Conversation) -> None:
            async for entry in talk.entries():
                told.append(entry)

        async with Conversation(robot, rules) as talk:
            following = asyncio.create_task(follow(talk))
            talk.answer("ann")
            await asyncio.sleep(4.0)
            await ann.say("It rains.", delay=0.1)
            await asyncio.sleep(6.0)
        await following

    assert [each.text if isinstance(each, PersonSaid) else each.said for each in told] == [
        "Hello there.", "It rains.", "You say: It rains.",
    ]  # fmt: skip
    assert told == talk.history


class Failing(Written):
    """Fails so many times before it answers."""

    def __init__(self, times: int, scripts: Sequence[Script], *, may_retry: bool = True) -> None:
        super().__init__(scripts)
        self.times, self.may_retry = times, may_retry

    async def _bytes(self, body: dict[str, Any]) -> Any:
        if self.times > 0:
            self.times -= 1
            raise ModelFailed(ModelFailed.__mro__[1]("down").fault, may_retry=self.may_retry)  # type: ignore[call-arg]
        async for data in super()._bytes(body):
            yield data


@pytest.mark.parametrize(
    ("times", "may_retry", "said"),
    [(2, True, "Here I am."), (3, True, PHRASES["en"][1]), (1, False, PHRASES["en"][1])],
)
async def test_a_model_that_fails_is_asked_again_and_then_the_robot_says_so(
    times: int, may_retry: bool, said: str
) -> None:
    async with embedded(human="none") as robot, perceive("ann", hub=robot.hub) as ann:
        await ann.look_at(robot.id)
        async with Conversation(robot, Failing(times, [("Here I am.",)], may_retry=may_retry)) as talk:
            await ann.say("Hello?", delay=0.1)
            await asyncio.sleep(5.0 + sum(PAUSES))

    assert [each.said for each in talk.history if isinstance(each, RobotSaid)] == [said]
    assert bool(talk.problems) == (said != "Here I am.")


@pytest.mark.parametrize("name", ["gpt", "openai:", "mistral:x", "ftp://x/y", 3])
def test_what_names_no_model_is_refused(name: Any) -> None:
    with pytest.raises(InputRefused, match="no model"):
        model_of(name)


async def test_a_key_is_sent_where_it_belongs_and_shown_nowhere(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", "sk-openai")
    monkeypatch.setenv("ENGAGE_MODEL_KEY", "sk-own")
    own, other, none = (model_of(each) for each in ("openai:m", "openai:m@http://127.0.0.1:9/v1", "ollama:m"))

    assert [each._key for each in (own, other, none)] == ["sk-openai", "sk-own", ""]  # type: ignore[attr-defined]
    assert other._without_key("401: sk-own is no key") == "401: *** is no key"  # type: ignore[attr-defined]
    assert "sk-" not in repr(own) + repr(other)
