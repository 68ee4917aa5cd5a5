"""Command `engage plan FILE`: check a block, or the block that a fragment becomes, and print its net."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import typer

from engage_hri.schemas.blocks import Block
from engage_hri.schemas.body import Estimate
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.world import World
from engage_hri.services.commandline.config import Config
from engage_hri.services.commandline.ends import readable
from engage_hri.services.commandline.generating import generated
from engage_hri.services.commandline.options import Configured, Strict, WorldFile
from engage_hri.services.commandline.outputs import Terminal
from engage_hri.services.commandline.process import DONE, FAILED
from engage_hri.services.commandline.prose import strict_refusal
from engage_hri.services.commandline.sources import read_source, read_world
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.runtime.virtual_time import run_virtual

HIGHEST = 40
"""Most lines of the drawing."""


@dataclass(frozen=True, kw_only=True)
class Options(Configured):
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
        for plan in generated(source.things, around, config, str(options.file)):
            estimates = run_virtual(estimated(plan.block, around, config))
            planned = export.plan_block(plan.block, estimates)
            texts.append(writers[options.format](planned))
            for problem in planned.problems:
                warnings += 1
                print(f"! {problem.kind} {problem.behavior or plan.block.id}: {problem.message}", file=sys.stderr)
            if nothing_is_left(plan.block, planned.dropped):
                reason = "it would fail: every behavior of it was dropped, and nothing is left to perform"
                print(readable(Fault(reason=reason, where=plan.block.id), options.file), file=sys.stderr)
                code = FAILED
    print("\n".join(text.rstrip("\n") for text in texts))
    if options.strict and warnings and code == DONE:
        raise strict_refusal(warnings)
    return code


def _as_text(plan: Plan) -> str:
    from engage_hri.services.console.net_drawing import drawing, legend
    from engage_hri.services.console.nets import in_view
    from engage_hri.services.realizer import export

    net = in_view(export.as_message(plan))
    assert net is not None
    width = Terminal().width
    return "\n".join((export.as_text(plan), *drawing(net, width, HIGHEST), legend((net,))))


async def estimated(block: Block, world: World, config: Config) -> tuple[Estimate, ...]:
    """Estimates of the simulated body for a block, from its home position."""
    from engage_hri.services.control.service import simulated_body
    from engage_hri.services.realizer.points import performer

    body = simulated_body(config.control)
    asked = [behavior for behavior in block.behaviors if performer(behavior) == "body"]
    return tuple(body.estimate(behavior, None, world) for behavior in asked)
