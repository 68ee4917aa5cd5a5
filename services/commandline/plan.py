"""`engage plan FILE`: check a block, or the block that a fragment becomes, and print its net. Nothing moves."""

import sys
from pathlib import Path

from engage_hri.schemas.blocks import Block
from engage_hri.schemas.body import Estimate
from engage_hri.schemas.world import World
from engage_hri.services.commandline.config import Config
from engage_hri.services.commandline.generating import generated
from engage_hri.services.commandline.process import DONE
from engage_hri.services.commandline.prose import not_strict
from engage_hri.services.commandline.run import Where
from engage_hri.services.commandline.sources import read_source, read_world
from engage_hri.services.runtime.virtual_time import run_virtual


def main(path: Path, format: str, world: Path | None, where: Where, *, strict: bool = False) -> int:
    from engage_hri.services.realizer import export

    config = where.load()
    source = read_source(path)
    around = read_world(world)
    write = {"text": export.as_text, "json": export.as_json, "dot": export.as_dot, "pnml": export.as_pnml}[format]
    texts, warnings = [], 0
    with source.blamed():
        for plan in generated(source.things, around, config, str(path)):
            estimates = run_virtual(estimated(plan.block, around, config))
            planned = export.plan_block(plan.block, estimates)
            texts.append(write(planned))
            for problem in planned.problems:
                warnings += 1
                print(f"! {problem.kind} {problem.behavior or plan.block.id}: {problem.message}", file=sys.stderr)
    print("\n".join(text.rstrip("\n") for text in texts))
    if strict and warnings:
        raise not_strict(warnings)
    return DONE


async def estimated(block: Block, world: World, config: Config) -> tuple[Estimate, ...]:
    """What the simulated body expects of the block in that world, from its home position."""
    from engage_hri.services.control.torso.body import SimulatedBody
    from engage_hri.services.realizer.points import performer

    body = SimulatedBody(config.control.no_point_zones, config.control.variability)
    asked = [behavior for behavior in block.behaviors if performer(behavior) == "body"]
    return tuple(body.estimate(behavior, None, world) for behavior in asked)
