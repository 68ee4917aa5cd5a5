"""Configuration of all services, with those that play the person, the table and the task.

Each service documents its own section in its `config.py`; docs/configuration.md is made from those.
"""

from collections.abc import Iterable
from pathlib import Path

from engage_hri.services.commandline.shell.settings import RobotConfig
from engage_hri.services.runtime.configuration import read
from engage_hri.services.tangram.collaboration.config import CollaborationConfig
from engage_hri.services.tangram.people.config import SimulationConfig


class Config(RobotConfig, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Sections for the robot, the simulation and the collaboration."""

    simulation: SimulationConfig = SimulationConfig()
    collaboration: CollaborationConfig = CollaborationConfig()


def load(path: Path | None = None, *, settings: Iterable[str] = (), defaults: Iterable[str] = ()) -> Config:
    """Read the whole configuration from a file, and nothing of the environment (see `read`)."""
    return read(Config, path, settings=settings, defaults=defaults)
