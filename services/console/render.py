"""Draw a scene with rich. No state: the same scene gives the same picture."""

from math import inf

from rich import box
from rich.console import Console, ConsoleOptions, Group, RenderableType, RenderResult
from rich.panel import Panel
from rich.segment import Segment
from rich.table import Table
from rich.text import Text

from engage_hri.schemas.units import Seconds
from engage_hri.services.console import wording
from engage_hri.services.console.view import EventInView, Point, Scene

POINTS_SHOWN = 11
AHEAD = 4
"""At least so many of the planned points are among them."""
UTTERANCES_SHOWN = 5
EVENTS_SHOWN = 8
UPPER = POINTS_SHOWN + 4
"""How high what stands above the connection events is."""
PEOPLE = 7
EVENTS_FRAME = 3
NOTICED: Seconds = 0.1
"""People notice when speech and gesture are further apart."""
STATE_STYLES = {
    "started": "yellow",
    "succeeded": "green",
    "completed": "green",
    "failed": "red",
    "preempted": "dim",
    "withdrawn": "dim",
    "superseded": "dim",
    "lost": "red",
}


def render(scene: Scene, height: int | None = None) -> RenderableType:
    """The whole live view. height: of the terminal, 19 lines or more; without it some 30 are taken."""
    upper = Table.grid(expand=True)
    upper.add_column(ratio=4)
    upper.add_column(ratio=5)
    upper.add_row(Group(_people(scene), _said(scene)), _points(scene))
    events = EVENTS_SHOWN if height is None else height - UPPER - EVENTS_FRAME - len(scene.notes)
    parts: list[RenderableType] = [upper, _events(scene, max(1, min(events, EVENTS_SHOWN)))]
    parts += [Text(f"! {note}", style="yellow", no_wrap=True, overflow="ellipsis") for note in scene.notes]
    return Group(*parts)


def _people(scene: Scene) -> Panel:
    table = Table.grid(padding=(0, 1))
    for actor in sorted(scene.actors, key=lambda actor: actor.id != scene.robot):
        style = "cyan" if actor.id == scene.robot else "magenta"
        if not actor.present:
            table.add_row(Text(actor.id, style=style), Text("has left", style="dim"))
            continue
        look = actor.look
        doing = Text("looks at " if look and look.targets else "looks ")
        doing += Text(wording.look(look.targets, scene.robot) if look else "around", style="bold")
        for action in actor.doing:
            if action.action == "point":
                doing += Text("  points ") + Text(wording.names(action.targets), style="bold")
            elif action.action == "act":
                doing += Text("  moves ") + Text(wording.names(action.targets), style="bold")
            elif action.action in ("nod", "shake", "speak"):
                doing += Text(f"  {action.action}s")
        table.add_row(Text(actor.id, style=style), doing)
    if scene.owner is not None:
        table.add_row(Text("head", style="dim"), Text(wording.claim(scene.owner)))
        if scene.waiting:
            waiting = ", ".join(claim.kind for claim in scene.waiting)
            table.add_row("", Text(f"waiting: {waiting}", style="dim"))
    mtbce = wording.seconds(scene.session.mtbce if scene.session else None)
    title = Text(f"engage {wording.clock(scene.now - scene.began)}  MTBCE {mtbce}", style="bold")
    return Panel(table, title=title, title_align="left", box=box.ROUNDED, height=PEOPLE)


def _said(scene: Scene) -> Panel:
    lines = []
    for utterance in scene.said[-UTTERANCES_SHOWN:]:
        style = "cyan" if utterance.actor == scene.robot else "magenta"
        text = Text(f"{utterance.actor}: ", style=style)
        text.append(utterance.text or "…", style="" if utterance.open else "dim")
        if utterance.open:
            text.append("▌", style="blink")
        lines.append(text)
    height = UPPER - PEOPLE
    newest = _LastLines(Group(*lines), height - 2)
    return Panel(newest, title="said", title_align="left", box=box.ROUNDED, height=height)


class _LastLines:
    """The end of what may be too high: a panel would cut that off, and the newest stands there."""

    def __init__(self, whole: RenderableType, height: int) -> None:
        self._whole = whole
        self._height = height

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        for line in console.render_lines(self._whole, options.update(height=None))[-self._height :]:
            yield from line
            yield Segment.line()


def _points(scene: Scene) -> Panel:
    block = scene.block
    table = Table(box=None, expand=True, pad_edge=False)
    table.add_column("sync points (s)", no_wrap=True, overflow="ellipsis", ratio=1)
    for name in ("plan", "real", "slip"):
        table.add_column(name, justify="right", no_wrap=True, min_width=5)
    for points in _window(_together(block.points)) if block else ():
        first = points[0]
        came, slip = first.realised is not None, first.slip
        late = slip is not None and abs(slip) >= NOTICED
        name = f"{first.behavior}:{' '.join(point.sync for point in points)}"
        table.add_row(
            Text(name, style="" if came else "dim"),
            wording.number(first.planned),
            Text(wording.number(first.realised), style="green" if came else "dim"),
            Text(wording.number(slip, sign=True), style="yellow" if late else "dim"),
        )
    # Ids are other people's: as Text, so that brackets in them are not read as markup.
    title = Text(f"block {block.id} {block.status or 'running'}" if block else "no block yet")
    return Panel(table, title=title, title_align="left", box=box.ROUNDED, height=UPPER)


def _together(points: tuple[Point, ...]) -> list[list[Point]]:
    """Points of one behavior that are one instant share a row."""
    rows: list[list[Point]] = []
    for point in points:
        last = rows[-1][0] if rows else None
        if last and (last.behavior, _ms(last.planned), _ms(last.realised)) == (
            point.behavior, _ms(point.planned), _ms(point.realised),
        ):  # fmt: skip
            rows[-1].append(point)
        else:
            rows.append([point])
    return rows


def _ms(value: float | None) -> int | None:
    return None if value is None else round(1000 * value)


def _window(rows: list[list[Point]]) -> list[list[Point]]:
    """The newest realised rows and the next planned ones, by time."""
    came = sorted((row for row in rows if row[0].realised is not None), key=lambda row: row[0].realised or 0.0)
    to_come = [row for row in rows if row[0].realised is None]
    to_come.sort(key=lambda row: inf if row[0].planned is None else row[0].planned)
    ahead = min(len(to_come), max(AHEAD, POINTS_SHOWN - len(came)))
    behind = POINTS_SHOWN - ahead
    return [*(came[-behind:] if behind else ()), *to_come[:ahead]]


def _events(scene: Scene, shown: int) -> Panel:
    table = Table(box=None, expand=True, pad_edge=False, padding=(0, 1, 0, 0))
    for name, width in (("at", 6), ("connection event", 18), ("who", 11), ("about", 8), ("cause", 5)):
        table.add_column(name, no_wrap=True, overflow="ellipsis", min_width=width)
    table.add_column("outcome", no_wrap=True, ratio=1, min_width=16)
    for row in scene.events[-shown:]:
        table.add_row(*_event(row, scene))
    return Panel(table, title="connection events", title_align="left", box=box.ROUNDED, height=shown + EVENTS_FRAME)


def _event(row: EventInView, scene: Scene) -> tuple[RenderableType, ...]:
    event = row.event
    return (
        wording.clock(row.began - scene.began),
        Text(wording.KINDS[event.kind]),
        Text(f"{event.initiator}→{event.responder}"),
        Text(wording.names(event.objects)),
        Text(event.cause),
        Text(wording.decision(event), style=STATE_STYLES[event.state]),
    )
