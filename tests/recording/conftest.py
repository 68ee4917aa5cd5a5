"""The anchor scenario, recorded once for all tests that only read it."""

import asyncio
from collections.abc import Callable
from pathlib import Path

import pytest

from engage_hri.schemas.messages import Message
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Received
from engage_hri.services.commandline.shell.config import Config
from engage_hri.services.control.testing.plugin import virtual_loop
from engage_hri.services.recording.disk import read
from engage_hri.services.recording.reading import Recording
from engage_hri.services.tangram.people.config import SimulationConfig
from tests.recording.runs import tangram


class Anchor:
    """A recorded run. live: what a subscription got meanwhile. told: what a console followed, with the instants."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.told: list[tuple[Message, Seconds]] = []
        config = Config(simulation=SimulationConfig(human="appendix-b"))
        note: Callable[[Message, Seconds], None] = lambda message, at: self.told.append((message, at))  # noqa: E731
        with asyncio.Runner(loop_factory=virtual_loop) as runner:
            self.live: list[Received] = runner.run(tangram(path, config, note))

    @property
    def recording(self) -> Recording:
        return read(self.path)


@pytest.fixture(scope="session")
def anchor(tmp_path_factory: pytest.TempPathFactory) -> Anchor:
    return Anchor(tmp_path_factory.mktemp("anchor") / "a.mcap")


@pytest.fixture
def task(anchor: Anchor) -> Recording:
    return anchor.recording
