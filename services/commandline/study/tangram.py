"""Session of the anchor tangram, from the person's arrival to their leaving, with all services in this process."""

from collections.abc import Iterable
from contextlib import nullcontext
from pathlib import Path

from engage_hri.schemas import keys
from engage_hri.services.bus.interface import Hub
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.commandline.embedding import services as bound
from engage_hri.services.commandline.shell import roster
from engage_hri.services.commandline.shell.config import Config
from engage_hri.services.commandline.study.record import recording
from engage_hri.services.console.follow import Sink, following
from engage_hri.services.runtime.service import running

DEFAULTS = ("recognition.gaze_resolution=table",)
"""Settings for the transcript: its annotators saw that a look went to the table, but rarely to which piece."""


async def play_tangram(
    config: Config, sinks: Iterable[Sink], hub: Hub | None = None, record: Path | None = None
) -> None:
    """Run all services until the task is over. sinks: get all messages, with instants of this loop.

    hub: the bus on which they run, for others to look on; None: one in memory. record: a file for all that is said.
    """
    async with MemoryHub(config.robot, decodes=False) if hub is None else nullcontext(hub) as hub:
        services = bound(config, *roster.NAMES)
        kept = recording(hub.join("record"), record, (keys.EVERYTHING,), {}) if record else nullcontext()
        async with kept, following(hub.join("console"), sinks), running(hub, services) as over:
            await over.wait()
