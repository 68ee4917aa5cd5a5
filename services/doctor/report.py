"""The report for people, and for programs. Pure: facts and findings in, text out."""

from collections.abc import Iterator, Sequence

import msgspec
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from engage_hri.schemas.units import A_DAY, Seconds, span
from engage_hri.services.doctor.findings import (
    Cell,
    Diagnosis,
    EndpointFacts,
    Severity,
    SystemFacts,
    certificates,
    matrix,
)

GOOD = Text("Nothing is wrong.", style="bold green")
STYLES: dict[Severity, str] = {"wrong": "bold red", "doubtful": "yellow", "note": "dim"}


def as_json(facts: SystemFacts, found: Sequence[Diagnosis]) -> str:
    """Write all as one JSON object: `findings`, `matrix` and `facts`."""
    return msgspec.json.encode({"findings": found, "matrix": matrix(facts), "facts": facts}).decode()


def report(facts: SystemFacts, found: Sequence[Diagnosis], width: int = 80) -> RenderableType:
    """Draw the report, as wide as the terminal."""
    parts: list[RenderableType] = [_head(facts)]
    if facts.known:
        parts += [Text(), _who_sees_whom(facts, width), Text(), _participants(facts)]
    parts += [Text(), _around(facts), Text(), _findings(found)]
    return Group(*parts)


def _head(facts: SystemFacts) -> Text:
    own = facts.own
    return Text(
        f"robot {facts.robot!r}, from {own.host or 'here'}: Engage {facts.version}, {facts.protocol}, "
        f"Zenoh {own.zenoh}, Python {own.python}"
    )


def _table(*columns: str) -> Table:
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for column in columns:
        table.add_column(Text(column), header_style="dim", overflow="fold")
    return table


def _add(table: Table, *cells: str | Text) -> None:
    """Add a row. Text is shown as it is: brackets, as of IPv6, are no markup."""
    table.add_row(*(Text(cell) if isinstance(cell, str) else cell for cell in cells))


def _who_sees_whom(facts: SystemFacts, width: int) -> RenderableType:
    """Draw the matrix: a row for each who sees, a column for each who is seen, with the round trips in ms.

    Where there is no room for names the columns have numbers, and there are none for those who answer nothing.
    """
    rows: dict[str, list[Cell]] = {}
    for cell in matrix(facts):
        rows.setdefault(cell.viewer, []).append(cell)
    every = [one.name for one in facts.known]
    has_room = sum(max(6, len(name)) + 2 for name in (max(rows, key=len), *every)) <= width
    names = every if has_room else [name for name in every if name in rows]
    numbers = {name: "" if has_room else f"{number} " for number, name in enumerate(names, 1)}
    table = _table("sees", *(name if has_room else number.strip() for name, number in numbers.items()))
    for viewer, cells in rows.items():
        _add(table, numbers.get(viewer, "") + viewer, *(_cell(cell) for cell in cells if cell.other in names))
    others = [name for name in every if name not in names]
    title = Text("Who sees whom, with round trips in ms", style="bold")
    return Group(title, table, *([Text(f"seen, too: {', '.join(others)}")] if others else []))


def _cell(cell: Cell) -> Text:
    match cell.sees:
        case "itself":
            return Text("·", style="dim")
        case "needless":
            return Text("-", style="dim")
        case "no":
            return Text("NO", style=STYLES["wrong"])
        case "unknown":
            return Text("?", style=STYLES["doubtful"])
    return Text("yes" if cell.trip is None else f"{1000 * cell.trip:.1f}")


def _participants(facts: SystemFacts) -> RenderableType:
    table = _table("participant", "machine", "clock", "up", "gaps", "lost", "dropped", "Engage", "Python")
    clocks = {each.clock: each for each in facts.clocks}
    for one in facts.known:
        if one.status is None:
            if one.answers:
                _add(table, one.name, "does not answer" if one.seen else "not seen from here")
            continue
        status, process, bus = one.status, one.status.process, (one.later or one.status).bus
        clock = clocks.get(status.at.clock)
        apart = "same" if clock is None else f"{-clock.offset:+.3f} s ± {1000 * clock.error:.1f} ms"
        up = _time(status.at.seconds - status.joined.seconds)
        counts = (str(bus.gaps), str(bus.lost), str(bus.dropped))
        _add(table, one.name, process.host or "?", apart, up, *counts, status.version, process.python or "?")
    return Group(Text("Participants", style="bold"), table)


def _time(seconds: Seconds) -> str:
    if seconds < 120:
        return f"{seconds:.0f} s"
    if seconds < 7200:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.0f} h" if seconds < 2 * A_DAY else f"{seconds / A_DAY:.0f} d"


def _around(facts: SystemFacts) -> Table:
    """Draw what is there beside the participants."""
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), show_header=False)
    table.add_column(style="dim", no_wrap=True)
    table.add_column(overflow="fold")
    for what, text in _things(facts):
        _add(table, what, text)
    return table


def _things(facts: SystemFacts) -> Iterator[tuple[str, str]]:
    for door in facts.doors:
        yield "endpoint", f"{door.endpoint}: {door.problem or _open(door, facts)}"
    if facts.own.mode:
        yield "links", f"{facts.own.mode}, {f'keys of {facts.own.holder}' if facts.own.holder else 'without keys'}"
    ends = certificates(facts)
    for until, name in sorted((until, name) for name, until in ends.items())[:1]:
        more = f"; {len(ends)} in all" if len(ends) > 1 else ""
        yield "certificates", f"next to expire: {name}, {_left(until, facts)}{more}"
    if facts.body is not None:
        voice = "with a voice" if "speech" in facts.body.types else "without a voice"
        yield "body", facts.body.problem or f"{facts.body.name}, {voice}; {len(facts.body.types)} types of behaviors"
    if facts.bus and facts.known:
        yield "sight", _sight(facts)
    if facts.found:
        yield "other robots", ", ".join(facts.found)


def _open(door: EndpointFacts, facts: SystemFacts) -> str:
    until = "" if door.until is None else f", certificate for {_left(door.until, facts)}"
    return f"somebody listens{', encrypted' if door.is_closed else ''}{until}"


def _left(until: int, facts: SystemFacts) -> str:
    left = until - facts.at
    return span(left) if left > 0 else "EXPIRED"


def _sight(facts: SystemFacts) -> str:
    match facts.sight:
        case None:
            return "nobody tells of a world"
        case "unknown":
            return "not for these keys"
        case sight:
            who = f"{sight.people} {'person' if sight.people == 1 else 'people'}"
            return f"{who} and {sight.objects} objects, told by {sight.source} {_time(sight.age)} ago"


def _findings(found: Sequence[Diagnosis]) -> RenderableType:
    if not found:
        return GOOD
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), show_header=False)
    table.add_column(no_wrap=True)
    table.add_column(overflow="fold")
    for finding in found:
        _add(table, Text(finding.severity, style=STYLES[finding.severity]), f"{finding.where}: {finding.what}")
        _add(table, "", Text(f"→ {finding.do}", style="dim"))
    wrong = sum(finding.severity == "wrong" for finding in found)
    told = "1 thing is wrong." if wrong == 1 else f"{wrong} things are wrong."
    return Group(table, Text(), Text(told, style=STYLES["wrong"]) if wrong else GOOD)
