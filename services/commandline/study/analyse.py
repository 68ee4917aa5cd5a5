"""Command `engage analyse`: recorded sessions in the tables of `engage simulate`."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.services.commandline.shell.options import Quiet
from engage_hri.services.commandline.shell.outputs import Terminal
from engage_hri.services.commandline.shell.process import DONE
from engage_hri.services.commandline.shell.recording_file import opened
from engage_hri.services.commandline.shell.roster import widest
from engage_hri.services.commandline.study.again import play_again
from engage_hri.services.commandline.study.recorded_sessions import UNNAMED, Session, sessions
from engage_hri.services.commandline.study.tables import StudyReport
from engage_hri.services.recording.settings import COLUMNS, changed, flat, rows
from engage_hri.services.runtime.settings import shown
from engage_hri.services.study import summary
from engage_hri.services.study.conditions import BASELINE
from engage_hri.services.study.hypotheses import HypothesisResult, findings
from engage_hri.services.study.summary import BETWEEN, WITHIN, NumberTable


@dataclass(frozen=True, kw_only=True)
class Options:
    recordings: Annotated[
        list[Path], typer.Argument(metavar="FILE...|DIR", help="Recordings, or a folder of them.", show_default=False)
    ]
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Where tables and plots go; else they are only printed.")
    ] = None
    baseline: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Condition that others are compared with.", show_default=BASELINE),
    ] = None
    again: Annotated[
        bool,
        typer.Option(
            "--again", help="Play it to the services once more, and compare. Exit 1 if they do something else."
        ),
    ] = False
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="With --again: SERVICE.KEY=VALUE, in place of what it had."),
    ] = None
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the results that are there.")] = False
    quiet: Quiet = False


def main(options: Options) -> int:
    paths = found(options.recordings)
    console = Terminal(quiet=options.quiet)
    if options.again:
        return play_again(paths, options.settings or (), console)
    if options.settings:
        raise InputRefused(Fault(reason="is for --again: all else is as it was recorded", where="--set"))
    report = StudyReport(console, options.out, ("recordings.csv", "settings.csv"), overwrite=options.overwrite)
    played, is_within = numbered([one for path in paths for one in sessions(opened(path))])
    compared, tables = compare(played, options.baseline, is_within=is_within)
    records, events = [one.record for one in played], [event for one in played for event in one.events]
    more = {"recordings.csv": listed(played), "settings.csv": settings(played)}
    report.end(records, events, compared, [*tables, configured(played)], more)
    return DONE


def found(given: Sequence[Path]) -> list[Path]:
    """Files of recordings: those that are given, and those in folders. Raises InputRefused: there are none."""
    paths = [path for one in given for path in (sorted(one.glob("*.mcap")) if one.is_dir() else [one])]
    if not paths:
        raise InputRefused(Fault(reason="no recordings (*.mcap) in it", where=", ".join(map(str, given))))
    return list(dict.fromkeys(paths))


def numbered(sessions: Sequence[Session]) -> tuple[list[Session], bool]:
    """Number the sessions. Returns them, and whether sessions of one number are of one participant.

    They are if all participants are named, none has two sessions in one condition, and any has some in several.
    """
    seen = Counter((one.participant, one.condition) for one in sessions)
    conditions = {one.participant: set[str]() for one in sessions}
    for one in sessions:
        conditions[one.participant].add(one.condition)
    is_within = (
        all(one.participant for one in sessions)
        and max(seen.values()) == 1
        and any(len(names) > 1 for names in conditions.values())
    )
    if is_within:
        numbers = {name: number for number, name in enumerate(conditions)}
        return [_with_number(one, numbers[one.participant]) for one in sessions], True
    return [_with_number(one, number) for number, one in enumerate(sessions)], False


def _with_number(one: Session, number: int) -> Session:
    from msgspec.structs import replace

    events = tuple(replace(event, session=number) for event in one.events)
    return replace(one, record=replace(one.record, session=number), events=events)


def compare(
    sessions: Sequence[Session], baseline: str | None, *, is_within: bool
) -> tuple[list[HypothesisResult], list[NumberTable]]:
    """Make the findings and all tables. Raises InputRefused: there is no such baseline."""
    records = [one.record for one in sessions]
    conditions = list(dict.fromkeys(record.condition for record in records))
    if baseline is not None and baseline not in conditions:
        advice = f"there are: {', '.join(conditions)}"
        raise InputRefused(
            Fault(reason=f"no recording has the condition {baseline!r}", where="--baseline", advice=advice)
        )
    tables = [summary.overview(records)]
    against = baseline or BASELINE
    found: list[HypothesisResult] = []
    if len(conditions) > 1 and against in conditions:
        others = [name for name in conditions if name != against]
        found = findings(records, baseline=against, others=others, is_paired=is_within)
        tables.append(summary.hypotheses(found, WITHIN if is_within else BETWEEN))
    tables.append(overview(sessions, against))
    return found, tables


def overview(sessions: Sequence[Session], baseline: str) -> NumberTable:
    """Table with a row for each session, and what to doubt."""
    rows = tuple(
        (
            one.path.name, one.condition, one.participant or summary.MISSING, f"{one.record.duration:.0f}",
            str(one.record.statistics.events), summary.number(one.record.statistics.mtbce),
        )
        for one in sessions
    )  # fmt: skip
    conditions = {one.condition for one in sessions}
    notes = list(dict.fromkeys(f"{one.path.name}: {doubt}." for one in sessions for doubt in one.doubts))
    if len(conditions) > 1 and baseline not in conditions:
        notes.append(f"No recording has the condition {baseline!r}, so nothing is compared: name one by --baseline.")
    if UNNAMED in conditions:
        notes.append("Some name no condition (by `engage record --condition` or the window): they count together.")
    columns = ("", "condition", "participant", "seconds", "events", "MTBCE (s)")
    return NumberTable(title="Recordings", columns=columns, rows=rows, notes=tuple(notes))


def configured(sessions: Sequence[Session]) -> NumberTable:
    """Table with the settings of the services that are not as by default, and those of later lives that changed."""
    by_default = dict(flat(shown(widest()())))
    found: list[tuple[str, ...]] = []
    notes = []
    for one in {one.path: one for one in sessions}.values():
        before: dict[str, Mapping[str, str]] = {}
        for life in one.settings:
            told = life.told
            if life.unread:
                notes.append(f"{one.path.name}: {told.participant}, life {life.number}: not read: {life.unread}.")
                continue
            others = before.get(told.participant, by_default)
            since = "" if life.number == 1 else f"life {life.number}, from {life.since:.1f} s"
            found += [(one.path.name, told.participant, since, line) for line in changed(life, others)]
            before[told.participant] = life.values
        if not one.settings:
            notes.append(f"{one.path.name}: it has no settings of its services; nobody knows what they were.")
    if any(one.settings for one in sessions):
        notes.append("All others are as by default in this Engage; `engage export --settings` has them all.")
    return NumberTable(
        title="Settings", columns=("", "service", "life", "setting"), rows=tuple(found), notes=tuple(notes)
    )  # fmt: skip


def settings(sessions: Sequence[Session]) -> str:
    """CSV of all settings of all services of all recordings."""
    found = ((one.record.session, one.condition, *row) for one in sessions for row in rows(one.settings))
    return summary.csv_table(("session", "condition", *COLUMNS), found)


def listed(sessions: Sequence[Session]) -> str:
    """CSV of the recordings: what `session` in the other files stands for."""
    found = (
        (one.record.session, one.condition, one.path.name, one.participant, "; ".join(one.doubts)) for one in sessions
    )
    return summary.csv_table(("session", "condition", "file", "participant", "doubts"), found)
