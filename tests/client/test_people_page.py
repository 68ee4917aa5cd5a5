"""The program of docs/people.md as it stands there, in a process of its own, over Zenoh."""

import asyncio
import os
import re
import sys
from functools import partial
from pathlib import Path

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.actions import ActionBegan, ActionEnded, ActorFound, ActorLost
from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import Utterance
from engage_hri.schemas.recognition import ConnectionEvent
from engage_hri.services.bus.zenoh.hub import open_hub
from engage_hri.services.client.robot import Robot
from engage_hri.services.commandline import roster
from engage_hri.services.commandline.config import Config
from engage_hri.services.runtime.service import running
from engage_hri.services.simulation.still import show_world, tangram_world
from tests.bus.places import PATIENCE, free_endpoint

pytestmark = pytest.mark.real_time

PAGE = Path(__file__).resolve().parents[2] / "docs" / "people.md"


def named(message: Message) -> str:
    match message:
        case ActorFound() | ActorLost():
            return type(message).__name__
        case ActionBegan(action=action, targets=targets) | ActionEnded(action=action, targets=targets):
            return " ".join(("+" if isinstance(message, ActionBegan) else "-", action, *targets))
        case Utterance(final=True, text=text):
            return text
    return ""


async def test_the_program_of_the_page_runs_over_zenoh(tmp_path: Path) -> None:
    (code,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)
    program, endpoint = tmp_path / "people.py", free_endpoint()
    program.write_text(code)
    services = {
        "recognition": roster.service("recognition", Config()),
        "simulation": partial(show_world, world=tangram_world()),
    }
    told: list[Message] = []
    async with (
        await open_hub("seen", listen=[endpoint]) as hub,
        running(hub, services),
        Robot.on(hub.join("watcher")) as robot,
        asyncio.timeout(PATIENCE),
    ):
        patterns = (keys.PERCEIVED_ACTION, keys.UTTERANCE, keys.ANY_CONNECTION_EVENT)
        with hub.join("log").subscribe(*patterns) as inbox:
            process = await asyncio.create_subprocess_exec(
                sys.executable,
                program,
                env={**os.environ, "ENGAGE_BUS_ROBOT": "seen", "ENGAGE_BUS_CONNECT": endpoint},
            )
            async for received in inbox:
                message = received.message
                if getattr(message, "actor", "ann") == "ann":
                    told.append(message)
                if isinstance(message, ActorLost):
                    break
            assert await process.wait() == 0
        with robot.worlds() as worlds:
            async for world in worlds:
                if world.entity("ann") is None and (moved := world.entity("blue-square")) is not None:
                    break

    assert [text for text in map(named, told) if text] == [
        "ActorFound", "+ look seen", "+ speak", "- speak", "Is that blue one mine?", "+ point blue-square",
        "- point blue-square", "+ act blue-square", "- act blue-square", "+ nod", "- nod", "thanks", "- look seen",
        "ActorLost",
    ]  # fmt: skip
    words = {event.words for event in told if isinstance(event, ConnectionEvent) and event.kind == "adjacency_pair"}
    assert "Is that blue one mine?" in words
    assert moved.position == (0.5, 0.1, 0.72)
