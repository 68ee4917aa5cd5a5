"""Command `engage plan FILE`: check a block, or the block that a fragment becomes, and print its net."""

import asyncio
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import typer

from engage_hri.schemas.blocks import Block
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.world import World
from engage_hri.services.commandline.embedding import in_memory
from engage_hri.services.commandline.shell import roster
from engage_hri.services.commandline.shell.options import Embodied, Strict, WorldFile, strict_refusal
from engage_hri.services.commandline.shell.outputs import Terminal, print_format
from engage_hri.services.commandline.shell.process import DONE, FAILED, readable
from engage_hri.services.commandline.shell.settings import RobotConfig
from engage_hri.services.commandline.shell.sources import read_source, read_world, still
from engage_hri.services.commandline.talk.offline_plan import generated
from engage_hri.services.commandline.talk.references import show_references
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.plan.relations import NO_SUCH_BLOCK
from engage_hri.services.runtime.virtual_time import run_virtual

HIGHEST = 40
"""Most lines of the drawing."""


@dataclass(frozen=True, kw_only=True)
class Options(Embodied):
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="A turn fragment or a BML block (XML or JSON).", show_default=False)
    ]
    format: Annotated[Literal["text", "json", "dot", "pnml"], typer.Option(help="How to print the net.")] = "text"
    why: Annotated[
        bool, typer.Option("--why", help="Why each reference is made as it is: all gestures with all phrases.")
    ] = False
    world: WorldFile = None
    strict: Strict = False


def main(options: Options) -> int:
    from engage_hri.services.realizer import export
    from engage_hri.services.realizer.report import nothing_is_left

    config = options.load()
    source = read_source(options.file)
    around = read_world(options.world)
    if options.why:
        if options.format not in ("text", "json"):
            raise InputRefused(Fault(reason="prints text or json", where="--why", advice="leave out --format"))
        with source.naming_file():
            warnings = show_references(source, around, config, is_json=options.format == "json")
        if options.strict and warnings:
            raise strict_refusal(warnings)
        return DONE
    writers = {"text": _as_text, "json": export.as_json, "dot": export.as_dot, "pnml": export.as_pnml}
    texts, warnings, code = [], 0, DONE
    with source.naming_file():
        for plan in generated(source.things, around, config, str(source.path)):
            planned = run_virtual(rehearsed(plan.block, around, config))
            texts.append(writers[options.format](planned))
            for warning in plan.warnings:
                warnings += 1
                print(f"warning: {warning}", file=sys.stderr)
            for problem in planned.problems:
                warnings += 1
                block = plan.block.id if len(source.things) > 1 or not problem.behavior else ""
                place = ":".join(filter(None, (block, problem.behavior)))
                print(f"! {problem.kind} {place}: {problem.message}", file=sys.stderr)
            if any(NO_SUCH_BLOCK in problem.message for problem in planned.problems):
                together = f"`engage play --embedded --virtual-time --at 0,1 FIRST.xml {source.path.name}`"
                print(f"! it is planned alone; {together} plays both at full speed", file=sys.stderr)
            if nothing_is_left(plan.block, planned.dropped):
                reason = "it would fail: every behavior of it was dropped, and nothing is left to perform"
                print(readable(Fault(reason=reason, where=plan.block.id), source.path), file=sys.stderr)
                code = FAILED
    (print if options.format == "text" else print_format)("\n".join(text.rstrip("\n") for text in texts))
    if options.strict and warnings and code == DONE:
        raise strict_refusal(warnings)
    return code


def _as_text(plan: Plan) -> str:
    from engage_hri.services.commandline.talk.net_drawing import drawing, legend
    from engage_hri.services.console.nets import in_view
    from engage_hri.services.realizer import export

    net = in_view(export.as_message(plan))
    assert net is not None
    width = Terminal().width
    return "\n".join((export.as_text(plan), *drawing(net, width, HIGHEST), legend(net)))


async def rehearsed(block: Block, world: World, config: RobotConfig) -> Plan:
    """Plan a block as a realizer does that has nothing else to perform, with the configured body at home."""
    from engage_hri.services.realizer.together.planning import planned_alone

    services = {"simulation": still(world), "control": roster.service("control", config, connects=False)}
    async with in_memory(config, services) as hub:
        await asyncio.sleep(0.1)  # control has seen the world by then
        return await planned_alone(hub.join("plan"), block)
