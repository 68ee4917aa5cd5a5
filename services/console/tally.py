"""The end of a session in numbers: events per kind with outcome and delays, MTBCE, duration."""

import msgspec
from msgspec import Struct
from rich import box
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from engage_hri.schemas.behaviors import EventKind
from engage_hri.schemas.feedback import BlockProgress
from engage_hri.schemas.fragments import FragmentOutcome
from engage_hri.schemas.messages import Message
from engage_hri.schemas.recognition import ConnectionEvent, Statistics, WindowStatistics
from engage_hri.schemas.units import Seconds
from engage_hri.services.console import wording


class Counted(Struct, frozen=True, kw_only=True):
    """Events of one kind and one side. Optional failures are counted apart: they never count in failure rates."""

    count: int = 0
    succeeded: int = 0
    failed: int = 0
    failed_optional: int = 0
    other: int = 0
    """Preempted, withdrawn or superseded, or lost."""
    open: int = 0
    delays: tuple[Seconds, ...] = ()
    """Of those that succeeded."""


class Tally(Struct, frozen=True, kw_only=True):
    """began, now: local instants. events: the decision (or last state) of each event, by id."""

    began: Seconds
    now: Seconds
    events: tuple[ConnectionEvent, ...] = ()
    session: WindowStatistics | None = None
    fragments: int = 0
    unfinished: int = 0
    """Fragments that failed or were interrupted."""
    blocks: int = 0

    @property
    def duration(self) -> Seconds:
        return self.now - self.began


def empty(at: Seconds) -> Tally:
    return Tally(began=at, now=at)


def feed(tally: Tally, message: Message, at: Seconds) -> Tally:
    """The tally after `message`, which speaks of the local instant `at`."""
    tally = msgspec.structs.replace(tally, now=max(tally.now, at))
    match message:
        case ConnectionEvent():
            known = {event.id: event for event in tally.events}
            before = known.get(message.id, message).state
            if message.state in ("completed", "lost") and before not in ("started", message.state):
                return tally  # its decision is what counts
            known[message.id] = message
            return msgspec.structs.replace(tally, events=tuple(known.values()))
        case Statistics(actor="", session=session):
            return msgspec.structs.replace(tally, session=session)
        case FragmentOutcome(status=status):
            unfinished = tally.unfinished + (status != "done")
            return msgspec.structs.replace(tally, fragments=tally.fragments + 1, unfinished=unfinished)
        case BlockProgress(progress="end"):
            return msgspec.structs.replace(tally, blocks=tally.blocks + 1)
    return tally


def count(tally: Tally, kind: EventKind, initiator: str | None, robot: str) -> Counted:
    """One row: events of `kind` initiated by the robot, or by people (initiator None)."""
    counted = Counted()
    for event in tally.events:
        if event.kind != kind or (event.initiator == robot) != (initiator == robot):
            continue
        succeeded = event.state in ("succeeded", "completed")
        failed = event.state == "failed"
        counted = Counted(
            count=counted.count + 1,
            succeeded=counted.succeeded + succeeded,
            failed=counted.failed + (failed and not event.optional),
            failed_optional=counted.failed_optional + (failed and event.optional),
            other=counted.other + (event.state in ("preempted", "withdrawn", "superseded", "lost")),
            open=counted.open + (event.state == "started"),
            delays=(*counted.delays, event.delay) if succeeded and event.delay is not None else counted.delays,
        )
    return counted


KINDS: tuple[tuple[EventKind, str], ...] = tuple(wording.KINDS.items())


def render(tally: Tally, robot: str) -> RenderableType:
    """The table and the last line, 80 columns wide."""
    table = Table(box=box.HORIZONTALS, padding=0, show_edge=False)
    table.add_column("by", no_wrap=True)
    table.add_column("connection event", no_wrap=True)
    for name in ("count", "succeeded", "failed", "opt.", "dropped", "delay (s)"):
        table.add_column(name, justify="right", no_wrap=True)
    for side, who in ((robot, robot), (None, "people")):
        for kind, name in KINDS:
            row = count(tally, kind, side, robot)
            if row.count:
                numbers = (row.count, row.succeeded, row.failed, row.failed_optional, row.other + row.open)
                table.add_row(Text(who), name, *map(str, numbers), _delays(row.delays))
    return Group(table, Text(_NOTE, style="dim"), Text(_last_lines(tally)))


_NOTE = (
    "opt.: failed, but optional, so no failure; dropped: preempted, withdrawn,\n"
    "superseded; delay: shortest, mean, longest of those that succeeded"
)


def _delays(delays: tuple[Seconds, ...]) -> str:
    if not delays:
        return "-"
    return " ".join(f"{value:.2f}" for value in (min(delays), sum(delays) / len(delays), max(delays)))


def _last_lines(tally: Tally) -> str:
    count = f"{tally.fragments} fragments" + (f", {tally.unfinished} not finished" if tally.unfinished else "")
    lines = [f"duration {wording.clock(tally.duration)}; {count}"]
    if tally.session is not None:
        mean, longest = wording.seconds(tally.session.mtbce), wording.seconds(tally.session.max_gap)
        lines.append(f"mean time between connection events (MTBCE) {mean}; longest gap {longest}")
    return "\n".join(lines)
