"""What is too much is refused at once, with the limit's name; what was admitted goes on as before."""

import asyncio
from functools import partial

import pytest

from engage_hri.schemas.behaviors import Gaze, Speech, Wait
from engage_hri.schemas.blocks import Block, BlockOutcome
from engage_hri.schemas.faults import InputRefused
from engage_hri.schemas.fragments import FragmentOutcome, TurnFragment
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.robot import connect
from engage_hri.services.commandline.shell import roster
from engage_hri.services.commandline.shell.config import load
from engage_hri.services.generation import fragments
from engage_hri.services.generation.intake import WORLD_PATIENCE
from engage_hri.services.realizer.config import RealizerConfig
from engage_hri.services.requests.ends import RequestRefused
from engage_hri.services.runtime.service import running
from engage_hri.services.simulation.still import show_world
from tests.cancelling import whole_robot
from tests.realizer.stage import stage


async def test_one_live_block_too_many_is_refused_and_the_others_keep_their_time() -> None:
    alone = stage(config=RealizerConfig(blocks=10))
    async with alone as seen:
        asked = [seen.ask(Block(id=f"b{n}", behaviors=(Wait(id="w", duration=5.0),))) for n in range(10)]
        await asyncio.sleep(0.1)
        before = asyncio.get_running_loop().time()
        with pytest.raises(RequestRefused, match=r"10 blocks are live.*`realizer.blocks` is the limit"):
            await seen.ask(Block(id="more", behaviors=(Wait(id="w"),))).outcome
        assert asyncio.get_running_loop().time() == before
        outcomes = [await each.outcome for each in asked]
        again = await seen.perform(Block(id="again", behaviors=(Wait(id="w"),)))

    assert {each.status for each in outcomes if isinstance(each, BlockOutcome)} == {"done"}
    assert {seen.times(f"b{n}")["w:end"] for n in range(10)} == {5.0}
    assert again.status == "done"


async def test_a_speech_too_long_is_refused_in_a_block_and_in_a_fragment(hub: MemoryHub) -> None:
    words = "word " * 1001
    speech = Speech(id="s", text=words)
    async with whole_robot(hub) as robot:
        with pytest.raises(InputRefused, match=r"5005 characters of speech, at most 5000.*say it in several"):
            await robot.realize("b", [Gaze(id="g", target="human"), speech])
        with pytest.raises(InputRefused, match=r"behaviors\[0\].text: 5005 characters.*say it in several pieces"):
            await robot.perform(TurnFragment(id="f", turn_status="full", behaviors=(speech,)))
        assert (await robot.realize("c", [Wait(id="w")])).status == "done"


async def test_one_fragment_too_many_is_refused_and_the_others_are_performed(
    hub: MemoryHub, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fragments, "FRAGMENTS", 5)
    async with whole_robot(hub) as robot:
        asked = [
            asyncio.create_task(
                robot.perform(TurnFragment(id=f"f{n}", turn_status="full", behaviors=(Speech(id="s", text="one"),)))
            )
            for n in range(8)
        ]
        outcomes = await asyncio.gather(*asked, return_exceptions=True)

    assert [each.status for each in outcomes if isinstance(each, FragmentOutcome)] == ["done"] * 5
    assert all("5 fragments are waiting or performed, which is the limit" in str(each) for each in outcomes[5:])


async def test_a_world_whose_publisher_has_crashed_is_waited_for_as_at_start(hub: MemoryHub) -> None:
    ann = Entity(id="ann", kind="person", position=(1.2, 0.0, 1.2))
    config, world = load(), World(entities=(ann,))
    services = {name: roster.service(name, config) for name in roster.ROBOT}
    fragments = [TurnFragment(id=id, turn_status="full", behaviors=(Speech(id="s", text="hello"),)) for id in "abc"]
    patience = WORLD_PATIENCE
    async with running(hub, services), connect(hub=hub) as robot:
        async with running(hub, {"camera": partial(show_world, world=world)}):
            assert (await robot.perform(fragments[0])).status == "done"
            hub.kill("camera")
        since = robot.now()
        with pytest.raises(InputRefused, match="the world is unknown"):
            await robot.perform(fragments[1])
        assert robot.now() - since == pytest.approx(patience, abs=0.1)
        waiting = asyncio.create_task(robot.perform(fragments[2]))
        await asyncio.sleep(patience / 2)
        assert not waiting.done()
        async with running(hub, {"camera": partial(show_world, world=world)}):
            assert (await waiting).status == "done"


@pytest.mark.parametrize("addressee", ["", "ann"])
@pytest.mark.parametrize("comes", [True, False])
async def test_a_fragment_waits_for_the_first_person(hub: MemoryHub, comes: bool, addressee: str) -> None:
    cup = Entity(id="cup", kind="object", position=(0.5, 0.0, 0.8))
    ann = Entity(id="ann", kind="person", position=(1.2, 0.0, 1.2))
    config = load()
    services = {name: roster.service(name, config) for name in roster.ROBOT}
    services["perception"] = partial(show_world, world=World(entities=(cup,)))
    hello = Speech(id="s", text="hello")
    fragment = TurnFragment(id="f", turn_status="full", addressee=addressee, behaviors=(hello,))
    async with running(hub, services), connect(hub=hub) as robot:
        asking = asyncio.create_task(robot.perform(fragment))
        await asyncio.sleep(2.0)
        if comes:
            async with running(hub, {"camera": partial(show_world, world=World(entities=(cup, ann)))}):
                assert (await asking).status == "done"
        else:
            with pytest.raises(InputRefused, match=r"the world knows no(body| people)"):
                await asking
            assert robot.now() == pytest.approx(WORLD_PATIENCE, abs=0.1)
