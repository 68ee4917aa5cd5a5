"""The door: lets programs in any language drive the robot and follow it, over HTTP and WebSockets."""

import asyncio
import os
from collections.abc import Mapping
from pathlib import Path

from engage_hri.schemas.faults import Fault, InputRefused, RunFailed, raised_as
from engage_hri.services.bus import journal
from engage_hri.services.bus.interface import Bus
from engage_hri.services.client.robot import Robot
from engage_hri.services.door.config import DoorConfig
from engage_hri.services.door.server import DoorServer
from engage_hri.services.runtime.service import Ready, tell_settings
from engage_hri.services.web.https import server_keys
from engage_hri.services.web.serving import serving
from engage_hri.services.web.tokens import kept_token


async def open_door(bus: Bus, ready: Ready, config: DoorConfig) -> None:
    """Serve until cancelled. Raises InputRefused for bad files, and RunFailed if the port is taken."""
    tokens = _tokens(config)
    keys = server_keys(Path(config.https), (config.host, "localhost", "127.0.0.1")) if config.https else None
    async with Robot.on(bus) as robot:
        door = DoorServer(robot, bus, tokens)
        try:
            async with serving(door.application(), config.host, config.port, keys) as port:
                _tell(bus, config, port, is_safe=keys is not None)
                tell_settings(bus, "door", config)
                ready()
                await asyncio.Event().wait()
        except OSError as error:
            reason = os.strerror(error.errno) if error.errno else str(error)
            advice = "door.port=0 takes any that is free"
            raise RunFailed(Fault(reason=reason, where=f"{config.host}:{config.port}", advice=advice)) from error


def _tokens(config: DoorConfig) -> Mapping[str, str]:
    """The token of each role. Raises InputRefused if the folder cannot be made."""
    folder = Path(config.folder)
    with raised_as(InputRefused, OSError, folder, "cannot be made"):
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    return {role: kept_token(folder / role) for role in config.roles}


def _tell(bus: Bus, config: DoorConfig, port: int, *, is_safe: bool) -> None:
    """Tell a person where the door is, and how one comes in."""
    host = f"[{config.host}]" if ":" in config.host else config.host
    journal.alert(bus.log, "the door is at %s://%s:%d/v1/", "https" if is_safe else "http", host, port)
    for role in config.roles:
        journal.alert(bus.log, "token of the role %s: in %s", role, Path(config.folder) / role)
