"""A conversation that a model leads: it hears people, answers, calls tools side by side, and knows what was said.

    async with connect() as robot, Conversation(robot, "ollama:qwen3", tools=[weather]) as talk:
        await talk.forever()

Each turn of a person that is for the robot is answered by one turn of the robot, in which the model may write several
messages, with calls of tools between them. Words are spoken as they are written, those in calls of the robot's own
tool, too. Who takes the floor ends the turn, and with it the model's answer and the tools that run; the history has
what was said until then. Who goes on before the robot has said a word is heard to the end, and answered once.
"""

import asyncio
from collections.abc import AsyncIterator, Iterable, Sequence
from contextlib import AsyncExitStack, aclosing
from typing import Any, Self

import msgspec
from msgspec.structs import replace

from engage_hri.schemas.faults import EngageError, Fault, InputRefused
from engage_hri.schemas.fragments import EVERYBODY
from engage_hri.schemas.summary import summary
from engage_hri.schemas.tool import DESCRIPTION, NAME, Expects, Look, input_schema
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import World
from engage_hri.services.client.conversation.calls import CallReader
from engage_hri.services.client.conversation.dialects import (
    CallBit,
    ModelFailed,
    TextBit,
    ToolForm,
    read_arguments,
)
from engage_hri.services.client.conversation.history import Entry, PersonSaid, RobotSaid, ToolCall
from engage_hri.services.client.conversation.models import Answering, Model, model_of
from engage_hri.services.client.conversation.tools import ConversationTool, ToolSource, opened
from engage_hri.services.client.heard import HeardTurn
from engage_hri.services.client.inputs import call_in
from engage_hri.services.client.language_models import summary_of
from engage_hri.services.client.robot import Robot
from engage_hri.services.client.turn import ANSWER_WITHIN, RobotTurn

PROMPT = """\
You are a robot, and speak with the people before you. What you write is spoken as it comes: write plain words as \
one says them, in one to three short sentences, without Markdown, lists and emoji. To refer to an object, write its \
id in brackets, without an article: "Take [red-cup], please." The robot finds the words for it, and looks or points \
there. The tool perform_turn_fragment does the same in parts, and can nod and look; use it for that only. What you \
were not let finish stands in round brackets before the next words of people."""
ROUNDS = 8
"""Number of messages of the model in one turn of the robot: a model that calls tools for ever is not waited for."""
SAYS_SO_AFTER: Seconds = 2.0
"""Silence while a tool runs after which the robot says that it will take a moment: people wonder after two (Shiwa et
al. 2008, HRI, "How quickly should communication robots respond?")."""
SAYS_SO_AGAIN: Seconds = 8.0
"""Silence after which it says so again: after ten the turn would be over."""
PHRASES = {
    "en": ("One moment, please.", "I am sorry, I cannot think of an answer now."),
    "de": ("Einen Moment bitte.", "Es tut mir leid, mir fällt gerade keine Antwort ein."),
    "fr": ("Un instant, s'il vous plaît.", "Je suis désolé, je ne trouve pas de réponse."),
    "es": ("Un momento, por favor.", "Lo siento, ahora no se me ocurre ninguna respuesta."),
    "it": ("Un momento, per favore.", "Mi dispiace, ora non trovo una risposta."),
}
"""What the robot says by itself, by language: while a tool runs, and when the model has failed."""
GOING_ON = '{"status": "going on"}'
NOT_AWAITED = "(interrupted: the result was not waited for)"


class Conversation:
    """A conversation. Used by `async with`: it listens and answers from there on, until the end of the body.

    history: what was said, in the order in which it began; each entry is complete when `entries` gives it.
    problems: what went wrong with the model and its tools, in words, the last hundred.
    """

    def __init__(
        self,
        robot: Robot,
        model: Model | Answering | str,
        *,
        tools: Iterable[ToolSource] = (),
        prompt: str = "",
        language: str = "",
    ) -> None:
        """Make a conversation of a robot.

        robot: as `connect` gives it.
        model: what leads it: `openai:NAME`, `anthropic:NAME`, `ollama:NAME`, each with `@ADDRESS` where it is another
            server's; an address of one that speaks as OpenAI's does; a function of the history that returns or yields
            text; or a `Model`.
        tools: functions with typed parameters, and `McpServer`s.
        prompt: what the model is told besides how the robot speaks: who it is, what it is to do.
        language: of the words, as `en-GB`; empty: English, and people may speak any.

        Raises:
            InputRefused: nothing of that name is known, or a function can be no tool.
        """
        self.history: list[Entry] = []
        self.problems: list[str] = []
        self._robot = robot
        self._model = model_of(model)
        self._sources = tuple(tools)
        self._prompt = "\n\n".join(filter(None, (PROMPT, prompt)))
        self._language = language
        self._waiting, self._sorry = PHRASES.get(language.partition("-")[0].lower(), PHRASES["en"])
        self._told: list[Entry] = []
        """Entries that are complete, in that order."""
        self._news = asyncio.Event()
        self._tools: dict[str, ConversationTool] = {}
        self._world: World | None = None
        self._to_answer = ""
        """Who is to be answered; empty: nobody."""
        self._wakes = asyncio.Event()
        self._replying: asyncio.Task[None] | None = None
        self._turn: RobotTurn | None = None
        self._is_over = False

    async def __aenter__(self) -> Self:
        self._stack = AsyncExitStack()
        try:
            await self._stack.enter_async_context(self._model)
            self._tools = await self._stack.enter_async_context(opened(self._sources))
            if NAME in self._tools:
                raise InputRefused(Fault(reason="a tool has the name of the robot's own", where=NAME))
            self._heard = self._stack.enter_context(self._robot.heard(language=self._language))
            self._worlds = self._stack.enter_context(self._robot.worlds())
            self._tasks = await self._stack.enter_async_context(asyncio.TaskGroup())
        except BaseException:
            await self._stack.aclose()
            raise
        self._working = [
            self._tasks.create_task(self._listen(), name="listen"),
            self._tasks.create_task(self._answer(), name="answer"),
        ]
        return self

    async def __aexit__(self, *raised: Any) -> bool | None:
        for task in self._working:
            task.cancel()
        self._heard.close()
        try:
            return await self._stack.__aexit__(*raised)
        finally:
            self._is_over = True
            self._news.set()

    async def forever(self) -> None:
        """Talk until the client ends, or this is cancelled."""
        await asyncio.wait([self._working[0]])

    async def entries(self) -> AsyncIterator[Entry]:
        """Follow what is said: each entry of the history as soon as it is complete, from the first one."""
        told = 0
        while not (self._is_over and told == len(self._told)):
            while told < len(self._told):
                told += 1
                yield self._told[told - 1]
            if not self._is_over:
                self._news.clear()
                await self._news.wait()

    def answer(self, person: str) -> None:
        """Let the model speak to a person who has said nothing, such as one who has just come.

        person: id.
        """
        self._to_answer = person
        self._wakes.set()

    # -- people -------------------------------------------------------------------------------------------------

    async def _listen(self) -> None:
        async for turn in self._heard:
            waits = self._replying is not None and self._turn is not None and not self._turn.said
            if waits and turn.who == self._to_answer and self._replying is not None:
                self._replying.cancel()  # they have not finished: what was to be said answers half of it
            self._tasks.create_task(self._hear(turn), name=f"hear {turn.who}")

    async def _hear(self, turn: HeardTurn) -> None:
        text = await turn.over()
        if not turn.is_over:
            return
        if text:
            is_for_robot = not turn.to or not {self._robot.id, EVERYBODY}.isdisjoint(turn.to)
            is_sign = turn.reading in ("backchannel", "noise", "other") or not is_for_robot
            said = PersonSaid(who=turn.who, text=text, began=turn.began, to=turn.to, is_sign=is_sign)
            self._enter(said)
            self._tell(said)
            if not is_sign:
                self.answer(turn.who)
        if self._to_answer == turn.who and self._replying is None:
            self._wakes.set()  # what was broken off for this is answered all the same

    # -- the robot ----------------------------------------------------------------------------------------------

    async def _answer(self) -> None:
        while True:
            await self._wakes.wait()
            self._wakes.clear()
            to = self._to_answer
            self._replying = asyncio.create_task(self._reply(to), name=f"reply to {to}")
            try:
                await asyncio.wait([self._replying])
            finally:
                replying, self._replying = self._replying, None
                replying.cancel()
                await asyncio.gather(replying, return_exceptions=True)
            if replying.cancelled():
                continue
            if error := replying.exception():
                raise error
            if not self._wakes.is_set():
                self._to_answer = ""

    async def _reply(self, to: str) -> None:
        turn = self._turn = self._robot.turn(to)
        messages: list[tuple[RobotSaid, int]] = []
        try:
            async with turn:
                # A face first: words to somebody who is not looked at are for nobody.
                await turn.write(Look(look=to))
                for _ in range(ROUNDS):
                    entry = RobotSaid(to=to, began=self._robot.now())
                    messages.append((entry, turn.mark))
                    calls = await self._message(turn, entry)
                    if not calls:
                        break
                    await self._call(turn, calls)
        except EngageError as error:
            self._complain(error)
        finally:
            self._turn = None
            ends = [*(mark for _, mark in messages[1:]), None]
            for (entry, first), last in zip(messages, ends, strict=True):
                self._settle(turn, entry, first, last)

    async def _message(self, turn: RobotTurn, entry: RobotSaid) -> Sequence[ToolCall]:
        """Ask the model for a message, and say it; returns the calls after which it goes on."""
        while (world := await self._worlds.next(0.0)) is not None:
            self._world = world
        own = ToolForm(name=NAME, description=DESCRIPTION, schema=input_schema(self._world))
        forms = (own, *(tool.form for tool in self._tools.values()))
        calls: dict[int, ToolCall] = {}
        readers: dict[int, CallReader] = {}
        history = tuple(self.history)
        self._enter(entry)
        try:
            async with aclosing(self._model.reply(self._prompt, history, forms)) as bits:
                async for bit in bits:
                    match bit:
                        case TextBit(text=text):
                            entry.written += text
                            await turn.write(text)
                        case CallBit(number=number):
                            if number not in calls:
                                calls[number] = ToolCall(id=bit.id or f"call_{len(calls) + 1}", name=bit.name)
                                entry.calls.append(calls[number])
                                await turn.write(" ")
                            calls[number].arguments += bit.json
                            if calls[number].name == NAME:
                                for piece in readers.setdefault(number, CallReader()).feed(bit.json):
                                    await turn.write(piece)
        except ModelFailed as failed:
            self._complain(failed)
            if not entry.written and not entry.calls:
                turn.say(self._sorry)
            entry.calls.clear()
            return ()
        for reader in readers.values():
            for piece in reader.end():
                await turn.write(piece)
        return self._wanted(turn, entry, readers)

    def _wanted(self, turn: RobotTurn, entry: RobotSaid, readers: dict[int, CallReader]) -> Sequence[ToolCall]:
        """Calls of others, and of ours those that were wrong: the model has to know of these before it goes on."""
        is_question, within, expects = entry.written.rstrip(" \"'”*_)").endswith("?"), ANSWER_WITHIN, "reply"
        wrong = []
        for call in (each for each in entry.calls if each.name == NAME):
            call.result = GOING_ON
            try:
                fragment = call_in(call.arguments or "{}", self._robot._unnamed())
            except EngageError as error:
                call.result = summary_of(error).json
                wrong.append(call)
                continue
            is_question |= fragment.turn_index == 1 and fragment.turn_status in ("full", "end")
            within = fragment.within or within
            expects = read_arguments(call.arguments).get("expects") or expects
        if is_question:
            asked: Expects = "action" if expects == "action" else "reply"
            turn.expect_answer(within, asked)
        return [each for each in entry.calls if each.name != NAME or each in wrong]

    async def _call(self, turn: RobotTurn, calls: Sequence[ToolCall]) -> None:
        """Run tools side by side; meanwhile the robot keeps the turn, and its eyes on the person."""
        await turn.flush()
        async with asyncio.TaskGroup() as running:
            pending = {running.create_task(self._run(call)) for call in calls if not call.result}
            silence = SAYS_SO_AFTER
            while pending:
                speaking = running.create_task(turn.spoken())
                while pending and not speaking.done():
                    await asyncio.wait({*pending, speaking}, return_when=asyncio.FIRST_COMPLETED)
                    pending = {task for task in pending if not task.done()}
                speaking.cancel()
                if pending:
                    _, pending = await asyncio.wait(pending, timeout=silence)
                if pending:
                    turn.say(self._waiting)
                    silence = SAYS_SO_AGAIN

    async def _run(self, call: ToolCall) -> None:
        tool = self._tools.get(call.name)
        if tool is None:
            call.result = f"error: there is no tool {call.name!r}"
            return
        try:
            given = msgspec.json.decode(call.arguments or "{}", type=dict[str, Any])
            call.result = await tool.call(given)
        except Exception as error:  # a tool is of somebody else: what it raises is for the model
            call.result = f"error: {error}"
            self.problems = [*self.problems, f"{call.name}: {error!r}"][-100:]

    # -- the history --------------------------------------------------------------------------------------------

    def _settle(self, turn: RobotTurn, entry: RobotSaid, first: int, last: int | None) -> None:
        """Put down what became of a message, when its turn is over."""
        entry.said, entry.unsaid = turn.said_between(first, last), turn.unsaid_between(first, last)
        entry.began = turn.began_between(first, last) or entry.began
        for call in entry.calls:
            if call.result == GOING_ON:
                told = summary(*turn.outcomes[first:last])
                call.result = replace(told, heard=()).json
            call.result = call.result or NOT_AWAITED
        self.history[:] = [each for each in self.history if each is not entry]
        if entry.said or entry.calls:
            self._enter(entry)
            self._tell(entry)

    def _enter(self, entry: Entry) -> None:
        self.history.append(entry)
        self.history.sort(key=lambda each: each.began)

    def _tell(self, entry: Entry) -> None:
        self._told.append(entry)
        self._news.set()

    def _complain(self, error: EngageError) -> None:
        self._robot._bus.log.warning("the conversation: %s", error.fault)
        self.problems = [*self.problems, str(error.fault)][-100:]
