"""Streams on a whole robot, before a person who does not do what a model expects."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import NamedTuple

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.perception import ActionBegan, ActionEnded, Utterance
from engage_hri.schemas.summary import Summary, summary
from engage_hri.schemas.tool import Say, ToolInput
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.language_models import Piece, perform_call, stream
from engage_hri.services.client.robot import Robot, connect
from engage_hri.services.commandline.shell import roster
from engage_hri.services.commandline.shell.config import load
from engage_hri.services.commandline.shell.sources import still
from engage_hri.services.runtime.service import running
from engage_hri.services.simulation.still import table_world
from tests.cancelling import whole_robot


class Stage(NamedTuple):
    """person: the bus on which the person is perceived."""

    robot: Robot
    person: Bus

    def speaks(self, began: bool) -> None:
        kind = ActionBegan if began else ActionEnded
        self.person.publish(
            keys.PERCEIVED_ACTION, kind(actor="human", action="speak", at=self.person.stamp())
        )  # fmt: skip


@asynccontextmanager
async def stage() -> AsyncIterator[Stage]:
    services = {name: roster.service(name, load()) for name in roster.ROBOT}
    services["simulation"] = still(table_world())
    async with MemoryHub() as hub, running(hub, services), connect(hub=hub) as robot:
        yield Stage(robot, hub.join("perception-too"))


async def writing(*pieces: str, pause: float = 0.1) -> AsyncIterator[str]:
    for piece in pieces:
        yield piece
        await asyncio.sleep(pause)


async def told(robot: Robot, pieces: AsyncIterator[str], **settings: object) -> Summary:
    return summary(*await stream(robot, pieces, id="t", **settings))  # type: ignore[arg-type]


async def test_who_takes_the_floor_stops_the_writer_and_the_model_learns_how_far_it_got() -> None:
    written: list[int] = []

    async def endless() -> AsyncIterator[str]:
        for number in range(1000):
            await asyncio.sleep(0.5)
            written.append(number)
            yield f"This is sentence number {number}. "

    async with stage() as here:
        speaking = asyncio.create_task(told(here.robot, endless()))
        await asyncio.sleep(4.0)
        here.speaks(True)
        result = await speaking
        ended = here.robot.now()
        here.speaks(False)

    assert (result.status, result.cut_short) == ("interrupted", True)
    assert result.said.startswith("This is sentence number 0. This is sentence")
    assert len(result.said.split(".")) < len(written) < 12
    assert any("human took the floor" in problem for problem in result.problems)
    assert ended < 6.0


async def test_a_misspelled_object_is_said_as_words_and_the_nearest_id_is_told() -> None:
    async with stage() as here:
        with here.robot.turns() as turns:
            result = await told(here.robot, writing("Hello there. ", "See [blue-squere]? ", "Then go. "))
            closed = await turns.next()

    assert (result.status, result.said) == ("done", "Hello there. See blue-squere? Then go.")
    assert "did you mean 'blue-square'" in result.problems[0]
    assert closed is not None
    assert (closed.status, closed.fragments) == ("done", ("t-1", "t-2", "t-3", "t-4"))


async def test_a_writer_who_is_silent_for_too_long_has_lost_the_turn() -> None:
    async with stage() as here:
        result = await told(here.robot, writing("Let me think. ", "Well. ", pause=30.0))

    assert (result.status, result.said) == ("interrupted", "Let me think.")
    assert result.problems == ("t: silence for 10 s",)


async def test_a_finished_sentence_is_said_though_nothing_follows_and_silence_ends_the_turn() -> None:
    async with stage() as here:
        result = await told(here.robot, writing("Let me look this up for you.", " Here it is.", pause=40.0))
        ended = here.robot.now()

    said = ("interrupted", "Let me look this up for you.", ("t: silence for 10 s",))
    assert (result.status, result.said, result.problems) == said
    assert ended < 20.0


async def test_a_writer_may_take_its_time_before_it_has_begun_a_sentence() -> None:
    async def slowly() -> AsyncIterator[str]:
        await asyncio.sleep(40.0)
        yield "Let me think."

    async with stage() as here:
        result = await told(here.robot, slowly())

    assert (result.status, result.said) == ("done", "Let me think.")


async def test_what_was_said_is_joined_as_it_was_written() -> None:
    async with stage() as here:
        result = await told(here.robot, writing("Take ([blue-square](https://example.org)), please."))

    assert result.said == "Take (the blue square), please."


async def test_words_that_ended_a_turn_while_no_text_came_are_told_once() -> None:
    async def think() -> AsyncIterator[str]:
        yield "Let me think. "
        await asyncio.sleep(3.0)
        at = here.person.stamp()
        here.person.publish(keys.UTTERANCE, Utterance(actor="human", id="1", text="Wait", began=at, at=at))
        await asyncio.sleep(3.0)

    async with stage() as here:
        streams = {"a": think(), "b": writing("Yes. "), "c": writing("And now. ")}
        results = [summary(*await stream(here.robot, each, id=id)) for id, each in streams.items()]

    assert [result.said for result in results] == ["Let me think.", "Yes.", "And now."]
    assert [[each.text for each in result.heard] for result in results] == [["Wait"], [], []]


async def test_the_robot_looks_away_while_the_writer_thinks() -> None:
    thinking = ToolInput(turn_status="full", parts=(), thinking=True)
    owners = []
    async with stage() as here:
        with here.robot.head_owners() as heads:
            result = await told(here.robot, writing("Let me think. ", "Yes", pause=4.0), turn=thinking)
            while (head := await heads.next(0.0)) is not None:
                owners.append((head.owner.kind, head.owner.target))

    assert result.said == "Let me think. Yes"
    assert ("fragment", "table") in owners


async def test_a_call_that_the_world_does_not_bear_out_is_a_result() -> None:
    async with stage() as here:
        nobody = await perform_call(
            here.robot, {"turn_status": "full", "addressee": "ann", "parts": [{"say": "Hello"}]}
        )  # fmt: skip
        at_once = await perform_call(here.robot, {"turn_status": "end", "parts": [{"say": "And so on"}]})
        person = await perform_call(here.robot, {"turn_status": "full", "parts": [{"refer": "human"}]})

    assert [each.status for each in (nobody, at_once, person)] == ["refused"] * 3
    assert "does not know the person 'ann' (people: human)" in nobody.problems[0]
    assert "begin a turn with 'beginning' or 'full'" in at_once.problems[0]
    assert "'human' is a person, and no object (`refer` takes objects)" in person.problems[0]


SENTENCES = (
    "Hello there, nice to meet you.", "I could use your help with a puzzle today.",
    "We are going to use the pieces on this table to make a picture.", "First please have a look at all of them.",
    "Then tell me which one you would like to begin with.",
)  # fmt: skip
TOKEN: Seconds = 0.04
"""Of four characters: a model that writes 25 a second."""


async def parts_as_written() -> AsyncIterator[Piece]:
    for sentence in SENTENCES:
        await asyncio.sleep(len(f'{{"say": "{sentence}"}}, ') / 4 * TOKEN)
        yield Say(say=sentence)


async def first_word(pieces: AsyncIterator[Piece]) -> Seconds:
    """How long after the first token the robot began to speak."""
    async with stage() as here:
        await here.robot.person()
        began = here.robot.now()
        with here.robot.actions() as actions:
            speaking = asyncio.create_task(stream(here.robot, pieces, id="t"))
            async for action in actions:
                if isinstance(action, ActionBegan) and (action.actor, action.action) == (here.robot.id, "speak"):
                    break
            outcomes = await speaking
    assert summary(*outcomes).said == " ".join(SENTENCES)
    return action.at.seconds - began


async def test_a_part_of_words_is_spoken_while_the_next_one_is_written() -> None:
    assert await first_word(parts_as_written()) < len('{"say": "Hello there, nice to meet you."}, ') / 4 * TOKEN + 0.1


async def test_a_stream_that_is_cancelled_as_a_piece_comes_leaves_no_turn_open(hub: MemoryHub) -> None:
    """The last fragment's task is cancelled before its first step: nothing of it was sent."""
    async with whole_robot(hub) as robot:
        streaming: asyncio.Task[object]

        async def pieces() -> AsyncIterator[str]:
            yield "One sentence. "
            yield "x"
            await asyncio.sleep(5.0)
            yield " is said. "
            streaming.cancel()
            yield "More. "

        streaming = asyncio.create_task(stream(robot, pieces(), id="t"))
        with pytest.raises(asyncio.CancelledError):
            await streaming
        await asyncio.sleep(1.0)

        outcome = await robot.perform({"turn_status": "full", "parts": [{"say": "hello"}]})

    assert outcome.status == "done"


async def test_what_is_for_the_eye_is_not_said_and_told_in_one_line_a_reason() -> None:
    async with stage() as here:
        text = (
            "[smiles] See **array[0]** and [sic]",
            " here. <think>hm</think>",
            "Then take [Blue-Square]. [laughs]",
        )
        result = await told(here.robot, writing(*text))

    assert result.status == "done"
    assert result.said.startswith("See array 0 and sic here. Then take ")
    assert [each.object for each in result.references] == ["blue-square"]
    assert result.problems == (
        "thoughts were not said: <think>",
        "stage directions were not said: [smiles], [laughs]",
        "brackets that are no reference were said as words: [0], [sic]",
        "ids were written in other letters than the world has: [Blue-Square]",
    )
