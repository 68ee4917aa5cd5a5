"""Attack on the whole robot, in this process and in virtual time; for tests of one's own body or client, too."""

from collections.abc import Callable, Mapping
from functools import partial

from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus
from engage_hri.services.commandline.embedding import services
from engage_hri.services.commandline.shell import roster
from engage_hri.services.commandline.shell.config import Config
from engage_hri.services.commandline.shell.sources import still
from engage_hri.services.control.contract.body import Body
from engage_hri.services.control.service import embody
from engage_hri.services.runtime.service import Ready, Service
from engage_hri.services.simulation.still import table_world
from tests.rigs.hostile.trial import KINDS, Attack, Client, Kind, Report, run

BodyMaker = Callable[[], Body]


def attack(
    seed: int,
    config: Config | None = None,
    *,
    seconds: Seconds = 20.0,
    kinds: tuple[Kind, ...] = KINDS,
    body: BodyMaker | None = None,
    client: Client | None = None,
) -> Report:
    """Attack the whole robot once.

    body: makes the body behind the real control, once the loop runs. Without it a lying body takes the place of
    control if `kinds` has "body". client: gets the hub, and must have ended when the attack is over.
    """
    plan = Attack(seed=seed, kinds=kinds, seconds=seconds, own_body=body is not None)
    return run(plan, whole_robot(config, body), client)


def whole_robot(config: Config | None = None, body: BodyMaker | None = None) -> Mapping[str, Service]:
    """Services of a robot with their configuration, and a still table with a person at it."""
    config = config or Config()
    robot = services(config, *roster.ROBOT)
    if body is not None:
        robot["control"] = partial(_embody, config=config, make=body)
    return {"simulation": still(table_world()), **robot}


async def _embody(bus: Bus, ready: Ready, config: Config, make: BodyMaker) -> None:
    await embody(bus, ready, config.control, make(), covered_for=config.covered_for)
