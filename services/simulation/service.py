"""The simulated human at the tangram table, instead of cameras: publishes the world and what the person does."""

import random

from schemas import keys
from schemas.presence import PeerAlive
from schemas.world import World
from services.bus import Bus, Subscription
from services.runtime import Ready
from services.simulation.appendix_b import misplacing_rules, rules
from services.simulation.config import SimulationConfig
from services.simulation.human import Human, Rule
from services.simulation.perception import Scene
from services.simulation.table import Table
from services.tangram_table import tangram_table

SCRIPTS = {"scripted": rules, "misplacing": misplacing_rules}


async def simulate(bus: Bus, ready: Ready, config: SimulationConfig) -> None:
    """Serve until cancelled. The person comes when everybody the configuration names is on the bus."""
    table = Table(tangram_table(), hand_speed=config.hand_speed, shortest_movement=config.shortest_movement)
    script: tuple[Rule, ...] = SCRIPTS[config.human]() if config.human in SCRIPTS else ()
    chance = random.Random(config.seed)
    human = Human(script, bus.robot, lambda: chance.uniform(-config.jitter, config.jitter))
    scene = Scene(human, table, robot=bus.robot, frame=config.frame, stamp=bus.stamp)
    with bus.subscribe(
        keys.ANY_ALIVE, keys.FEEDBACK, keys.SYNC_POINT, keys.ROBOT_ACTION, keys.CONNECTION_EVENT
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


async def _wait_for(participants: set[str], inbox: Subscription) -> None:
    while participants:
        received = await inbox.next()
        if received is None:
            return
        match received.message:
            case PeerAlive(participant=participant):
                participants.discard(participant)
