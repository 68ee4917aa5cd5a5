"""`engage explain FILE`: for each reference every gesture with every phrase, and why one is chosen. Nothing moves."""

import sys
from collections.abc import Sequence
from pathlib import Path

import msgspec
from msgspec.structs import asdict, replace
from rich.console import Console
from rich.table import Table
from rich.text import Text

from schemas.body import Estimate, EstimateItem
from schemas.faults import Fault, InputRefused, RunFailed
from schemas.fragments import GestureChoice, PairConsidered, ReferenceChoice, TurnFragment
from schemas.world import World
from services.commandline.outputs import Terminal
from services.commandline.process import DONE
from services.commandline.run import Where
from services.commandline.sources import read_source, read_world
from services.config import Config
from services.generation.planning import Plan
from services.virtual_time import run_virtual

GESTURES: dict[GestureChoice, str] = {
    "none": "none",
    "gaze": "gaze",
    "directed_gaze": "directed gaze",
    "directed_gaze_with_pointing": "DG + pointing",
}
WIDE = 110
"""Columns from which distractors are named, not only counted."""
NAMED = 4
"""Distractors in a row; of more the rest is counted."""


def main(path: Path, format: str, world: Path | None, where: Where) -> int:
    config = where.load()
    source = read_source(path)
    around = read_world(world)
    fragments = [thing for thing in source.things if isinstance(thing, TurnFragment)]
    if not fragments:
        advice = "only turn fragments refer to objects; for a block: engage plan"
        raise InputRefused(Fault(reason="holds no turn fragment", where=str(path), advice=advice))
    with source.blamed():
        plans = run_virtual(_planned(fragments, around, config, str(path)))
    if format == "json":
        print(as_json([choice for plan in plans for choice in plan.choices]))
        for warning in (warning for plan in plans for warning in plan.warnings):
            print(f"warning: {warning}", file=sys.stderr)
    else:
        show(plans, Terminal(highlight=False, markup=False, emoji=False))
    return DONE


async def _planned(fragments: Sequence[TurnFragment], world: World, config: Config, source: str) -> list[Plan]:
    """As generation would plan them one after the other, the simulated body at home before each."""
    from services.control.simulated import SimulatedBody
    from services.generation.fragment_check import checked
    from services.generation.leases import Leases
    from services.generation.motions import collect, distinct, from_each_other, from_here
    from services.generation.planning import plan, targets
    from services.generation.turn_policy import TurnPolicy

    body = SimulatedBody(config.control.no_point_zones, config.control.variability)
    permits = Leases(config.generation).permits()
    turns = TurnPolicy(config.robot, config.generation)

    def estimated(items: Sequence[EstimateItem]) -> list[Estimate]:
        return [body.estimate(item.behavior, item.pose, world) for item in items]

    plans = []
    for each in fragments:
        fragment = checked(each, world, config.robot)
        turn = turns.accept(fragment, fragment.addressee)
        sequence = targets(fragment)
        here = estimated(from_here(distinct(sequence), permits.only_hand))
        onward = estimated(from_each_other(sequence, here, permits.only_hand))
        motions = collect(sequence, here, onward)
        try:
            plans.append(plan(fragment, turn, world, body.capabilities, motions, permits, config.generation))
        except RunFailed as error:
            where = f"{source}: {fragment.id}: {error.fault.where}"
            raise RunFailed(replace(error.fault, where=where, line=_line(fragment, error.fault.where))) from error
        turns.fragment_ended(fragment.id, complete=True, now=0.0)
    return plans


def _line(fragment: TurnFragment, behavior: str) -> int:
    return next((each.line for each in fragment.behaviors if each.id == behavior), 0)


def as_json(choices: Sequence[ReferenceChoice]) -> str:
    """A list of every pair of every reference, each with all its keys."""
    rows = [{"reference": choice.reference, **asdict(pair)} for choice in choices for pair in choice.pairs]
    return msgspec.json.format(msgspec.json.encode(rows), indent=2).decode()


def show(plans: Sequence[Plan], console: Console) -> None:
    for plan in plans:
        for choice in plan.choices:
            console.print(_table(choice, wide=console.width >= WIDE))
            console.print()
        total = sum(choice.cost for choice in plan.choices)
        count = len(plan.choices)
        made = f"{count} reference{'s' if count != 1 else ''}, {total:.3g} s" if count else "no references"
        console.print(Text(f"{plan.block.id}: {made}", style="bold"))
        for warning in plan.warnings:
            console.print(Text(f"warning: {warning}", style="yellow"))


def _table(choice: ReferenceChoice, *, wide: bool) -> Table:
    table = Table(box=None, pad_edge=False, padding=(0, 1, 0, 0), title_justify="left", title_style="bold")
    table.title = f"{choice.reference} -> {choice.target}"
    table.add_column("")
    table.add_column("gesture", no_wrap=True)
    table.add_column("phrase", min_width=10)
    table.add_column("|D|", justify="right", no_wrap=True)
    if wide:
        table.add_column("distractors", ratio=1)
    for name in ("r", "R", "Rmin", "cost"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("verdict", min_width=16)
    for pair in choice.pairs:
        style = "bold green" if pair.chosen else "" if pair.feasible else "dim"
        named = [_named(pair.distractors)] if wide else []
        table.add_row(
            ">" if pair.chosen else "",
            GESTURES[pair.gesture],
            repr(pair.phrase) if pair.phrase else "(none)",
            str(len(pair.distractors)),
            *named,
            *_numbers(pair),
            f"chosen: {pair.reason}" if pair.chosen else pair.reason,
            style=style,
        )
    return table


def _numbers(pair: PairConsidered) -> list[str]:
    return [f"{pair.channel:.2f}", f"{pair.reliability:.4f}", f"{pair.minimum:g}", f"{pair.cost:.2f} s"]


def _named(distractors: Sequence[str]) -> str:
    rest = len(distractors) - NAMED
    return ", ".join(distractors[:NAMED]) + (f" and {rest} more" if rest > 0 else "")
