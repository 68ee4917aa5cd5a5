"""A turn that is written bit by bit tells of itself what an independent listener has heard, however it ends."""

import asyncio
import random
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import NamedTuple

import pytest
from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.body import WordSpoken
from engage_hri.schemas.faults import InputRefused
from engage_hri.schemas.perception import ActionBegan
from engage_hri.schemas.tool import Refer
from engage_hri.services.bus.interface import Subscription
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.language_models import PLAIN_TURN
from engage_hri.services.client.robot import Robot
from engage_hri.services.frameworks.written_turn import LONGEST_TURN, WrittenTurn
from tests.cancelling import whole_robot
from tests.random_cases import share_of

REST = "and put it next to the others. Then, if you like, go on. Well done!"
TEXT = f"Hello there, Ann. Please take [blue-square] {REST}"
WORDS = f"Hello there, Ann. Please take the blue square {REST}"


class Scene(NamedTuple):
    robot: Robot
    hub: MemoryHub
    bus: Subscription

    def heard(self) -> str:
        """What a participant that knows nothing of the turn has heard since it was asked last."""
        words = []
        while (received := self.bus.take()) is not None:
            words += [received.message.word] if isinstance(received.message, WordSpoken) else []
        return " ".join(words)


@asynccontextmanager
async def scene() -> AsyncIterator[Scene]:
    async with MemoryHub() as hub, whole_robot(hub) as robot:
        listener = hub.join("listener", "observer")
        with listener.subscribe(keys.SYNC_POINT) as bus:
            yield Scene(robot, hub, bus)
        await listener.leave()


async def write(turn: WrittenTurn, chance: random.Random) -> None:
    left = TEXT
    while left:
        length = chance.randint(1, 12)
        turn.write(left[:length])
        left = left[length:]
        await asyncio.sleep(chance.choice((0.0, 0.01, 0.05)))
    turn.end()


async def test_it_is_said_word_by_word_and_tells_where_they_looked() -> None:
    words, began = [], []
    async with scene() as here:
        turn = WrittenTurn(here.robot, "t", on_start=lambda: began.append(len(words)), on_word=words.append)
        turn.write("Please take ")
        turn.write(Refer(refer="blue-square"))
        turn.end()
        told = await turn.over()

        assert here.heard() == told.said == turn.said == "Please take the blue square"
    assert " ".join(words) == told.said
    assert began == [0]
    assert [each.object for each in told.references] == ["blue-square"]


@pytest.mark.parametrize("seed", range(share_of(60)))
async def test_a_turn_that_is_stopped_at_any_instant_tells_exactly_what_was_heard(seed: int) -> None:
    chance = random.Random(seed)
    async with scene() as here:
        turn = WrittenTurn(here.robot, "t")
        writing = asyncio.create_task(write(turn, chance))
        await asyncio.sleep(chance.choice((0.0, chance.uniform(0.0, 1.0), chance.uniform(0.0, 9.0))))
        turn.stop()
        told = await turn.over()
        writing.cancel()
        await asyncio.wait([writing])
        heard = here.heard()
        await asyncio.sleep(2.0)
        later = here.heard()

        again = WrittenTurn(here.robot, "again")
        again.write("Sorry.")
        again.end()
        after = await again.over()

    assert told.said == heard
    assert later == ""
    assert told.cut_short == (told.said != WORDS)
    assert (after.status, after.said) == ("done", "Sorry.")


async def test_a_turn_that_is_stopped_before_it_could_begin_is_over_at_once() -> None:
    async with scene() as here:
        began = here.robot.now()
        turn = WrittenTurn(here.robot, "t")
        turn.write(TEXT)
        turn.stop()
        told = await turn.over()

        assert here.robot.now() - began < 0.5
    assert (told.status, told.said, told.cut_short) == ("interrupted", "", True)


@pytest.mark.parametrize("seed", range(share_of(30)))
async def test_so_does_one_into_which_a_person_speaks(seed: int) -> None:
    chance = random.Random(seed)
    async with scene() as here:
        turn = WrittenTurn(here.robot, "t")
        writing = asyncio.create_task(write(turn, chance))
        await asyncio.sleep(chance.uniform(0.5, 6.0))
        person = here.hub.join("perception-too")
        person.publish(keys.PERCEIVED_ACTION, ActionBegan(actor="human", action="speak", at=person.stamp()))
        told = await turn.over()
        writing.cancel()
        await asyncio.wait([writing])
        await person.leave()

        assert told.said == here.heard()
    assert told.status == "interrupted"
    assert told.cut_short
    assert WORDS.startswith(told.said)


async def test_a_turn_is_held_with_the_block_that_comes_after_and_goes_on() -> None:
    async with scene() as here:
        turn = WrittenTurn(here.robot, "t")
        with pytest.raises(InputRefused, match="nothing of it is being said"):
            await turn.hold()
        turn.write(TEXT)
        turn.end()
        await asyncio.sleep(1.0)
        await turn.hold()
        await asyncio.sleep(1.0)
        before = here.heard()
        await asyncio.sleep(4.0)
        during = here.heard()
        await turn.resume()
        told = await turn.over()
        after = here.heard()

    assert during == ""
    assert f"{before} {after}" == told.said == WORDS
    with pytest.raises(InputRefused, match="nothing of it is being said"):
        await turn.resume()


async def test_what_cannot_be_added_is_refused_and_the_turn_goes_on() -> None:
    async with scene() as here:
        turn = WrittenTurn(here.robot, "t")
        turn.write("Hello.")
        with pytest.raises(InputRefused, match="longer than 65536 characters"):
            turn.write("x" * LONGEST_TURN)
        turn.end()
        turn.end()
        await asyncio.sleep(0.1)
        with pytest.raises(InputRefused, match="takes no more text"):
            turn.write("More.")
        told = await turn.over()
        turn.write("Nobody hears this.")

    assert told.said == "Hello."


async def test_to_give_up_waiting_stops_it_and_a_turn_that_is_refused_says_why() -> None:
    async with scene() as here:
        turn = WrittenTurn(here.robot, "t")
        turn.write(TEXT)
        waiting = asyncio.create_task(turn.over())
        await asyncio.sleep(2.0)
        waiting.cancel()
        await asyncio.wait([waiting])
        heard = here.heard()
        await asyncio.sleep(3.0)
        assert here.heard() == ""

        wrong = WrittenTurn(here.robot, "w", turn=replace(PLAIN_TURN, addressee="nobody"))
        wrong.write("Hello.")
        wrong.end()
        told = await wrong.over()

    assert turn.said == heard
    assert (told.status, told.said) == ("refused", "")
    assert "nobody" in told.problems[0]
