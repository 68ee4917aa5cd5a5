"""The services by name. Each is imported only when it is to run: what drives a robot never loads the simulation."""

from functools import partial
from importlib import import_module
from typing import Literal, get_args

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.services.commandline.settings import RobotConfig
from engage_hri.services.runtime.service import Service

ServiceName = Literal["generation", "realizer", "recognition", "control", "simulation", "collaboration"]
NAMES: tuple[str, ...] = get_args(ServiceName)
ROBOT: tuple[str, ...] = keys.SERVICES
"""What runs with a robot; the others stand in for the person, the table and the task."""
DOES = {
    "generation": "generate", "realizer": "realize", "recognition": "recognize", "control": "embody",
    "simulation": "simulate", "collaboration": "collaborate",
}  # fmt: skip
"""The coroutine function in each one's `service.py`."""


def service(name: str, config: RobotConfig) -> Service:
    """The service's coroutine function with its section of the configuration bound. Raises InputRefused."""
    if name not in NAMES:
        raise InputRefused(Fault(reason=f"no service {name!r}", advice=f"one of {', '.join(NAMES)}"))
    module = import_module(f"engage_hri.services.{name}.service")
    shared = {"covered_for": config.covered_for} if name in ("generation", "control") else {}
    return partial(getattr(module, DOES[name]), config=getattr(config, name), **shared)
