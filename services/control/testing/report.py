"""Report of a body that was checked: what it is, law by law whether it holds, and what breaks many.

`Printed` tells it to people as it comes, as wide as the terminal. Pure but for the console that it prints on.
"""

import math
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from typing import Literal

import msgspec
from msgspec import Struct
from msgspec.structs import replace
from rich.console import Console, Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from engage_hri.schemas.body import Capabilities
from engage_hri.schemas.units import Radians, Seconds
from engage_hri.schemas.world import World
from engage_hri.services.control.testing.findings import NEVER_ENDS, NOTHING_MOVES, Finding, degrees, ms

Verdict = Literal["holds", "broken", "not judged", "does not apply"]


class Stated(Struct, frozen=True, kw_only=True):
    """Exactness that is stated of a body, and how it is to be checked.

    tolerance: error of its estimates from point to point. noise: standard deviation of a reading of a joint.
    accuracy: how near joints and eyes come to where they are to be. real_time: it has a clock of its own.
    world: where targets are; None: the suite's.
    """

    tolerance: Seconds
    noise: Radians
    accuracy: Radians
    real_time: bool = False
    world: World | None = None


class Cause(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """Something that keeps laws from being judged.

    what: in words. behaviors: those that it keeps from being performed, in words; empty: it was found elsewhere.
    laws: names of the laws in which it showed, or which had nothing left to be judged by.
    """

    what: str
    behaviors: tuple[str, ...] = ()
    laws: tuple[str, ...] = ()


class CheckedLaw(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """One law and what came of it.

    law: its name, in words. topic: what it is about. says: what holds. usually: what it is if it does not hold.
    trials: how often it was tried; each is one seed, crowd or fault. reasons: why it, or some of its trials, do not
    apply. seconds: time that it took on the wall clock.
    """

    law: str
    topic: str
    says: str
    usually: str
    verdict: Verdict
    trials: int
    findings: tuple[Finding, ...] = ()
    reasons: tuple[str, ...] = ()
    seconds: Seconds = 0.0


class BodyReport(Struct, frozen=True, kw_only=True):
    """Everything that a check has found.

    driver: the name that it was asked for by. asked: behaviors that it was asked for, in words. not_asked: those that
    it cannot do, with the reason. unknown: types that it has, and the suite has no behavior of. estimate: median time
    that one estimate took. causes: what broke many laws, or the first look already. not_tried: laws that it did not
    come to. is_stopped: true if somebody has stopped it. notes: what is worth knowing, and breaks no law. fastest:
    that each joint was seen to be while its limits were judged, radians per second. seconds: time of the whole check
    on the wall clock.
    """

    capabilities: Capabilities
    stated: Stated
    driver: str = ""
    asked: tuple[str, ...] = ()
    not_asked: tuple[str, ...] = ()
    unknown: tuple[str, ...] = ()
    estimate: Seconds = 0.0
    laws: tuple[CheckedLaw, ...] = ()
    causes: tuple[Cause, ...] = ()
    not_tried: tuple[str, ...] = ()
    is_stopped: bool = False
    notes: tuple[str, ...] = ()
    fastest: Mapping[str, float] = {}
    seconds: Seconds = 0.0

    @property
    def is_good(self) -> bool:
        """True if some law holds, and nothing is broken or left out."""
        is_whole = not (self.causes or self.of("broken") or self.of("not judged") or self.is_stopped)
        return is_whole and bool(self.of("holds"))

    def of(self, verdict: Verdict) -> list[CheckedLaw]:
        """List the laws of which this is true."""
        return [each for each in self.laws if each.verdict == verdict]


def as_json(report: BodyReport) -> str:
    """Write it as one JSON object."""
    return msgspec.json.encode({"good": report.is_good, **msgspec.to_builtins(report)}).decode()


def told_once(laws: Iterable[CheckedLaw], known: Sequence[Cause]) -> tuple[tuple[CheckedLaw, ...], tuple[Cause, ...]]:
    """Find what shows in several laws, and take these laws for not judged where nothing else is wrong.

    known: what the first look has found; it counts also where it shows in one law, or in none.
    """
    laws = tuple(laws)
    shown: dict[str, dict[str, None]] = {cause.what: {} for cause in known}
    for law in laws:
        for finding in law.findings:
            if finding.cause:
                shown.setdefault(finding.cause, {})[law.law] = None
    first = {cause.what: cause.behaviors for cause in known}
    causes = tuple(
        Cause(what=what, behaviors=first.get(what, ()), laws=tuple(names))
        for what, names in shown.items()
        if what in first or len(names) > 1
    )
    shared = {cause.what for cause in causes}
    judged = (
        replace(law, verdict="not judged")
        if law.findings and all(finding.cause in shared for finding in law.findings)
        else law
        for law in laws
    )
    return tuple(judged), causes


def by_words(outcomes: Mapping[str, str]) -> tuple[Cause, ...]:
    """Put together behaviors of which the same is true.

    outcomes: what went wrong with each behavior, both in words.
    """
    found: dict[str, list[str]] = {}
    for behavior, what in outcomes.items():
        found.setdefault(what, []).append(behavior)
    return tuple(Cause(what=what, behaviors=tuple(behaviors)) for what, behaviors in found.items())


SHOWN = 4
"""Findings of one law that are shown; the JSON has all."""
MARKS: dict[Verdict, tuple[str, str]] = {
    "holds": ("holds", "green"), "broken": ("BROKEN", "bold red"), "not judged": ("", ""),
    "does not apply": ("--", "dim"),
}  # fmt: skip
MUCH = 10
"""Broken laws from which on another clock may be behind them."""


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
    count = len(cause.laws)
    told = f"{cause.what}: {'1 law' if count == 1 else f'{count} laws'} could not be judged by that"
    whose = f" ({', '.join(cause.behaviors)})" if cause.behaviors and not cause.what.startswith(NOTHING_MOVES) else ""
    return Text.assemble((told, "bold red"), (whose, "dim"))


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
        yield Text(f"- {finding}")
    if len(findings) > SHOWN:
        yield Text(f"and {len(findings) - SHOWN} more; --json has all", style="dim")
    if not all(finding.cause for finding in findings):
        yield Text.assemble(("usually: ", "yellow"), law.usually)


# -- what came of it ----------------------------------------------------------------------------------------------


def _end(report: BodyReport) -> Iterator[Text]:
    if report.is_stopped:
        tried = f"Stopped: {_laws_that(len(report.laws), 'was', 'were')} judged"
        yield Text(f"{tried}, {len(report.not_tried)} not: {'; '.join(report.not_tried)}.", style="bold yellow")
    count = {each: len(report.of(each)) for each in MARKS}
    broken, unjudged = count["broken"], count["not judged"]
    told = [_laws_that(count["holds"], "holds", "hold")]
    told = [f"{_laws_that(broken, 'is', 'are')} broken", *told] if broken else [*told, "none is broken"]
    told += [f"{unjudged} could not be judged"] * bool(unjudged)
    rest = f"{_laws_that(count['does not apply'], 'does', 'do')} not apply. It took {report.seconds:.1f} s."
    yield Text(", ".join([*told, rest]), style="bold green" if report.is_good else "bold red")
    if any("faults" in reason for law in report.of("does not apply") for reason in law.reasons):
        yield Text("No fault was played: a test of your own can name some (`faults`, docs/contract.md).", style="dim")
    for note in report.notes:
        yield Text(f"Note: {note}.", style="yellow")
    never = any(cause.what.startswith((NEVER_ENDS, NOTHING_MOVES)) for cause in report.causes)
    if not report.stated.real_time and (never or broken >= MUCH):
        yield Text(
            "A body with a clock of its own (hardware, a daemon, a thread) is checked with --real-time.",
            style="yellow",
        )


def _laws_that(count: int, does: str, do: str) -> str:
    return f"1 law {does}" if count == 1 else f"{count} laws {do}"
