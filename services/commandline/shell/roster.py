"""Services by name, and groups that share a process.

Each is imported only when it is to run, so that a robot never loads the simulation.
"""

from collections.abc import Iterable, Sequence
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING, Any

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.services.commandline.shell.settings import ELSEWHERE, RobotConfig
from engage_hri.services.runtime.installation import SERVICES, extra_command, offers
from engage_hri.services.runtime.service import Service

if TYPE_CHECKING:
    from engage_hri.services.commandline.shell.config import Config

ROBOT: tuple[str, ...] = keys.SERVICES
"""Services of a robot; the others play the person, the table and the task. An installed package offers those."""
TASK = "collaboration"
"""Service that ends by itself, with the task."""
SENSES = ("hearing", "eyes", "pieces")
"""Services that find out what people do from sensors; a robot may do without."""
DOOR = "door"
"""Service that lets programs in any language drive the robot."""
PLAY = (*ROBOT, *ELSEWHERE)
"""A robot with simulated people and their task: nothing of it needs a device."""
NAMES = (*ROBOT, *SENSES, DOOR, *ELSEWHERE)
FUNCTIONS = {"generation": "generate", "realizer": "realize", "recognition": "recognize", "control": "embody"}
"""Coroutine function in the `service.py` of each service of a robot."""

Groups = Sequence[tuple[str, ...]]
"""Names of the services of each process."""


def group(names: str) -> tuple[str, ...]:
    """Names of services that share a process: `realizer,control`. Raises InputRefused."""
    found = tuple(name.strip() for name in names.split(","))
    for name in found:
        if name not in NAMES:
            advice = f"one of {', '.join(NAMES)}, or several, as realizer,control"
            raise InputRefused(Fault(reason=f"{name!r} is not one of the services", where=names, advice=advice))
        if found.count(name) > 1:
            raise InputRefused(Fault(reason=f"{name} is there twice", where=names))
    return found


def groups(names: Sequence[str], together: Iterable[str]) -> Groups:
    """Divide the services among processes: these groups, and each other service by itself. Raises InputRefused."""
    given = [group(each) for each in together]
    home = {name: each for each in given for name in each}
    for each in given:
        for name in each:
            if name not in names:
                reason = f"{name} does not run here: {', '.join(names)} do"
                raise InputRefused(Fault(reason=reason, where="--together"))
            if home[name] is not each:
                reason = f"{name} is in two groups: {','.join(each)} and {','.join(home[name])}"
                raise InputRefused(Fault(reason=reason, where="--together"))
    return tuple(dict.fromkeys(home.get(name, (name,)) for name in names))


def service(name: str, config: RobotConfig, **more: object) -> Service:
    """Bind a service's coroutine function to its section of the configuration. Raises InputRefused.

    more: further arguments of that function.
    """
    [name] = group(name)
    function = (
        getattr(import_module(f"engage_hri.services.{name}.service"), FUNCTIONS[name])
        if name in ROBOT
        else _offered(name)
    )
    shared = {"covered_for": config.covered_for} if name in ("generation", "control") else {}
    return partial(function, config=getattr(config, name), **shared, **more)


def _offered(name: str) -> Any:
    """Coroutine function of a service that a package offers. Raises InputRefused if none does."""
    for offer in offers(SERVICES):
        if offer.name == name:
            return offer.load()
    raise InputRefused(
        Fault(reason="no package that is installed offers it", where=name, advice=extra_command("tangram"))
    )


def complete() -> "type[Config]":
    """Configuration of a robot and of those who stand in for people and the task.

    Raises InputRefused if these are not installed.
    """
    try:
        from engage_hri.services.commandline.shell.config import Config
    except ModuleNotFoundError as error:
        raise InputRefused(Fault(reason="the tangram is not installed", advice=extra_command("tangram"))) from error
    return Config


def widest() -> type[RobotConfig]:
    """Configuration of all services that are installed."""
    try:
        return complete()
    except InputRefused:
        return RobotConfig
