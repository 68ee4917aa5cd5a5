"""The services by name. Each is imported only when it is to run: what drives a robot never loads the simulation."""

from functools import partial
from typing import Literal, get_args

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.services.commandline.config import Config
from engage_hri.services.runtime.service import Service

ServiceName = Literal["generation", "realizer", "recognition", "control", "simulation", "collaboration"]
NAMES: tuple[str, ...] = get_args(ServiceName)
ROBOT: tuple[str, ...] = keys.SERVICES
"""What runs with a robot; the others stand in for the person, the table and the task."""


def service(name: str, config: Config) -> Service:
    """The service's coroutine function with its section of the configuration bound. Raises InputRefused."""
    match name:
        case "generation":
            from engage_hri.services.generation.service import generate

            return partial(generate, config=config.generation)
        case "realizer":
            from engage_hri.services.realizer.service import realize

            return partial(realize, config=config.realizer)
        case "recognition":
            from engage_hri.services.recognition.service import recognize

            return partial(recognize, config=config.recognition)
        case "control":
            from engage_hri.services.control.service import embody

            return partial(embody, config=config.control)
        case "simulation":
            from engage_hri.services.simulation.service import simulate

            return partial(simulate, config=config.simulation)
        case "collaboration":
            from engage_hri.services.collaboration.service import collaborate

            return partial(collaborate, config=config.collaboration)
    raise InputRefused(Fault(reason=f"no service {name!r}", advice=f"one of {', '.join(NAMES)}"))
