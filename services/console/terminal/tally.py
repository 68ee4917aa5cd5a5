"""Numbers at the end of a session: events of each kind with outcome and delays, MTBCE, duration."""

from collections.abc import Mapping

from msgspec import Struct
from msgspec.structs import replace
from rich import box
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from engage_hri.schemas.behaviors import EVENT_KINDS, EventKind
from engage_hri.schemas.blocks import BlockProgress
from engage_hri.schemas.fragments import FragmentOutcome
from engage_hri.schemas.messages import Message
from engage_hri.schemas.recognition import ConnectionEvent, Statistics, WindowStatistics
from engage_hri.schemas.units import Seconds
from engage_hri.services.console import wording


class Counted(Struct, frozen=True, kw_only=True):
    """Numbers of events of one kind and one initiator.

    Optional failures are counted apart, and are in no failure rate.
    """

    count: int = 0
    succeeded: int = 0
    failed: int = 0
    failed_optional: int = 0
    other: int = 0
    """Preempted, withdrawn or superseded, or lost."""
    open: int = 0
    delays: tuple[Seconds, ...] = ()
    """Delays of the events that succeeded."""


class Tally(Struct, frozen=True, kw_only=True):
    """Events and numbers of a session. began, now: local instants. events: each with its decision or last state."""

    began: Seconds
    now: Seconds
    events: Mapping[str, ConnectionEvent] = {}
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
    """Add a message to the tally. at: its local instant."""
    tally = replace(tally, now=max(tally.now, at))
    match message:
        case ConnectionEvent():
            before = (tally.events.get(message.id) or message).state
            if message.state in ("completed", "lost") and before not in ("started", message.state):
                return tally  # its decision is what counts
            return replace(tally, events={**tally.events, message.id: message})
        case Statistics(actor="", session=session):
            return replace(tally, session=session)
        case FragmentOutcome(status=status):
            unfinished = tally.unfinished + (status != "done")
            return replace(tally, fragments=tally.fragments + 1, unfinished=unfinished)
        case BlockProgress(progress="end"):
            return replace(tally, blocks=tally.blocks + 1)
    return tally


def count(tally: Tally, kind: EventKind, initiator: str | None, robot: str) -> Counted:
    """Count the events of one kind that the robot began, or people (initiator None)."""
    of_kind = [e for e in tally.events.values() if e.kind == kind and (e.initiator == robot) == (initiator == robot)]
    succeeded = [event for event in of_kind if event.state in ("succeeded", "completed")]
    failed = [event.optional for event in of_kind if event.state == "failed"]
    is_open = sum(event.state == "started" for event in of_kind)
    return Counted(
        count=len(of_kind),
        succeeded=len(succeeded),
        failed=failed.count(False),
        failed_optional=failed.count(True),
        other=len(of_kind) - len(succeeded) - len(failed) - is_open,
        open=is_open,
        delays=tuple(event.delay for event in succeeded if event.delay is not None),
    )


def render(tally: Tally, robot: str) -> RenderableType:
    """Draw the table and the last lines."""
    table = Table(box=box.HORIZONTALS, padding=0, show_edge=False)
    for name in ("by", "connection event", "count", "succeeded", "failed", "opt.", "dropped", "delay (s)"):
        table.add_column(name, justify="left" if name in ("by", "connection event") else "right", overflow="fold")
    for initiator, who in ((robot, robot), (None, "people")):
        for kind, words in EVENT_KINDS.items():
            row = count(tally, kind, initiator, robot)
            if row.count:
                numbers = (row.count, row.succeeded, row.failed, row.failed_optional, row.other + row.open)
                table.add_row(Text(who), words.title, *map(str, numbers), _delays(row.delays))
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
