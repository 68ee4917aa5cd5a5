"""Whole robots that lose somebody in mid-sentence: the body holds, goes on, goes home, and tells. Virtual time."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from itertools import pairwise

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Pointing, Speech
from engage_hri.schemas.blocks import BlockOutcome, BodyHeld
from engage_hri.schemas.body import RobotState, WordSpoken
from engage_hri.schemas.faults import Fault, RunFailed, ServerRestarted
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.messages import Message
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.performing import PerformFailed
from engage_hri.services.client.robot import Robot, connect
from engage_hri.services.commandline.shell import roster
from engage_hri.services.commandline.shell.config import load
from engage_hri.services.realizer.config import LEASE, RealizerConfig
from engage_hri.services.requests.serving import GRACE
from engage_hri.services.runtime.service import serve

WORDS = " ".join(f"word{number}" for number in range(40))
LONGEST_WORD = 1.0
HELD_AFTER = RealizerConfig().held_after
BOTH = (Speech(id="s", text=WORDS), Pointing(id="p", target="blue-square", timing=()))
BEGUN = 2.0
"""Time at which something happens to whoever performs these."""


class Play:
    """A robot in this process, whose services can be killed and started one by one, and all that its body tells."""

    def __init__(self, hub: MemoryHub, robot: Robot) -> None:
        self.hub = hub
        self.robot = robot
        self.heard: list[tuple[float, Message]] = []
        self.tasks: dict[str, asyncio.Task[None]] = {}
        self._config = load(settings=["simulation.human=listening"])

    async def start(self, name: str) -> None:
        ready = asyncio.Event()
        service = roster.service(name, self._config)
        self.tasks[name] = asyncio.create_task(serve(self.hub, name, service, ready.set), name=name)
        await ready.wait()

    async def kill(self, name: str) -> None:
        """End a service at once: its token goes, nothing that it still does reaches anybody."""
        self.hub.kill(name)
        self.tasks[name].cancel()
        await asyncio.gather(self.tasks.pop(name), return_exceptions=True)

    def told(self, *kinds: type) -> list[tuple[float, Message]]:
        return [each for each in self.heard if isinstance(each[1], kinds)]

    @property
    def holds(self) -> list[tuple[float, int]]:
        """Times at which the body told how much waits, and how much."""
        return [(at, len(each.holds)) for at, each in self.heard if isinstance(each, BodyHeld)]

    @property
    def words(self) -> list[float]:
        return [each.at.seconds for _, each in self.heard if isinstance(each, WordSpoken)]

    def is_home(self) -> bool:
        state = self.told(RobotState)[-1][1]
        assert isinstance(state, RobotState)
        return all(arm.tip is not None and abs(arm.tip[2] - 0.8) < 1e-3 for arm in (state.left_arm, state.right_arm))


@asynccontextmanager
async def play(hub: MemoryHub) -> AsyncIterator[Play]:
    async with connect(hub=hub) as robot:
        playing = Play(hub, robot)
        watcher = hub.join("watcher")
        inbox = watcher.subscribe(keys.BODY_HELD, keys.SYNC_POINT, keys.ROBOT_MOTION, keys.ANY_FAULT)

        async def listen() -> None:
            async for received in inbox:
                playing.heard.append((received.at, received.message))

        listening = asyncio.create_task(listen())
        for name in (*roster.ROBOT, "simulation"):
            await playing.start(name)
        await robot.person()
        try:
            yield playing
        finally:
            inbox.close()
            await listening
            for task in playing.tasks.values():
                task.cancel()
            await asyncio.gather(*playing.tasks.values(), return_exceptions=True)


@asynccontextmanager
async def manager(hub: MemoryHub) -> AsyncIterator[Robot]:
    """A manager called other, which can be cut off, or killed."""
    bus = hub.join("other")
    bus.declare_alive()
    async with Robot.on(bus) as robot:
        yield robot


def now() -> float:
    return asyncio.get_running_loop().time()


async def failure(performing: "asyncio.Task[BlockOutcome]") -> RunFailed:
    """The error of a request that must not be left without an answer."""
    with pytest.raises(RunFailed) as failed:
        await asyncio.wait_for(performing, 20.0)
    return failed.value


async def test_the_realizer_is_killed_and_nobody_starts_it_again(hub: MemoryHub) -> None:
    async with play(hub) as robot:
        performing = asyncio.create_task(robot.robot.realize("b", BOTH))
        await asyncio.sleep(BEGUN)
        killed = now()
        await robot.kill("realizer")
        error = await failure(performing)
        told = now()
        await asyncio.sleep(5.0)

        assert "realizer has not been seen for 4.0 s" in str(error)
        held = [at for at, count in robot.holds if count and at >= killed]
        assert killed <= held[0] <= killed + HELD_AFTER
        assert robot.words[-1] <= held[0] + LONGEST_WORD
        assert robot.words[-1] < told, "the failure was told while the body went on"
        faults = [each for at, each in robot.told(Fault) if at > killed]
        assert any(isinstance(each, Fault) and "the body goes home" in each.reason for each in faults)
        assert robot.is_home()
        assert robot.holds[-1][1] == 0


async def test_the_realizer_is_killed_and_started_again(hub: MemoryHub) -> None:
    async with play(hub) as robot:
        performing = asyncio.create_task(robot.robot.realize("b", BOTH))
        await asyncio.sleep(BEGUN)
        await robot.kill("realizer")
        await asyncio.sleep(0.7)
        begun = now()
        await robot.start("realizer")
        error = await failure(performing)

        assert isinstance(error, ServerRestarted)
        assert now() - begun < 0.1, "a new life owes nothing of its former one"
        assert robot.words[-1] <= begun
        again = await asyncio.wait_for(robot.robot.realize("again", (Speech(id="s", text="hello"),)), 10.0)
        assert again.status == "done"
        await asyncio.sleep(3.0)
        assert robot.is_home()


@pytest.mark.parametrize("cut", [0.3, 1.0, 1.5, 3.0])
async def test_a_short_cut_of_the_body_is_a_pause(hub: MemoryHub, cut: float) -> None:
    """Nothing is said twice or left out, and the block comes to its end."""
    async with play(hub) as robot:
        hub.partition()
        performing = asyncio.create_task(robot.robot.realize("b", BOTH))
        await asyncio.sleep(BEGUN)
        since = now()
        hub.partition("realizer")
        await asyncio.sleep(cut)
        hub.heal()
        healed = now()
        outcome = await asyncio.wait_for(performing, 60.0)

        assert outcome.status == "done", outcome
        held = [at for at, count in robot.holds if count and at >= since]
        assert len(robot.words) == 40
        if cut < HELD_AFTER * 2 / 3:  # two renewals in three are enough
            assert held == []
        else:
            assert since + HELD_AFTER / 3 < held[0] <= since + HELD_AFTER
            silent = [word for word in robot.words if held[0] + LONGEST_WORD < word < healed]
            assert silent == []
            assert robot.holds[-1][1] == 0


async def test_a_long_cut_of_the_body_ends_the_block_and_takes_it_home(hub: MemoryHub) -> None:
    async with play(hub) as robot:
        performing = asyncio.create_task(robot.robot.realize("b", BOTH))
        await asyncio.sleep(BEGUN)
        cut = now()
        hub.partition("control", "watcher")
        await asyncio.sleep(LEASE + 3.0)
        hub.partition()
        hub.heal()
        with pytest.raises(PerformFailed, match="realizer has not renewed it for"):
            await asyncio.wait_for(performing, 10.0)

        assert all(at <= cut + HELD_AFTER + LONGEST_WORD for at in robot.words)
        await asyncio.sleep(3.0)
        assert robot.is_home()


async def test_a_manager_whose_loop_stands_still_freezes_nobody(hub: MemoryHub) -> None:
    """A manager is silent for 2 s, as with a language model that blocks its loop. Its token stays."""
    async with play(hub) as robot, manager(hub) as other:
        fragment = TurnFragment(id="f", turn_status="full", behaviors=(Speech(id="s", text=WORDS),))
        performing = asyncio.create_task(other.perform(fragment))
        await asyncio.sleep(BEGUN)
        hub.partition("other")
        await asyncio.sleep(2.0)
        hub.heal()
        outcome = await asyncio.wait_for(performing, 60.0)

        assert outcome.status == "done"
        assert [count for _, count in robot.holds if count] == []
        assert len(robot.words) == 40
        assert max(after - before for before, after in pairwise(robot.words)) < LONGEST_WORD


async def test_a_manager_that_dies_ends_its_turn_at_a_word_gap_after_the_grace(hub: MemoryHub) -> None:
    async with play(hub) as robot, manager(hub) as other:
        fragment = TurnFragment(id="f", turn_status="full", behaviors=(Speech(id="s", text=WORDS),))
        performing = asyncio.create_task(other.perform(fragment))
        await asyncio.sleep(BEGUN)
        killed = now()
        hub.kill("other")
        await asyncio.sleep(4.0)
        performing.cancel()
        await asyncio.gather(performing, return_exceptions=True)

        assert killed + 1.5 < robot.words[-1] < killed + GRACE + LONGEST_WORD
        assert [count for _, count in robot.holds if count] == []


async def test_play_without_a_fault_has_no_hold(hub: MemoryHub) -> None:
    async with play(hub) as robot:
        for number in range(5):
            outcome = await robot.robot.realize(f"b{number}", BOTH)
            assert outcome.status == "done"
        assert [count for _, count in robot.holds if count] == []
