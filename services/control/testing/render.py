"""The report for people, as wide as the terminal. Pure but for the console that it prints on."""

import math
from collections.abc import Container, Iterator

from rich.console import Console, Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from engage_hri.services.control.testing.laws import NEVER_ENDS, NOTHING_MOVES, WRONG_UNIT, Finding, degrees, ms
from engage_hri.services.control.testing.report import BodyReport, Cause, CheckedLaw, Verdict

SHOWN = 4
"""Findings of one law that are shown; the JSON has all."""
MARKS: dict[Verdict, tuple[str, str]] = {
    "holds": ("holds", "green"), "broken": ("BROKEN", "bold red"), "not judged": ("", ""),
    "does not apply": ("--", "dim"),
}  # fmt: skip
NEVER = ("goes on", "for ever", "never comes", "nothing", "stays true", "does not return")
"""Words of findings that a body with a clock of its own has in virtual time."""


class Printed:
    """The report on a console: each law as it is judged, for a check may take minutes.

    A law that shows nothing but what may be behind others as well is told at the end, when that is known.
    """

    def __init__(self, console: Console) -> None:
        self._console = console
        self._topic: str | None = None
        self._told: set[str] = set()
        """Names of the laws that were told of."""

    def begin(self, report: BodyReport) -> None:
        """Tell what the body is."""
        self._topic = ""
        self._console.print(_head(report), Text(), _body(report), sep="\n")

    def judge(self, law: CheckedLaw, known: Container[str] = ()) -> None:
        """Tell of a law. known: causes that are told of elsewhere."""
        if law.verdict == "broken" and all(finding.cause for finding in law.findings):
            return
        self._tell(law, known)

    def _tell(self, law: CheckedLaw, known: Container[str]) -> None:
        if law.topic != self._topic:
            self._topic = law.topic
            self._console.print(Text(), Text(law.topic, style="bold"), sep="\n")
        self._told.add(law.law)
        self._console.print(*_law(law, known), sep="\n")

    def end(self, report: BodyReport) -> None:
        """Tell what is left to be told: joints, what is behind several laws, and what came of all."""
        if self._topic is None:
            self.begin(report)
        causes = {cause.what for cause in report.causes}
        for law in report.of("broken"):
            if law.law not in self._told:
                self._tell(law, causes)
        parts: list[RenderableType] = [Text()]
        if unjudged := report.of("not judged"):
            names = "; ".join(law.law for law in unjudged)
            parts += [Text(f"not judged: {names}", style="dim"), Text()]
        if report.capabilities.joints:
            parts += [_joints(report), Text()]
        if report.causes:
            parts += [*(_cause(each) for each in report.causes), Text()]
        self._console.print(Group(*parts, *_end(report)))


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


def _law(law: CheckedLaw, above: Container[str]) -> Iterator[RenderableType]:
    mark, style = MARKS[law.verdict]
    why = f": {'; '.join(law.reasons)}" if law.verdict == "does not apply" else ""
    row = Table(box=None, show_header=False, pad_edge=False, padding=(0, 2, 0, 0))
    row.add_column(width=6)
    row.add_column(overflow="fold")
    row.add_row(Text(mark, style=style), Text(law.law + why, style="dim" if why else ""))
    yield row
    if law.verdict == "broken":
        yield Padding(Group(*_broken(law, above)), (0, 0, 1, 8))


def _broken(law: CheckedLaw, above: Container[str]) -> Iterator[Text]:
    """Tell what a law says, and what was found but for what is told above."""
    yield Text(law.says, style="italic")
    findings = [each for each in law.findings if each.cause not in above]
    for finding in findings[:SHOWN]:
        yield _finding(finding)
    if len(findings) > SHOWN:
        yield Text(f"and {len(findings) - SHOWN} more; --json has all", style="dim")
    if not all(finding.cause for finding in findings):
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
    if report.stated.real_time or any(cause.what.startswith(WRONG_UNIT) for cause in report.causes):
        return False
    if any(cause.what.startswith((NEVER_ENDS, NOTHING_MOVES)) for cause in report.causes):
        return True
    findings = [each for law in report.of("broken") for each in law.findings]
    waits = [each for each in findings if any(words in each.measured for words in NEVER)]
    return len(report.of("broken")) > 9 and 2 * len(waits) > len(findings)
