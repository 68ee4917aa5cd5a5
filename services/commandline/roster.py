"""Services by name. Each is imported only when it is to run, so that a robot never loads the simulation."""

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
"""Services of a robot; the others play the person, the table and the task."""
FUNCTIONS = {
    "generation": "generate", "realizer": "realize", "recognition": "recognize", "control": "embody",
    "simulation": "simulate", "collaboration": "collaborate",
}  # fmt: skip
"""Coroutine function in the `service.py` of each service."""


def service(name: str, config: RobotConfig, **more: object) -> Service:
    """Bind a service's coroutine function to its section of the configuration. Raises InputRefused.

    more: further arguments of that function.
    """
    if name not in NAMES:
        raise InputRefused(Fault(reason=f"no service {name!r}", advice=f"one of {', '.join(NAMES)}"))
    module = import_module(f"engage_hri.services.{name}.service")
    shared = {"covered_for": config.covered_for} if name in ("generation", "control") else {}
    return partial(getattr(module, FUNCTIONS[name]), config=getattr(config, name), **shared, **more)
