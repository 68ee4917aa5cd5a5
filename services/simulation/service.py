"""The simulated human at the tangram table, instead of cameras: publishes the world and what the person does."""

import random
from collections.abc import Callable

from schemas import keys
from schemas.presence import PeerAlive
from schemas.units import Seconds
from schemas.world import World
from services.bus import Bus, Subscription
from services.runtime import Ready
from services.simulation.appendix_b import misplacing_rules, rules
from services.simulation.config import HumanKind, SimulationConfig
from services.simulation.human import Human
from services.simulation.listening import ListeningHuman
from services.simulation.perception import Scene
from services.simulation.table import Table
from services.tangram_table import tangram_table


async def simulate(bus: Bus, ready: Ready, config: SimulationConfig) -> None:
    """Serve until cancelled. The person comes when everybody the configuration names is on the bus."""
    table = Table(tangram_table(), hand_speed=config.hand_speed, shortest_movement=config.shortest_movement)
    chance = random.Random(config.seed)
    human = _human(config.human, bus.robot, lambda: chance.uniform(-config.jitter, config.jitter))
    scene = Scene(human, table, robot=bus.robot, frame=config.frame, stamp=bus.stamp)
    with bus.subscribe(
        keys.ANY_ALIVE, keys.FEEDBACK, keys.SYNC_POINT, keys.ROBOT_ACTION, keys.ANY_CONNECTION_EVENT
    ) as inbox:
        bus.publish(keys.WORLD, scene.world(bus.now()))
        ready()
        await _wait_for(set(config.await_participants), inbox)
        if config.human != "none":
            scene.enter(bus.now() + config.entrance)
        while True:
            received = await inbox.next(scene.deadline)
            now = bus.now()
            if received is not None:
                scene.feed(received.message, now)
            for message in scene.advance(now):
                bus.publish(keys.WORLD if isinstance(message, World) else keys.PERCEIVED_ACTION, message)


def _human(kind: HumanKind, robot: str, vary: Callable[[], Seconds]) -> Human:
    match kind:
        case "scripted":
            return Human(rules(), robot, vary)
        case "misplacing":
            return Human(misplacing_rules(), robot, vary)
        case "listening":
            return ListeningHuman(tangram_table(), robot, vary)
        case "none":
            return Human((), robot, vary)


async def _wait_for(participants: set[str], inbox: Subscription) -> None:
    while participants:
        received = await inbox.next()
        if received is None:
            return
        match received.message:
            case PeerAlive(participant=participant):
                participants.discard(participant)
