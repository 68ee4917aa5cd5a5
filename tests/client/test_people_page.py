"""The program of docs/people.md as it stands there, in a process of its own, over Zenoh."""

import asyncio
import os
import re
import sys
from functools import partial
from pathlib import Path

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, ActorLost, Utterance
from engage_hri.schemas.recognition import ConnectionEvent
from engage_hri.schemas.world import World
from engage_hri.services.bus.zenoh.hub import open_hub
from engage_hri.services.client.robot import Robot
from engage_hri.services.commandline.shell import roster
from engage_hri.services.commandline.shell.config import Config
from engage_hri.services.runtime.service import running
from engage_hri.services.simulation.still import show_world, table_world
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


def written(program: Path, number: int) -> Path:
    """A file with a program of the page."""
    program.write_text(re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)[number])
    return program


async def told_by(program: Path, actor: str) -> tuple[list[Message], World]:
    """What a program of the page says of a person until this one has left, and what the world is then."""
    endpoint = free_endpoint()
    services = {
        "recognition": roster.service("recognition", Config()),
        "simulation": partial(show_world, world=table_world()),
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
                if getattr(message, "actor", actor) == actor:
                    told.append(message)
                if isinstance(message, ActorLost):
                    break
            assert await process.wait() == 0
        with robot.worlds() as worlds:
            async for world in worlds:
                if world.entity(actor) is None and world.entity("blue-square") is not None:
                    break
    return told, world


def pairs_about(told: list[Message]) -> set[str]:
    """Words of the adjacency pairs."""
    return {event.words for event in told if isinstance(event, ConnectionEvent) and event.kind == "adjacency_pair"}


async def test_the_program_of_the_page_runs_over_zenoh(tmp_path: Path) -> None:
    told, world = await told_by(written(tmp_path / "people.py", 0), "ann")
    moved = world.entity("blue-square")

    assert [text for text in map(named, told) if text] == [
        "ActorFound", "+ look seen", "+ speak", "- speak", "Is that blue one mine?", "+ point blue-square",
        "- point blue-square", "+ act blue-square", "- act blue-square", "+ nod", "- nod", "thanks", "- look seen",
        "ActorLost",
    ]  # fmt: skip
    assert "Is that blue one mine?" in pairs_about(told)
    assert moved is not None
    assert moved.position == (0.5, 0.1, 0.72)


async def test_the_recognizer_of_the_page_runs_over_zenoh(tmp_path: Path) -> None:
    told, _ = await told_by(written(tmp_path / "recognizer.py", 1), "ben")
    words = [(each.text, each.final) for each in told if isinstance(each, Utterance)]

    done = ["ActorFound", "+ speak", "- speak", "Is that mine?", "ActorLost"]
    assert [text for text in map(named, told) if text] == done
    assert words == [("", False), ("is that", False), ("Is that mine?", True)]
    assert "Is that mine?" in pairs_about(told)
