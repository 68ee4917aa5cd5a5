"""Visitors before the tangram, as in `engage demo --you`: who does nothing, who looks away, who comes again."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from engage_hri.schemas.blocks import BlockOutcome
from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import ActionBegan
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.people.perceive import perceive
from engage_hri.services.commandline.embedding import services
from engage_hri.services.commandline.look.demo import FOR_YOU
from engage_hri.services.commandline.shell import roster
from engage_hri.services.commandline.shell.config import load
from engage_hri.services.console.follow import following
from engage_hri.services.runtime.service import running

HELP = "May I help you? I show you what comes next. Please put the blue piece"
LETS_GO = "You have other things to do. Thank you for playing, goodbye."


class SeenAndHeard:
    """What the robot said and what it pointed at, each with the time at which that was over."""

    def __init__(self) -> None:
        self.said: list[tuple[float, str]] = []
        self.pointed: list[tuple[float, str]] = []

    def take(self, message: Message, at: float) -> None:
        match message:
            case BlockOutcome(spoken=spoken) if spoken:
                self.said.append((at, " ".join(each.text for each in spoken)))
            case ActionBegan(actor="robot", action="point", targets=targets):
                self.pointed += [(at, target) for target in targets]

    def when(self, words: str) -> list[float]:
        """Times at which it had said this."""
        return [at for at, said in self.said if words in said]


@asynccontextmanager
async def visited(hub: MemoryHub) -> AsyncIterator[tuple[SeenAndHeard, asyncio.Event]]:
    """A table with nobody before it, and whether its task is over."""
    heard = SeenAndHeard()
    config = load(settings=("simulation.human=none",), defaults=FOR_YOU)
    async with following(hub.join("console"), (heard.take,)), running(hub, services(config, *roster.PLAY)) as over:
        yield heard, over


async def test_who_does_nothing_for_a_minute_has_been_offered_help_with_the_piece_that_comes_next(
    hub: MemoryHub,
) -> None:
    async with visited(hub) as (heard, _), perceive("ann", hub=hub) as ann:
        sat = asyncio.get_running_loop().time()
        await ann.look_at("robot")
        await asyncio.sleep(60.0)

        (helped,) = heard.when(HELP)
        asked = heard.when("Please move the blue piece")
        assert [at < helped < sat + 60.0 for at in asked] == [True]
        assert {"blue-square", "rectangle"} <= {target for at, target in heard.pointed if asked[0] < at < helped}


async def test_who_attends_and_does_nothing_is_asked_for_another_piece(hub: MemoryHub) -> None:
    async with visited(hub) as (heard, _), perceive("ann", hub=hub) as ann:
        await ann.look_at("robot")
        await asyncio.sleep(120.0)

        assert heard.when("Let us try it together. Can you put the blue piece")
        assert heard.when("Please move the yellow piece")
        assert not heard.when(LETS_GO)


async def test_who_does_nothing_and_looks_away_is_let_go_kindly(hub: MemoryHub) -> None:
    async with visited(hub) as (heard, over), perceive("ann", hub=hub) as ann:
        await ann.look_at("robot")
        await asyncio.sleep(30.0)
        await ann.look_at("")
        await asyncio.wait_for(over.wait(), 120.0)

        assert heard.when(HELP)
        assert [said for _, said in heard.said][-1] == LETS_GO


async def test_who_looks_at_the_pieces_to_think_is_not_let_go(hub: MemoryHub) -> None:
    async with visited(hub) as (heard, _), perceive("ann", hub=hub) as ann:
        await ann.look_at("robot")
        await asyncio.sleep(30.0)
        await ann.look_at("table")
        await asyncio.sleep(150.0)

        assert heard.when("Please move the yellow piece")
        assert not heard.when(LETS_GO)


async def test_who_comes_is_greeted_once_and_again_when_they_come_again(hub: MemoryHub) -> None:
    async with visited(hub) as (heard, _):
        for stays in (30.0, 20.0):
            async with perceive("ann", hub=hub) as ann:
                await ann.look_at("robot")
                await asyncio.sleep(stays)
            await asyncio.sleep(10.0)

        greetings = [said for _, said in heard.said if said.startswith("Hello")]
        assert greetings == ["Hello, let's make a tangram.", "Hello again, let us go on."]
