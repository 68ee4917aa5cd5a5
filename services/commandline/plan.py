"""`engage plan FILE`: check a block, or the block that a fragment becomes, and print its net. Nothing moves."""

import asyncio
from pathlib import Path

from schemas import keys
from schemas.blocks import Block, PerformBlock
from schemas.body import Estimate
from schemas.fragments import TurnFragment
from schemas.world import World
from services.bus import Subscription
from services.client import connect
from services.commandline import roster
from services.commandline.process import DONE
from services.commandline.run import Where
from services.commandline.sources import Thing, read_source, read_world, still
from services.config import Config
from services.memory_bus import MemoryHub
from services.runtime import running
from services.virtual_time import run_virtual


def main(path: Path, format: str, world: Path | None, where: Where) -> int:
    from services.realizer import export

    config = where.load()
    source = read_source(path)
    around = read_world(world)
    write = {"text": export.as_text, "json": export.as_json, "dot": export.as_dot, "pnml": export.as_pnml}[format]
    texts = []
    for thing in source.things:
        with source.blamed():
            block, estimates = run_virtual(_estimated(thing, around, config))
            texts.append(write(export.plan_block(block, estimates)))
    print("\n".join(text.rstrip("\n") for text in texts))
    return DONE


async def _estimated(thing: Thing, world: World, config: Config) -> tuple[Block, tuple[Estimate, ...]]:
    """The block, and what the simulated body expects of it in that world, from its home position."""
    from services.control.simulated import SimulatedBody
    from services.realizer.points import performer

    block = thing if isinstance(thing, Block) else await _generated(thing, world, config)
    body = SimulatedBody(config.control.no_point_zones, config.control.variability)
    asked = [behavior for behavior in block.behaviors if performer(behavior) == "body"]
    return block, tuple(body.estimate(behavior, None, world) for behavior in asked)


async def _generated(fragment: TurnFragment, world: World, config: Config) -> Block:
    """What generation makes of a fragment, caught where the realizer would take it. Raises InputRefused."""
    services = {name: roster.service(name, config) for name in ("generation", "control")}
    async with MemoryHub(config.robot) as hub:
        bus = hub.join("realizer")
        with bus.subscribe(keys.BLOCK) as inbox:
            bus.declare_alive()
            async with running(hub, {"simulation": still(world), **services}), connect(hub=hub) as robot:
                asking = asyncio.ensure_future(robot.perform(fragment))
                catching = asyncio.ensure_future(_caught(fragment.id, inbox))
                try:
                    await asyncio.wait((asking, catching), return_when=asyncio.FIRST_COMPLETED)
                    if asking.done():
                        asking.result()
                    return catching.result()
                finally:
                    for task in (asking, catching):
                        task.cancel()
                    await asyncio.wait((asking, catching))


async def _caught(id: str, inbox: Subscription) -> Block:
    async for received in inbox:
        match received.message:
            case PerformBlock(block=block) if block.id == id:
                return block
    raise AssertionError("the bus closed under us")
