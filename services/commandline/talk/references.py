"""Reasons of each reference for `engage plan --why`: all gestures with all phrases, and why one is chosen."""

import sys
from collections.abc import Sequence

import msgspec
from msgspec.structs import asdict
from rich.console import Console
from rich.table import Table
from rich.text import Text

from engage_hri.schemas.behaviors import Event
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.fragments import GestureChoice, PairConsidered, ReferenceChoice, TurnFragment
from engage_hri.schemas.world import World
from engage_hri.services.commandline.shell.outputs import Terminal, print_format
from engage_hri.services.commandline.shell.settings import RobotConfig
from engage_hri.services.commandline.shell.sources import InputFile
from engage_hri.services.commandline.talk.offline_plan import Unplanned, generated
from engage_hri.services.generation.block.emission import FragmentPlan

GESTURES: dict[GestureChoice, str] = {
    "none": "none", "gaze": "gaze", "directed_gaze": "directed gaze", "directed_gaze_with_pointing": "DG + pointing",
}  # fmt: skip
WIDE = 110
"""Width of the terminal, in columns, from which distractors are named and not only counted."""
NUMBERS = ("r", "R", "Rmin", "cost")
NAMED = 4
"""Distractors named in a row; the rest is counted."""


def show_references(source: InputFile, world: World, config: RobotConfig, *, is_json: bool) -> int:
    """Print for each reference of the fragments why it is made as it is: a table, or all pairs as one JSON list.

    Returns the number of warnings. Raises InputRefused, or Unplanned once all that is known is printed.
    """
    fragments = [thing for thing in source.things if isinstance(thing, TurnFragment)]
    if not fragments:
        advice = "only turn fragments refer to objects; leave out --why for the net of a block"
        raise InputRefused(Fault(reason="holds no turn fragment", where=str(source.path), advice=advice))
    failure: Unplanned | None = None
    try:
        plans = generated(fragments, world, config, str(source.path))
    except Unplanned as error:
        failure, plans = error, error.plans
    impossible = failure.choices if failure else ()
    if is_json:
        print_format(as_json([*(choice for plan in plans for choice in plan.choices), *impossible]))
        for warning in (warning for plan in plans for warning in plan.warnings):
            print(f"warning: {warning}", file=sys.stderr)
    else:
        console = Terminal(highlight=False)
        show(plans, console)
        show_tables(impossible, console)
    if failure:
        raise failure
    return sum(len(plan.warnings) for plan in plans)


def as_json(choices: Sequence[ReferenceChoice]) -> str:
    """Write all pairs of all references as a JSON list, each with all its keys."""
    rows = [{"reference": choice.reference, **asdict(pair)} for choice in choices for pair in choice.pairs]
    return msgspec.json.format(msgspec.json.encode(rows), indent=2).decode()


def show(plans: Sequence[FragmentPlan], console: Console) -> None:
    """Print the tables of each fragment, a line with its cost, and its warnings."""
    for plan in plans:
        show_tables(plan.choices, console)
        total = sum(choice.cost for choice in plan.choices)
        count = len(plan.choices)
        made = f"{count} reference{'s' if count != 1 else ''}, {total:.3g} s" if count else "no references"
        limits = [each.limit for each in plan.block.behaviors if isinstance(each, Event) and each.limit is not None]
        answer = "".join(f"; an answer within {limit:g} s" for limit in limits)
        console.print(Text(f"{plan.block.id}: {made}{answer}", style="bold"))
        for warning in plan.warnings:
            console.print(Text(f"warning: {warning}", style="yellow"))


def show_tables(choices: Sequence[ReferenceChoice], console: Console) -> None:
    for choice in choices:
        console.print(_table(choice, wide=console.width >= WIDE))
        console.print()


def _table(choice: ReferenceChoice, *, wide: bool) -> Table:
    table = Table(box=None, pad_edge=False, padding=(0, 1, 0, 0), title_justify="left", title_style="bold")
    table.title = f"{choice.reference} -> {choice.target}"
    for name in ("", "gesture", "phrase", "|D|", *(("distractors",) if wide else ()), *NUMBERS, "verdict"):
        table.add_column(name, justify="right" if name in ("|D|", *NUMBERS) else "left", overflow="fold")
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
