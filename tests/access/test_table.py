"""The table of access against what really flows: nothing flows that it denies, and each row is of some use."""

import asyncio
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import zenoh

from engage_hri.schemas import access, keys
from engage_hri.schemas.access import OWN, TABLE, Row
from engage_hri.schemas.behaviors import Gaze, Speech
from engage_hri.schemas.body_faults import BodyFault
from engage_hri.schemas.faults import InputRefused
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.services.bus.interface import Bus
from engage_hri.services.client.people.perceive import perceive
from engage_hri.services.client.robot import Robot
from engage_hri.services.commandline.shell import roster
from engage_hri.services.commandline.shell.config import Config
from engage_hri.services.console.follow import following
from engage_hri.services.perception.eyes.config import EyesConfig
from engage_hri.services.perception.hearing.config import HearingConfig
from engage_hri.services.runtime.service import Ready, running
from engage_hri.services.simulation.still import show_world, table_world
from engage_hri.services.tangram.people.config import SimulationConfig
from tests.access.spy import Flow, SpyHub
from tests.perception.eyes.faces import recorded
from tests.perception.eyes.people import Pose
from tests.perception.spoken import spoken, write_wav

ROLES = {
    "alice": "manager", "alice-log": "manager", "viewer": "observer", "guard": "operator", "camera": "perception",
}  # fmt: skip
LIMIT = 900.0
SPEECH = Speech(id="s", text="one two three four five six seven eight nine ten eleven twelve")


def is_granted(row: Row, flow: Flow) -> bool:
    """As Zenoh has it, which knows nothing of the table."""
    expression = zenoh.KeyExpr(row.key.replace(OWN, flow.name))
    return (row.role, row.does) == (flow.role, flow.does) and expression.includes(flow.key)


async def tangram(flows: set[Flow], simulation: SimulationConfig) -> None:
    """The whole task, watched."""
    config, over = Config(simulation=simulation), asyncio.Event()
    services = {name: roster.service(name, config) for name in roster.PLAY}
    task = services["collaboration"]

    async def collaboration(bus: Bus, ready: Ready) -> None:
        await task(bus, ready)
        over.set()

    async with SpyHub(flows, ROLES) as hub:
        watching = following(hub.join("viewer"), [lambda message, at: None])
        async with watching, running(hub, {**services, "collaboration": collaboration}), asyncio.timeout(LIMIT):
            await over.wait()


async def listen(flows: set[Flow], folder: Path) -> None:
    """A service that hears a file, in which somebody speaks."""
    path = write_wav(folder / "said.wav", spoken("yes").samples)
    config = Config(hearing=HearingConfig(source=str(path)))
    services = {name: roster.service(name, config) for name in ("recognition", "hearing")}
    async with SpyHub(flows, ROLES) as hub, running(hub, services) as over:
        await over.wait()


async def look(flows: set[Flow], folder: Path) -> None:
    """A service that sees somebody nod, as it was recorded."""
    path = recorded(folder / "seen.mcap", lambda at: [Pose(pitch=9 * float(np.sin(11 * at)))], 2.0)
    config = Config(eyes=EyesConfig(source=f"landmarks:{path}"))
    services = {name: roster.service(name, config) for name in ("recognition", "eyes")}
    async with SpyHub(flows, ROLES) as hub, running(hub, services) as over:
        await over.wait()


async def visit(flows: set[Flow]) -> None:
    """All that the public client can do, in a world that stands still, and an operator who steers."""
    config = Config()
    services = {name: roster.service(name, config) for name in keys.SERVICES}
    perception = partial(show_world, world=table_world(), is_attentive=True)
    async with SpyHub(flows, ROLES) as hub, running(hub, {"simulation": perception, **services}):
        viewer = hub.join("viewer")
        nets = following(viewer, [lambda message, at: None], patterns=(keys.NET,))
        log = following(hub.join("alice-log"), [lambda message, at: None])
        async with nets, log, Robot.on(hub.join("alice")) as alice, Robot.on(hub.join("guard")) as guard:
            feeds = [alice.connection_events(open=True), alice.turns(), alice.feedback(), alice.actions()]
            feeds += [alice.faults(), alice.worlds(), alice.head_owners(), alice.statistics_updates()]
            feeds += [alice.utterances(), alice.conditions()]
            await alice.statistics()
            async with perceive("carl", hub=hub, name="camera") as carl:
                await carl.say("hello")
            async with alice.inhibit_gaze():
                speaking = asyncio.create_task(alice.realize("b", [SPEECH]))
                await asyncio.sleep(2.0)
                await guard.hold()
                await guard.resume()
                await guard.switch_faults([BodyFault(kind="miscalibrated", part="right_arm")])
                await guard.set_condition("operational")
                await alice.interrupt("b", "s")
                await speaking
            performing = asyncio.create_task(alice.perform(TurnFragment(id="whole", behaviors=(SPEECH,))))
            await asyncio.sleep(2.0)
            async with perceive("human", hub=hub, name="camera") as person:
                await person.say("uh-huh")
            await performing
            performing = asyncio.create_task(alice.perform(TurnFragment(id="cut", behaviors=(SPEECH,))))
            await asyncio.sleep(2.0)
            performing.cancel()
            await asyncio.wait([performing])
            with pytest.raises(InputRefused):
                await alice.perform(TurnFragment(id="bad", behaviors=(Gaze(id="g", target="nobody"),)))
            looking = TurnFragment(id="look", behaviors=(Gaze(id="g", target="blue-square"), SPEECH))
            performing = asyncio.create_task(alice.perform(looking))
            await asyncio.sleep(1.0)
            async with alice.inhibit_gaze("release"):
                await performing
            for feed in feeds:
                feed.close()


@pytest.fixture(scope="module")
def flows(tmp_path_factory: pytest.TempPathFactory) -> set[Flow]:
    """All flows of all these runs."""
    from tests.conftest import virtual_loop

    found: set[Flow] = set()

    async def everything() -> None:
        await tangram(found, SimulationConfig())
        await tangram(found, SimulationConfig(perception="raw"))
        await visit(found)
        await listen(found, tmp_path_factory.mktemp("heard"))
        await look(found, tmp_path_factory.mktemp("seen"))

    with asyncio.Runner(loop_factory=virtual_loop) as runner:
        runner.run(everything())
    return found


def test_nothing_flows_that_the_table_denies(flows: set[Flow]) -> None:
    assert len(flows) > 100
    for name in ("hearing", "eyes"):
        assert {"publishes", "subscribes", "serves"} <= {flow.does for flow in flows if flow.name == name}
    assert not sorted(flow for flow in flows if not any(is_granted(row, flow) for row in TABLE))


def test_every_row_is_used_or_has_its_reason(flows: set[Flow]) -> None:
    idle = [row for row in TABLE if not row.why and not any(is_granted(row, flow) for flow in flows)]
    assert not idle


def test_the_table_is_a_table() -> None:
    assert len({row[:3] for row in TABLE}) == len(TABLE)
    for row in TABLE:
        zenoh.KeyExpr(row.key.replace(OWN, "name"))
    assert set(keys.SERVICES) <= set(access.ROLES) <= set(keys.ROLES)


def test_no_role_publishes_what_is_anothers() -> None:
    """Each event, state and stream of a service is its own."""
    for row in TABLE:
        chunks = row.key.split("/")
        if row.does == "publishes" and chunks[2] in ("evt", "state", "stream") and chunks[3] != OWN:
            of = "perception" if row.role == "wizard" else row.role
            assert chunks[3] == of, row
        if row.does == "publishes" and chunks[2] == "cmd":
            assert chunks[4:6] == [row.role, OWN], row


def test_observers_command_nobody_and_hear_no_commands() -> None:
    for row in TABLE:
        if row.role == "observer":
            assert "/cmd/" not in row.key
            assert row.does == "subscribes" or row.key in (keys.fault(OWN), access.ANY_STATUS, keys.DESCRIBE)
