"""People look at what the robot's arm is really on, where that is not what the robot means."""

import asyncio
import math
from functools import partial

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Pointing
from engage_hri.schemas.body import Ray, RobotSeen
from engage_hri.schemas.perception import ActionBegan
from engage_hri.schemas.units import Stamp, Vector
from engage_hri.schemas.world import Entity
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.robot import Robot
from engage_hri.services.control.config import ControlConfig, Miscalibrated, Variability
from engage_hri.services.control.service import embody
from engage_hri.services.realizer.config import RealizerConfig
from engage_hri.services.realizer.service import realize
from engage_hri.services.runtime.service import running
from engage_hri.services.tangram.people.config import SimulationConfig
from engage_hri.services.tangram.people.person_at_table import PATIENCE, SeenArms
from engage_hri.services.tangram.people.service import simulate
from engage_hri.services.tangram.table import tangram_table

THINGS = tuple([Entity(id=f"t{n}", kind="object", position=(0.5, 0.1 * n, 0.0)) for n in range(-3, 4)])
PERSON = tangram_table().person.id


def seen(angle: float, at: float = 0.0) -> RobotSeen:
    """A right arm that points so many degrees to the left of straight ahead; the left one rests to the right."""
    turned = math.radians(angle)
    right = Ray(origin=(0.0, 0.0, 0.0), axis=(math.cos(turned), math.sin(turned), 0.0))
    return RobotSeen(
        at=Stamp("test", at), right_arm=right, left_arm=Ray(origin=(0.0, 0.5, 0.0), axis=(0.0, 1.0, 0.0))
    )


def test_without_a_word_of_it_the_arm_is_on_what_it_means() -> None:
    arms = SeenArms()

    assert not arms.are_moving(0.0)
    assert arms.meant("t2", THINGS) == "t2"


@pytest.mark.parametrize(("angle", "meant"), [(0.0, "t0"), (11.3, "t1"), (22.0, "t2"), (-30.0, "t-3")])
def test_the_arm_is_on_the_thing_nearest_to_its_axis(angle: float, meant: str) -> None:
    arms = SeenArms()
    arms.see(seen(angle))

    assert arms.meant("t0", THINGS) == meant
    assert arms.meant("elsewhere", THINGS) == "elsewhere"
    arms.see(RobotSeen(at=Stamp("test", 1.0)))
    assert arms.meant("t0", THINGS) == "t0"


def test_people_wait_until_the_arm_rests_but_not_for_ever() -> None:
    arms = SeenArms()
    arms.see(seen(0.0))
    arms.see(seen(5.0))
    assert arms.are_moving(1.0)
    arms.see(seen(5.1))
    assert not arms.are_moving(1.1)
    arms.see(seen(15.0))
    assert arms.are_moving(2.0)
    assert not arms.are_moving(2.0 + PATIENCE)


async def looked_at(off: float) -> list[str]:
    """Pieces that the person looks at while the robot points at the blue square."""
    fault = (Miscalibrated(part="right_shoulder_yaw", angle=off), Miscalibrated(part="left_shoulder_yaw", angle=off))
    config = ControlConfig(variability=Variability(miscalibrated=fault if off else ()))
    looks: list[str] = []

    async def follow(hub: MemoryHub) -> None:
        with hub.join("viewer").subscribe(keys.PERCEIVED_ACTION) as inbox:
            async for received in inbox:
                message = received.message
                if isinstance(message, ActionBegan) and message.actor == PERSON and message.action == "look":
                    looks.append(message.targets[0])

    async with MemoryHub() as hub:
        services = {
            "simulation": partial(simulate, config=SimulationConfig(human="attentive"), awaited=()),
            "control": partial(embody, config=config),
            "realizer": partial(realize, config=RealizerConfig()),
        }
        following = asyncio.create_task(follow(hub))
        async with running(hub, services), Robot.on(hub.join("alice")) as robot:
            await robot.person(20.0)
            await asyncio.sleep(5.0)
            looks.clear()
            await robot.realize("b", [Pointing(id="p", target="blue-square")])
            await asyncio.sleep(2.0)
        following.cancel()
        await asyncio.gather(following, return_exceptions=True)
    return [piece for piece in looks if piece not in ("robot", "table")]


async def test_a_person_is_led_to_another_piece_by_an_arm_that_is_beside() -> None:
    assert await looked_at(0.0) == ["blue-square"]
    (led,) = await looked_at(15.0)

    assert led != "blue-square"
    places = {piece.id: place(piece.id) for piece in tangram_table().pieces}
    assert math.dist(places[led], places["blue-square"]) < 0.3


def place(piece: str) -> Vector:
    from engage_hri.services.simulation.still import table_world

    entity = table_world().entity(piece)
    assert entity is not None
    return entity.position
