"""Command `engage plan FILE`: check a block, or the block that a fragment becomes, and print its net."""

import asyncio
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import typer
from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.world import World
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.commandline import roster
from engage_hri.services.commandline.config import Config
from engage_hri.services.commandline.ends import readable
from engage_hri.services.commandline.generating import generated
from engage_hri.services.commandline.options import Embodied, Strict, WorldFile
from engage_hri.services.commandline.outputs import Terminal
from engage_hri.services.commandline.patient import print_format
from engage_hri.services.commandline.process import DONE, FAILED
from engage_hri.services.commandline.prose import strict_refusal
from engage_hri.services.commandline.sources import read_source, read_world
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.plan.relations import NO_SUCH_BLOCK
from engage_hri.services.runtime.service import running
from engage_hri.services.runtime.virtual_time import run_virtual

HIGHEST = 40
"""Most lines of the drawing."""


@dataclass(frozen=True, kw_only=True)
class Options(Embodied):
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A BML block (XML or JSON).", show_default=False)]
    format: Annotated[Literal["text", "json", "dot", "pnml"], typer.Option(help="How to print the net.")] = "text"
    world: WorldFile = None
    strict: Strict = False


def main(options: Options) -> int:
    from engage_hri.services.realizer import export
    from engage_hri.services.realizer.perform.outcome import nothing_is_left

    config = options.load()
    source = read_source(options.file)
    around = read_world(options.world)
    writers = {"text": _as_text, "json": export.as_json, "dot": export.as_dot, "pnml": export.as_pnml}
    texts, warnings, code = [], 0, DONE
    with source.naming_file():
        for plan in generated(source.things, around, config, str(source.path)):
            planned = _planned(plan.block, around, config, source.path)
            texts.append(writers[options.format](planned))
            for problem in planned.problems:
                warnings += 1
                block = plan.block.id if len(source.things) > 1 or not problem.behavior else ""
                place = ":".join(filter(None, (block, problem.behavior)))
                print(f"! {problem.kind} {place}: {problem.message}", file=sys.stderr)
            if nothing_is_left(plan.block, planned.dropped):
                reason = "it would fail: every behavior of it was dropped, and nothing is left to perform"
                print(readable(Fault(reason=reason, where=plan.block.id), source.path), file=sys.stderr)
                code = FAILED
    (print if options.format == "text" else print_format)("\n".join(text.rstrip("\n") for text in texts))
    if options.strict and warnings and code == DONE:
        raise strict_refusal(warnings)
    return code


def _planned(block: Block, world: World, config: Config, file: Path) -> Plan:
    """The plan of a block. Its refusal since it names another block says how to try the two together."""
    try:
        return run_virtual(rehearsed(block, world, config))
    except InputRefused as error:
        if NO_SUCH_BLOCK not in error.fault.reason:
            raise
        together = f"`engage play --embedded --virtual-time --at 0,1 FIRST.xml {file.name}`"
        advice = f"a block that names another one cannot be planned alone; {together} plays both at full speed"
        raise InputRefused(replace(error.fault, advice=advice), error.block) from error


def _as_text(plan: Plan) -> str:
    from engage_hri.services.console.net_drawing import drawing, legend
    from engage_hri.services.console.nets import in_view
    from engage_hri.services.realizer import export

    net = in_view(export.as_message(plan))
    assert net is not None
    width = Terminal().width
    return "\n".join((export.as_text(plan), *drawing(net, width, HIGHEST), legend((net,))))


async def rehearsed(block: Block, world: World, config: Config) -> Plan:
    """Plan a block as a realizer does that has nothing else to perform, with the configured body at home."""
    from engage_hri.services.realizer.perform.planning import planned_alone

    async with MemoryHub(config.robot, decodes=False) as hub:
        hub.join("simulation").publish(keys.WORLD, world)
        async with running(hub, {"control": roster.service("control", config, connects=False)}):
            await asyncio.sleep(0.1)  # control has seen the world by then
            try:
                return await planned_alone(hub.join("plan"), block, config.realizer)
            except InputRefused as error:
                refused = error  # raised in there it would be one of a group
    raise refused
