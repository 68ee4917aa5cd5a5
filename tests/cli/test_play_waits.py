"""`engage play` waits for people, as a fragment does, however soon after the start it is called."""

import asyncio
from functools import partial
from pathlib import Path

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Gaze, Speech
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.participants import PeerAlive
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.bus.zenoh.hub import open_hub
from engage_hri.services.client.feeds import SAME_PATIENCE
from engage_hri.services.client.robot import connect
from engage_hri.services.commandline.shell.sources import Thing
from engage_hri.services.commandline.talk.play import world_with_people
from engage_hri.services.runtime.service import running
from engage_hri.services.simulation.still import show_world, table_world
from tests.bus.places import free_endpoint
from tests.cli.command import FRAGMENT, start
from tests.cli.test_processes import PATIENCE, line, stopped

CUP = Entity(id="cup", kind="object", position=(0.5, 0.0, 0.8))
ANN = Entity(id="ann", kind="person", position=(1.2, 0.0, 1.2))
EMPTY, FULL = World(entities=(CUP,)), World(entities=(CUP, ANN))
SPEECH = Speech(id="s", text="hello")


def fragment(**fields: object) -> TurnFragment:
    return TurnFragment(**{"id": "f", "turn_status": "full", "behaviors": (SPEECH,), **fields})  # type: ignore[arg-type]


def block(*targets: str) -> Block:
    looks = tuple(Gaze(id=f"g{number}", target=target) for number, target in enumerate(targets))
    return Block(id="b", behaviors=(SPEECH, *looks))


async def waited(hub: MemoryHub, thing: Thing, first: World | None, then: World = FULL) -> tuple[Seconds, list[str]]:
    """How long the command waits, and whom it then knows. first: the world from the start; then: that after 2 s."""
    services = {} if first is None else {"simulation": partial(show_world, world=first)}
    async with running(hub, services), connect(hub=hub) as robot:
        waiting = asyncio.create_task(world_with_people(robot, [thing], "robot", 5.0))
        await asyncio.wait([waiting], timeout=2.0)
        async with running(hub, {"camera": partial(show_world, world=then)}):
            world = await waiting
        return robot.now(), [entity.id for entity in world.people] if world is not None else ["unknown"]


@pytest.mark.parametrize(
    "thing",
    [fragment(), fragment(addressee="ann"), block("ann"), fragment(behaviors=(Gaze(id="g", target="ann"),))],
    ids=["somebody", "by name", "a block that looks at her", "a look at her"],
)
@pytest.mark.parametrize("first", [None, EMPTY], ids=["no world", "nobody"])
async def test_what_needs_somebody_waits_for_the_first_person(
    hub: MemoryHub, thing: Thing, first: World | None
) -> None:
    since, people = await waited(hub, thing, first)

    # Nobody knows here who is one person: the first world that is told of waits for that.
    assert (since, people) == (2.0 if first is not None else 2.0 + SAME_PATIENCE, ["ann"])


async def test_it_waits_no_longer_than_a_fragment_does(hub: MemoryHub) -> None:
    assert await waited(hub, fragment(), EMPTY, then=EMPTY) == (5.0, [])


@pytest.mark.parametrize(
    ("thing", "first", "knows"),
    [
        (block(), None, ["unknown"]),
        (block("robot"), None, ["unknown"]),
        (fragment(), FULL, ["ann"]),
        (block("moon"), FULL, ["ann"]),
        (block("cup"), EMPTY, []),
    ],
    ids=["no target", "the robot", "somebody is there", "a misspelled target", "a cup that is there"],
)
async def test_what_needs_nobody_does_not_wait(
    hub: MemoryHub, thing: Thing, first: World | None, knows: list[str]
) -> None:
    services = {} if first is None else {"simulation": partial(show_world, world=first)}
    async with running(hub, services), connect(hub=hub) as robot:
        world = await world_with_people(robot, [thing], "robot", 5.0)

        assert robot.now() == (0.0 if first is None else SAME_PATIENCE)
        assert ([entity.id for entity in world.people] if world is not None else ["unknown"]) == knows


@pytest.mark.real_time
async def test_a_fragment_is_played_right_after_the_start_before_anybody_is_seen(tmp_path: Path) -> None:
    endpoint = free_endpoint()
    (tmp_path / "ask.xml").write_text(FRAGMENT)
    world = table_world()
    nobody = World(entities=tuple(entity for entity in world.entities if entity.kind != "person"))
    programs = []
    try:
        async with await open_hub("robot", listen=[endpoint]) as hub:
            bus = hub.join("simulation", "simulation")
            presence = bus.subscribe(keys.ANY_ALIVE)
            bus.declare_alive()
            bus.publish(keys.WORLD, nobody)
            for name in ("control", "realizer", "recognition", "generation"):
                programs.append(await start("run", name, "--connect", endpoint))
                await line(programs[-1], f"{name} is ready")
            play = await start("play", "--connect", endpoint, tmp_path / "ask.xml")
            programs.append(play)
            async with asyncio.timeout(PATIENCE):
                async for received in presence:
                    if isinstance(received.message, PeerAlive) and received.message.participant.startswith("client-"):
                        break
                # A world without anybody is what it sees first, then, half a second later, there is somebody.
                asyncio.get_running_loop().call_later(0.5, bus.publish, keys.WORLD, world)
                _, err = await play.communicate()

        # A machine that is busy for a moment makes the robot late, and that is told truly; nothing else may be told.
        assert (play.returncode, [told for told in err.splitlines() if b"LATE" not in told]) == (0, [])
    finally:
        for program in programs:
            await stopped(program)
