"""The report for people. Pure: a report in, text out, as wide as the terminal."""

import math
from collections.abc import Container, Iterator, Sequence

from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from engage_hri.services.control.testing.laws import NEVER_ENDS, NOTHING_MOVES, Finding, degrees, ms
from engage_hri.services.control.testing.report import BodyReport, Cause, CheckedLaw, Verdict

SHOWN = 4
"""Findings of one law that are shown; the JSON has all."""
MARKS: dict[Verdict, tuple[str, str]] = {
    "holds": ("holds", "green"), "broken": ("BROKEN", "bold red"), "not judged": ("", ""),
    "does not apply": ("--", "dim"),
}  # fmt: skip
NEVER = ("goes on", "for ever", "never comes", "nothing", "stays true", "does not return")
"""Words of findings that a body with a clock of its own has in virtual time."""


def rendered(report: BodyReport) -> RenderableType:
    """Draw the report: what the body is, law by law what was found, and what came of it."""
    parts: list[RenderableType] = [_head(report), Text(), _body(report), Text()]
    if report.capabilities.joints:
        parts += [_joints(report), Text()]
    if report.causes:
        parts += [*(_cause(each) for each in report.causes), Text()]
    above = {cause.what for cause in report.causes}
    for topic in dict.fromkeys(each.topic for each in report.laws):
        laws = [each for each in report.laws if each.topic == topic]
        parts += [Text(topic, style="bold"), *_laws(laws, above), Text()]
    return Group(*parts, *_end(report))


# -- what the body is ---------------------------------------------------------------------------------------------


def _head(report: BodyReport) -> Text:
    name = report.capabilities.body or "a body without a name"
    clock = "in real time" if report.stated.real_time else "in virtual time"
    return Text.assemble((name, "bold"), f" ({report.driver}), held to the contract of bodies {clock}")


def _body(report: BodyReport) -> Table:
    stated, able = report.stated, report.capabilities
    table = Table(box=None, show_header=False, pad_edge=False, padding=(0, 2, 0, 0))
    table.add_column(style="dim", no_wrap=True)
    table.add_column(overflow="fold")
    table.add_row("types", ", ".join(able.types) or "none")
    table.add_row("parts", ", ".join(able.parts) or "none")
    table.add_row("asked for", ", ".join(report.asked) or "nothing")
    if report.not_asked:
        table.add_row("it cannot do", "; ".join(report.not_asked))
    if report.unknown:
        table.add_row("not checked", f"{', '.join(report.unknown)}: the suite has no such behavior")
    table.add_row(
        "stated", f"estimates within {ms(stated.tolerance)}; encoders scatter by {degrees(stated.noise)}; on target "
        f"within {degrees(stated.accuracy)}",
    )  # fmt: skip
    if report.estimate:
        table.add_row("an estimate", f"takes {report.estimate * 1000:.2f} ms")
    return table


def _joints(report: BodyReport) -> Table:
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    table.add_column("joint", header_style="dim")
    table.add_column("part", header_style="dim")
    for unit in ("from", "to degrees", "degrees/s", "degrees/s²", *["seen degrees/s"] * bool(report.fastest)):
        table.add_column(unit, header_style="dim", justify="right")
    for joint in report.capabilities.joints:
        numbers = (joint.low, joint.high, joint.speed, joint.acceleration)
        seen = [report.fastest.get(joint.joint, 0.0)] if report.fastest else []
        table.add_row(joint.joint, joint.part, *(f"{math.degrees(number):.0f}" for number in (*numbers, *seen)))
    return table


# -- what was found -----------------------------------------------------------------------------------------------


def _cause(cause: Cause) -> Text:
    text = Text(f"{cause.what}: ", style="bold red")
    if cause.laws:
        text.append(f"{len(cause.laws)} {'law' if len(cause.laws) == 1 else 'laws'} could not be judged by that")
    else:
        text.append("no law was judged" if not cause.behaviors else "the laws were judged without it")
    if cause.behaviors and not cause.what.startswith(NOTHING_MOVES):
        text.append(f" ({', '.join(cause.behaviors)})", style="dim")
    return text


def _laws(laws: Sequence[CheckedLaw], above: Container[str]) -> Iterator[RenderableType]:
    table: Table | None = None
    unjudged = "; ".join(law.law for law in laws if law.verdict == "not judged")
    for law in (each for each in laws if each.verdict != "not judged"):
        if table is None:
            table = Table(box=None, show_header=False, pad_edge=False, padding=(0, 2, 0, 0))
            table.add_column(width=6)
            table.add_column(overflow="fold")
        mark, style = MARKS[law.verdict]
        why = f": {'; '.join(law.reasons)}" if law.verdict == "does not apply" else ""
        table.add_row(Text(mark, style=style), Text(law.law + why, style="dim" if why else ""))
        if law.verdict == "broken":
            yield table
            yield Padding(Group(*_broken(law, above)), (0, 0, 1, 8))
            table = None
    if table is not None:
        yield table
    if unjudged:
        yield Padding(Text(f"not judged: {unjudged}", style="dim"), (0, 0, 0, 8))


def _broken(law: CheckedLaw, above: Container[str]) -> Iterator[Text]:
    """Tell what a law says, and what was found but for what is told above."""
    yield Text(law.says, style="italic")
    findings = [each for each in law.findings if each.cause not in above]
    for finding in findings[:SHOWN]:
        yield _finding(finding)
    if len(findings) > SHOWN:
        yield Text(f"and {len(findings) - SHOWN} more; --json has all", style="dim")
    yield Text.assemble(("usually: ", "yellow"), law.usually)


def _finding(finding: Finding) -> Text:
    place = ", ".join(filter(None, (finding.behavior, finding.sync)))
    text = Text.assemble(
        "- ", (f"{place}: " if place else ""), "expected: ", (finding.expected, "green"), "; measured: ",
        (finding.measured, "red"),
    )  # fmt: skip
    return text.append(f" ({finding.advice})" if finding.advice else "")


# -- what came of it ----------------------------------------------------------------------------------------------


def _end(report: BodyReport) -> Iterator[Text]:
    count = {each: len(report.of(each)) for each in MARKS}
    holds, broken, unjudged = count["holds"], count["broken"], count["not judged"]
    if report.is_stopped:
        tried = f"Stopped: {_laws_that(len(report.laws), 'was', 'were')} judged"
        yield Text(f"{tried}, {len(report.not_tried)} not: {'; '.join(report.not_tried)}.", style="bold yellow")
    rest = f"{_laws_that(count['does not apply'], 'does', 'do')} not apply. It took {report.seconds:.1f} s."
    if unjudged:
        rest = f"{unjudged} could not be judged, {rest}"
    if not report.laws:
        yield Text(f"Nothing could be judged. It took {report.seconds:.1f} s.", style="bold red")
    elif not holds and not broken:
        yield Text(f"Nothing could be checked: {rest}", style="bold red")
    elif not broken and not report.is_good:
        yield Text(f"{_laws_that(holds, 'holds', 'hold')}, {rest}", style="bold red")
    elif broken:
        style = "bold red"
        yield Text(
            f"{_laws_that(broken, 'is', 'are')} broken, {_laws_that(holds, 'holds', 'hold')}, {rest}", style=style
        )
    else:
        yield Text(f"{_laws_that(holds, 'holds', 'hold')}, none is broken, {rest}", style="bold green")
    if any("faults" in reason for law in report.of("does not apply") for reason in law.reasons):
        yield Text("No fault was played: a test of your own can name some (`faults`, docs/contract.md).", style="dim")
    for note in report.notes:
        yield Text(f"Note: {note}.", style="yellow")
    if _looks_like_another_clock(report):
        yield Text(
            "Much of it never came. A body with a clock of its own (hardware, a daemon, a thread) is checked with "
            "--real-time.", style="yellow",
        )  # fmt: skip


def _laws_that(count: int, does: str, do: str) -> str:
    return f"1 law {does}" if count == 1 else f"{count} laws {do}"


def _looks_like_another_clock(report: BodyReport) -> bool:
    if report.stated.real_time:
        return False
    if any(cause.what.startswith((NEVER_ENDS, NOTHING_MOVES)) for cause in report.causes):
        return True
    findings = [each for law in report.of("broken") for each in law.findings]
    waits = [each for each in findings if any(words in each.measured for words in NEVER)]
    return len(report.of("broken")) > 9 and 2 * len(waits) > len(findings)
