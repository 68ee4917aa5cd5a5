"""`engage play` while a part of the robot dies: it tells that the end is unknown, with the words that were heard."""

import asyncio
import json
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path

import pytest

from engage_hri.services.bus.interface import Hub
from engage_hri.services.commandline.embedding import in_memory
from engage_hri.services.commandline.shell.settings import RobotConfig
from engage_hri.services.commandline.talk import play
from engage_hri.services.runtime.service import Service, running
from tests.cli.command import Engage

PLAY = ("play", "--embedded", "--virtual-time", "--outcomes", "-", "--quiet")
TEXT = "One two three four five six seven eight nine ten eleven twelve."
FRAGMENT = f"""\
<ebml:ebml xmlns:ebml="edu.wpi.ebml" xmlns="org.mindmakers.bml" id="count" turnIndex="1" turnStatus="full">
<speech id="s"><text>{TEXT}</text></speech></ebml:ebml>"""


@pytest.fixture
def mortal(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> str:
    """A private system in which one service dies after three seconds."""
    dying: str = request.param

    @asynccontextmanager
    async def system(config: RobotConfig, services: dict[str, Service]) -> AsyncIterator[Hub]:
        dies_early = {dying: services.pop(dying)}
        async with in_memory(config, services) as hub, AsyncExitStack() as life:
            await life.enter_async_context(running(hub, dies_early))

            async def dies() -> None:
                await asyncio.sleep(3.0)
                await life.aclose()

            death = asyncio.create_task(dies())
            yield hub
            await death

    monkeypatch.setattr(play, "in_memory", system)
    return dying


@pytest.mark.parametrize("mortal", ["generation", "realizer"], indirect=True)
def test_what_a_service_that_died_was_doing_is_told_as_unknown(engage: Engage, tmp_path: Path, mortal: str) -> None:
    file = tmp_path / "count.xml"
    file.write_text(FRAGMENT)

    result = engage(*PLAY, file)

    assert result.code == 3
    assert f"{mortal} has not been seen for" in result.err
    (told,) = map(json.loads, result.out.splitlines())
    assert told["status"] == "unknown"
    # What had been said is known from the voice, if generation lives to tell it.
    said = told.get("said", "")
    assert said.startswith("One two three") is (mortal == "realizer")
    assert TEXT.startswith(said)
    assert "twelve" not in said
