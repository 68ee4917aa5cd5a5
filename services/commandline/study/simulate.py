"""Command `engage simulate`: many sessions in virtual time, their results, and tests of the hypotheses."""

import os
import platform
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

import msgspec
import numpy as np
import typer
from msgspec import Struct

from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.units import Seconds
from engage_hri.services.commandline.shell.config import Config
from engage_hri.services.commandline.shell.options import Configured, Quiet, Resolution, simulation_settings
from engage_hri.services.commandline.shell.outputs import Terminal
from engage_hri.services.commandline.shell.process import DONE, FAILED, interrupted, run
from engage_hri.services.commandline.shell.settings import TRANSCRIPT
from engage_hri.services.commandline.study.session import Order, SessionResult, play_all
from engage_hri.services.commandline.study.tables import StudyReport, session_line
from engage_hri.services.runtime.service import installed_version
from engage_hri.services.study import summary
from engage_hri.services.study.hypotheses import CONDITIONS, DEGRADATIONS, HypothesisResult, findings
from engage_hri.services.study.records import SessionRecord
from engage_hri.services.study.summary import NumberTable

BY_WORDS = ("collaboration.mode=task",)
"""Setting for people who follow the robot's words and no script: the robot may choose its words."""
USUAL = {"listening": BY_WORDS, "stochastic": BY_WORDS}
"""Settings for each human, weaker than the user's; humans that are not listed act the transcript."""
DECIDED = {
    "simulation.human": "--human",
    "simulation.seed": "--seed",
    "control.variability.seed": "--seed",
    "generation.condition": "--condition",
}
"""Keys that are set for each session, with the option for each."""


@dataclass(frozen=True, kw_only=True)
class Options(Configured):
    out: Annotated[Path, typer.Option(metavar="DIR", help="Where the results go.", show_default=False)]
    sessions: Annotated[int, typer.Option(metavar="N", min=1, help="In each condition.")] = 20
    seed: Annotated[int, typer.Option(metavar="S", help="Session k has the seed S + k, in each condition.")] = 0
    condition: Annotated[
        list[str] | None,
        typer.Option(
            metavar="operational|degraded-generation|degraded-recognition",
            help="Repeatable; else all three.",
        ),
    ] = None
    human: Annotated[
        Literal["stochastic", "listening", "appendix-b", "misplacing"],
        typer.Option(help="How the simulated human behaves."),
    ] = "stochastic"
    resolution: Resolution = None
    jobs: Annotated[
        int | None, typer.Option(metavar="J", min=1, help="Processes; as many as processors.", show_default=False)
    ] = None
    limit: Annotated[
        Seconds,
        typer.Option(metavar="SECONDS", min=1, max=86_400, help="Break a session off after so long in its own time."),
    ] = 3600.0
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the results that are there.")] = False
    quiet: Quiet = False


def main(options: Options) -> int:
    orders = orders_of(options)
    console = Terminal(quiet=options.quiet)
    report = StudyReport(console, options.out, ("study.json", "failures.txt"), overwrite=options.overwrite)
    played: list[SessionResult] = []
    is_broken_off = False

    def tell(one: SessionResult) -> None:
        played.append(one)
        console.print(f"{len(played)} of {len(orders)}: {session_line(one.record)}", highlight=False, soft_wrap=True)

    try:
        run(play_all(orders, options.jobs or os.cpu_count() or 1, tell))
    except KeyboardInterrupt:
        is_broken_off = True
    if played:
        place = {(order.condition, order.session): number for number, order in enumerate(orders)}
        played.sort(key=lambda one: place[one.record.condition, one.record.session])
        records = [one.record for one in played]
        found = findings(records)
        ordered = Counter(order.condition for order in orders)
        events = [event for one in played for event in one.events]
        report.end(records, events, found, tables_of(records, found, ordered), texts_of(options, orders, played))
    if is_broken_off:
        return interrupted()
    return DONE if all(one.record.finished for one in played) else FAILED


# -- what to play -----------------------------------------------------------------------------------------------


def orders_of(options: Options) -> list[Order]:
    """Make the orders, by condition, then by number; a number has the same seed everywhere. Raises InputRefused."""
    for setting in options.overrides:
        key = setting.partition("=")[0].strip()
        if key in DECIDED:
            raise InputRefused(Fault(reason=f"a study decides {key!r} itself", advice=f"use {DECIDED[key]}"))
    conditions = dict.fromkeys(options.condition or CONDITIONS)
    for condition in conditions:
        if condition not in CONDITIONS:
            advice = f"one of {', '.join(CONDITIONS)}"
            raise InputRefused(Fault(reason=f"no condition {condition!r}", advice=advice))
    return [_order(options, condition, number) for condition in conditions for number in range(options.sessions)]


def _order(options: Options, condition: str, number: int) -> Order:
    """Make one order. The user's settings override what makes a condition worse, but not seed and condition."""
    seed = options.seed + number
    defaults = [*USUAL.get(options.human, TRANSCRIPT), *DEGRADATIONS[condition]]
    chosen = [
        *simulation_settings(seed, options.human, options.resolution), f"generation.condition={condition}",
    ]  # fmt: skip
    config = replace(options, settings=[*options.overrides, *chosen]).read(Config, defaults=defaults)
    return Order(session=number, condition=condition, seed=seed, limit=options.limit, config=config)


# -- what came of it --------------------------------------------------------------------------------------------


def tables_of(
    records: Sequence[SessionRecord], found: Sequence[HypothesisResult], ordered: Mapping[str, int]
) -> list[NumberTable]:
    """Tables for the terminal and for summary.md. ordered: number of sessions by condition, played or not."""
    tables = [summary.overview(records, ordered)]
    if found:
        tables.append(summary.hypotheses(found))
    if any(not record.finished for record in records):
        tables.append(summary.unfinished(records))
    return tables


def texts_of(options: Options, orders: Sequence[Order], played: Sequence[SessionResult]) -> dict[str, str]:
    """Files that only simulated sessions have. Nothing in them depends on the number of processes."""
    told = msgspec.json.format(msgspec.json.encode(_study(options, orders, len(played)))).decode() + "\n"
    failed = [
        f"{one.record.condition} {one.record.session}, seed {one.record.seed}\n{one.trace}"
        for one in played
        if one.trace
    ]
    return {"study.json": told, **({"failures.txt": "\n".join(failed)} if failed else {})}


class Study(Struct, frozen=True, kw_only=True):
    """Content of study.json: all that is needed to play the same sessions again.

    played: fewer than ordered if it was interrupted. settings: those of the user. configurations: complete, by
    condition, of the first session; session k has the seed `seed` + k.
    """

    versions: dict[str, str]
    human: str
    conditions: tuple[str, ...]
    sessions: int
    seed: int
    limit: Seconds
    ordered: int
    played: int
    settings: tuple[str, ...]
    configurations: dict[str, Config]


def _study(options: Options, orders: Sequence[Order], played: int) -> Study:
    first = {order.condition: order.config for order in orders if order.session == 0}
    return Study(
        versions={"engage": installed_version(), "python": platform.python_version(), "numpy": np.__version__},
        human=options.human, conditions=tuple(first), sessions=options.sessions, seed=options.seed,
        limit=options.limit, ordered=len(orders), played=played, settings=options.overrides,
        configurations=first,
    )  # fmt: skip
