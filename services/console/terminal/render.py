"""Drawing of a scene with Rich, as large as the terminal. No state: the same scene gives the same picture."""

from collections.abc import Iterable
from math import inf

from rich import box
from rich.console import Console, ConsoleOptions, Group, RenderableType, RenderResult
from rich.panel import Panel
from rich.segment import Segment
from rich.table import Table
from rich.text import Text

from engage_hri.schemas.body_faults import words
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.utf8 import printable
from engage_hri.services.console import wording
from engage_hri.services.console.view import Actor, EventInView, PointInView, Scene

HEIGHT = 30
"""Lines of the picture if the height of the terminal is unknown."""
SMALL = (72, 20)
"""Columns and lines below which there are no frames, and no plan beside the people."""
WIDE = 100
"""Columns from which a connection event needs no cutting."""
FRAME = 2
"""Lines that a frame takes."""
AHEAD = 4
"""Least number of planned points that are shown."""
NOTICED: Seconds = 0.1
"""Distance of speech and gesture from which people notice it."""
MARKS = {
    "started": ("…", "bold yellow"),
    "succeeded": ("✓", "green"),
    "completed": ("✓", "green"),
    "failed": ("✗", "red"),
    "lost": ("✗", "red"),
    "preempted": ("-", "dim"),
    "withdrawn": ("-", "dim"),
    "superseded": ("-", "dim"),
}


def render(scene: Scene, width: int = 80, height: int | None = None) -> RenderableType:
    """Draw the whole live view. width, height: of the terminal, in columns and lines; all of it is used."""
    height = height or HEIGHT
    notes: list[RenderableType] = [
        Text(printable(f"! {n}"), style="yellow", no_wrap=True, overflow="ellipsis") for n in scene.notes
    ]
    small = width < SMALL[0] or height < SMALL[1]
    notes = notes[-1:] if small else notes
    draw = _small if small else _framed
    return Group(*draw(scene, width, height - len(notes)), *notes)


def _small(scene: Scene, width: int, height: int) -> list[RenderableType]:
    people = _people(scene)[: max(1, height // 4)]
    rest = height - 1 - len(people)
    words = min(3, rest // 3)
    return [_title(scene), *people, _said(scene, words), _events(scene, width, rest - words)]


def _framed(scene: Scene, width: int, height: int) -> list[RenderableType]:
    """Parts of the large view: people and words on the left, the plan on the right, connection events below."""
    upper = max(11, height * 2 // 5)
    people = _people(scene)
    doing = min(max(5, len(people) + FRAME), upper // 2)
    left = Group(
        _panel(_LastLines(Group(*people[: doing - FRAME]), doing - FRAME), _title(scene)),
        _panel(_said(scene, upper - doing - FRAME), Text("said")),
    )
    top = Table.grid(expand=True)
    top.add_column(ratio=4)
    top.add_column(ratio=5)
    top.add_row(left, _plan(scene, upper - FRAME))
    shown = height - upper - FRAME
    return [top, _panel(_events(scene, width - 4, shown), _frequency(scene))]


def _panel(inner: RenderableType, title: Text) -> Panel:
    return Panel(inner, title=title, title_align="left", box=box.ROUNDED)


def _title(scene: Scene) -> Text:
    text = f"engage {wording.clock(scene.now - scene.began)}"
    return Text(text, style="bold", no_wrap=True, overflow="ellipsis")


def _frequency(scene: Scene) -> Text:
    mtbce = scene.session.mtbce if scene.session else None
    return Text("connection events" if mtbce is None else f"connection events, one every {wording.seconds(mtbce)}")


def _style(scene: Scene, actor: str) -> str:
    return "cyan" if actor == scene.robot else "magenta"


def _people(scene: Scene) -> list[Text]:
    """Lines for all actors, the robot first, then one for the owner of its head, and one for the faults that are on
    and for what is held."""
    actors = sorted(scene.actors, key=lambda actor: actor.id != scene.robot)
    wide = max((len(printable(actor.id)) for actor in actors), default=0)
    lines = [
        Text(printable(actor.id).ljust(wide) + " ", style=_style(scene, actor.id)) + _doing(scene, actor)
        for actor in actors
    ]
    if scene.owner is not None:
        line = Text(f"{'head'.ljust(wide)} ", style="dim") + Text(printable(wording.claim(scene.owner)))
        if scene.waiting:
            line += Text(f"; waiting: {', '.join(claim.kind for claim in scene.waiting)}", style="dim")
        lines.append(line)
    if scene.faults:
        texts = [words(fault) for fault in scene.faults]
        lines.append(Text(f"{'faults'.ljust(wide)} {printable(', '.join(texts))}", style="bold red"))
    if scene.held:
        now = scene.now
        texts = [f"{wording.held(each.hold)} for {wording.seconds(now - each.since)}" for each in scene.held]
        lines.append(Text(f"{'held'.ljust(wide)} {printable(', '.join(texts))}", style="bold yellow"))
    for line in lines:
        line.no_wrap, line.overflow = True, "ellipsis"
    return lines


def _doing(scene: Scene, actor: Actor) -> Text:
    if not actor.present:
        return Text("has left", style="dim")
    look = actor.look
    doing = Text.assemble("looks ", ("around", "bold")) if look is None else Text()
    for action in sorted(actor.doing, key=lambda doing: doing.action != "look"):
        if doing:
            doing += Text(", ")
        verb, target = wording.action_words(action.action, action.targets, scene.robot)
        doing += Text(verb) + Text(printable(f" {target}") if target else "", style="bold")
    return doing


def _said(scene: Scene, height: int) -> RenderableType:
    """The last utterances with their words; those of people have none."""
    lines = []
    for utterance in scene.said[-max(1, height) :]:  # each takes a line at least
        text = Text(printable(f"{utterance.actor}: "), style=_style(scene, utterance.actor))
        text.append(printable(utterance.text) or "…", style="bold" if utterance.open else "dim")
        if utterance.open:
            text.append("▌", style="blink")
        lines.append(text)
    return _LastLines(Group(*lines), height)


class _LastLines:
    """Part of exactly `height` lines; of a higher one the end is shown, where the newest lines are."""

    def __init__(self, whole: RenderableType, height: int) -> None:
        self._whole = whole
        self._height = height

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        lines = console.render_lines(self._whole, options.update(height=None))
        lines = lines[max(0, len(lines) - self._height) :]
        for line in (*lines, *([Segment(" ")] for _ in range(self._height - len(lines)))):
            yield from line
            yield Segment.line()


def _plan(scene: Scene, height: int) -> Panel:
    """Table of the running block: the planned time of each point, and the one that the body reported."""
    block = scene.block
    table = Table(box=None, expand=True, pad_edge=False)
    table.add_column("seconds", no_wrap=True, overflow="ellipsis", ratio=1)
    for name in ("plan", "came", "late"):
        table.add_column(name, justify="right", no_wrap=True, min_width=5)
    for points in _window(_rows(block.points), height - 1) if block else ():
        first = points[0]
        came, late = first.realised is not None, first.slip
        noticed = late is not None and abs(late) >= NOTICED
        table.add_row(
            Text(
                printable(f"{first.behavior}: {', '.join(point.sync for point in points)}"),
                style="" if came else "dim",
            ),
            wording.number(first.planned),
            Text(wording.number(first.realised), style="green" if came else "dim"),
            Text(wording.number(late, sign=True), style="yellow" if noticed else "dim"),
        )
    # Foreign ids are shown as Text, so that brackets in them are not read as markup.
    title = Text(printable(f"{block.id}: {block.status or 'running'}") if block else "the robot does nothing yet")
    return _panel(_LastLines(table, height), title)


def _rows(points: Iterable[PointInView]) -> list[list[PointInView]]:
    """Group the points of one behavior that are the same instant into rows."""
    rows: list[list[PointInView]] = []
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


def _window(rows: list[list[PointInView]], shown: int) -> list[list[PointInView]]:
    """Choose the newest realised rows and the next planned ones, by time."""
    came = sorted((row for row in rows if row[0].realised is not None), key=lambda row: row[0].realised or 0.0)
    to_come = [row for row in rows if row[0].realised is None]
    to_come.sort(key=lambda row: inf if row[0].planned is None else row[0].planned)
    ahead = min(len(to_come), max(min(AHEAD, shown // 2), shown - len(came)))
    behind = shown - ahead
    return [*(came[-behind:] if behind else ()), *to_come[:ahead]]


def _events(scene: Scene, width: int, height: int) -> RenderableType:
    """Table of the newest connection events, the last one at the end. A narrow one has no column for the cause."""
    narrow, wide = width < SMALL[0] - 2 * FRAME, width >= WIDE - 2 * FRAME
    table = Table(box=None, expand=True, pad_edge=False, padding=(0, 1, 0, 0))
    for name, least in (("", 1), ("at", 6), ("event", 13), ("who", 11), ("about", 5), ("why", 5), ("outcome", 9)):
        if not (narrow and name == "why"):
            # The last column gets the rest of the width; if it would be cut, the objects get less instead.
            ratio = 1 if name == ("outcome" if wide else "about") else None
            most = None if wide or name != "outcome" else 10 if narrow else 17
            table.add_column(name, no_wrap=True, overflow="ellipsis", min_width=least, max_width=most, ratio=ratio)
    for row in scene.events[-max(1, height - 1) :]:
        *cells, why, outcome = _event(row, scene)
        table.add_row(*cells, *(() if narrow else (why,)), outcome)
    return _LastLines(table, height)


def _event(row: EventInView, scene: Scene) -> tuple[RenderableType, ...]:
    event = row.event
    mark, style = MARKS[event.state]
    return (
        Text(mark, style=style),
        Text(wording.clock(row.began - scene.began), style="dim"),
        Text(wording.KINDS[event.kind], style="bold" if event.state == "started" else ""),
        Text(printable(f"{event.initiator}→{event.responder}")),
        Text(printable(", ".join(event.objects))),
        Text(event.cause, style="dim"),
        Text(wording.decision(event), style=style),
    )
