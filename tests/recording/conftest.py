"""The anchor scenario, recorded once for all tests that only read it."""

import asyncio
from pathlib import Path
from typing import NamedTuple

import pytest

from engage_hri.schemas.messages import Message
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Received
from engage_hri.services.commandline.shell.config import Config
from engage_hri.services.control.testing.plugin import virtual_loop
from engage_hri.services.recording.disk import read
from engage_hri.services.recording.reading import Recording
from engage_hri.services.tangram.people.config import SimulationConfig
from tests import plays
from tests.recording.runs import tangram

Told = list[tuple[Message, Seconds]]


class Anchor(NamedTuple):
    """A recorded run. live: what a subscription got meanwhile. told: what a console followed, with the instants."""

    path: Path
    live: list[Received]
    told: Told

    @property
    def recording(self) -> Recording:
        return read(self.path)


def _anchor(folder: Path) -> tuple[list[Received], Told]:
    told: Told = []
    config = Config(simulation=SimulationConfig(human="appendix-b"))
    with asyncio.Runner(loop_factory=virtual_loop) as runner:
        live = runner.run(tangram(folder / "a.mcap", config, lambda message, at: told.append((message, at))))
    return live, told


@pytest.fixture(scope="session")
def anchor(tmp_path_factory: pytest.TempPathFactory) -> Anchor:
    folder, (live, told) = plays.once(tmp_path_factory, "anchor", _anchor)
    return Anchor(folder / "a.mcap", live, told)


@pytest.fixture
def task(anchor: Anchor) -> Recording:
    return anchor.recording
