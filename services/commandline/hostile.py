"""Command `engage hostile`: seeded attacks on the whole robot, in this process and in virtual time."""

from collections import Counter
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus
from engage_hri.services.commandline import roster
from engage_hri.services.commandline.config import Config
from engage_hri.services.commandline.embedding import services
from engage_hri.services.commandline.options import Embodied, Quiet
from engage_hri.services.commandline.process import DONE
from engage_hri.services.commandline.sources import still
from engage_hri.services.control.body import Body
from engage_hri.services.control.drivers import made
from engage_hri.services.control.service import embody
from engage_hri.services.hostile.trial import KINDS, Attack, Client, Kind, Report, run
from engage_hri.services.runtime.service import Ready, Service
from engage_hri.services.simulation.still import tangram_world

WRONG = 1
"""Exit code after an attack with a consequence that must not be."""
BodyMaker = Callable[[], Body]


@dataclass(frozen=True, kw_only=True)
class Options(Embodied):
    """Options of the command. Without `--body` a lying body takes the place of yours."""

    runs: Annotated[int, typer.Option(metavar="N", min=1, help="Attacks, each with the next seed.")] = 20
    seed: Annotated[int, typer.Option(metavar="S", help="Of the first.")] = 0
    seconds: Annotated[Seconds, typer.Option(min=1, max=3600, help="How long each lasts, in its own time.")] = 20.0
    only: Annotated[
        list[str] | None, typer.Option(metavar="messages|requests|body", help="Repeatable; else all three.")
    ] = None
    quiet: Quiet = False


def main(options: Options) -> int:
    kinds = _kinds(options.only or ())
    config = options.load()
    make = partial(made, config.control, is_guarded=False) if options.body else None
    console = Console(quiet=options.quiet)
    counts: Counter[str] = Counter()
    bad: list[Report] = []
    for seed in range(options.seed, options.seed + options.runs):
        report = attack(seed, config, seconds=options.seconds, kinds=kinds, body=make)
        counts.update(report.counts)
        if report.wrong:
            bad.append(report)
            _tell(console, report, options)
    console.print(table(counts, options.runs))
    return WRONG if bad else DONE


def _kinds(only: Collection[str]) -> tuple[Kind, ...]:
    """Choose the kinds of attacks; all if `only` is empty. Raises InputRefused for an unknown kind."""
    if unknown := set(only) - set(KINDS):
        reason = f"no attack {', '.join(map(repr, sorted(unknown)))}"
        raise InputRefused(Fault(reason=reason, advice=f"one of {', '.join(KINDS)}"))
    return tuple(kind for kind in KINDS if kind in only) or KINDS


def attack(
    seed: int,
    config: Config | None = None,
    *,
    seconds: Seconds = 20.0,
    kinds: tuple[Kind, ...] = KINDS,
    body: BodyMaker | None = None,
    client: Client | None = None,
) -> Report:
    """Attack the whole robot once; for tests of one's own body or client.

    body: makes the body behind the real control, once the loop runs. Without it a lying body takes the place of
    control if `kinds` has "body". client: gets the hub, and must have ended when the attack is over.
    """
    plan = Attack(seed=seed, kinds=kinds, seconds=seconds, own_body=body is not None)
    return run(plan, whole_robot(config, body), client)


def whole_robot(config: Config | None = None, body: BodyMaker | None = None) -> Mapping[str, Service]:
    """Services of a robot with their configuration, and a still table with a person at it."""
    config = config or Config()
    robot = services(config, *roster.ROBOT)
    if body is not None:
        robot["control"] = partial(_embody, config=config, make=body)
    return {"simulation": still(tangram_world()), **robot}


async def _embody(bus: Bus, ready: Ready, config: Config, make: BodyMaker) -> None:
    await embody(bus, ready, config.control, make(), covered_for=config.covered_for)


def _tell(console: Console, report: Report, options: Options) -> None:
    only = "".join(f" --only {kind}" for kind in options.only or ())
    config = f" --config {options.config}" if options.config else ""
    settings = config + "".join(f" --set {setting}" for setting in options.settings or ())
    body = "".join(f" --body {body}" for body in options.body or ()) + (
        f" --voice {options.voice}" if options.voice else ""
    )
    again = f"engage hostile --seed {report.attack.seed} --runs 1 --seconds {options.seconds:g}{only}{body}{settings}"
    console.print(f"seed {report.attack.seed}: {again}", style="bold", highlight=False, soft_wrap=True)
    for line in report.wrong:
        console.print(f"  {line}", markup=False, highlight=False, soft_wrap=True)
    for trace in report.failures[:1]:
        console.print(trace, markup=False, highlight=False, soft_wrap=True)


MISTAKES = (
    "services that ended", "services without status", "requests without outcome", "requests with two outcomes",
    "pending afterwards", "still spoken of", "tasks left", "contained failures", "clients that failed",
)  # fmt: skip


def table(counts: Mapping[str, int], runs: int) -> Table:
    """Table of what was sent, and of the mistakes that followed."""
    made = Table(title=f"{runs} attacks", title_justify="left")
    made.add_column("what")
    made.add_column("how many", justify="right")
    for what in sorted(set(counts) - set(MISTAKES)):
        made.add_row(what, str(counts[what]))
    made.add_section()
    for what in MISTAKES:
        made.add_row(what, str(counts[what]), style="bold red" if counts[what] else "green")
    return made
