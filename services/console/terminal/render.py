"""Drawing of a scene with Rich, as large as the terminal. No state: the same scene gives the same picture."""

from rich.console import Console, ConsoleOptions, Group, RenderableType, RenderResult
from rich.segment import Segment
from rich.table import Table
from rich.text import Text

from engage_hri.schemas.behaviors import EVENT_KINDS
from engage_hri.schemas.body_faults import words
from engage_hri.schemas.text import printable
from engage_hri.services.console import wording
from engage_hri.services.console.view import Actor, EventInView, Scene

HEIGHT = 30
"""Lines of the picture if the height of the terminal is unknown."""
NARROW = 72
"""Columns below which connection events are shown without their cause."""
WIDE = 100
"""Columns from which a connection event needs no cutting."""
WORDS = 6
"""Most lines of words: connection events get the rest."""
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
    """Draw the live view. width, height: of the terminal, in columns and lines; all of it is used.

    It shows who is here and what they do, the last words, and the connection events: what a visitor asks first.
    When each behavior comes, and the nets, are for the window, which has the room.
    """
    height = height or HEIGHT
    notes = [
        Text(printable(f"! {note}"), style="yellow", no_wrap=True, overflow="ellipsis")
        for note in scene.notes[-max(1, height // 8) :]
    ]
    height -= len(notes)
    people = _people(scene)[: max(1, height // 4)]
    rest = height - 1 - len(people)
    words = min(WORDS, rest // 3)
    return Group(_title(scene), *people, _said(scene, words), _events(scene, width, rest - words), *notes)


def _title(scene: Scene) -> Text:
    mtbce = scene.session.mtbce if scene.session else None
    often = "" if mtbce is None else f"; connection events: one every {wording.seconds(mtbce)}"
    text = f"engage {wording.clock(scene.now - scene.began)}{often}"
    return Text(text, style="bold", no_wrap=True, overflow="ellipsis")


def _style(scene: Scene, actor: str) -> str:
    return "cyan" if actor == scene.robot else "magenta"


def _people(scene: Scene) -> list[Text]:
    """Lines for all actors, the robot first, then one for the owner of its head, and one for the faults that are on
    and for what is held."""
    actors = sorted(scene.actors.values(), key=lambda actor: actor.id != scene.robot)
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
        verb, target = wording.action_words(action.action, action.targets, scene.robot, one_of=action.one_of)
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


def _events(scene: Scene, width: int, height: int) -> RenderableType:
    """Table of the newest connection events, the last one at the end. A narrow one has no column for the cause."""
    narrow, wide = width < NARROW, width >= WIDE
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
        Text(EVENT_KINDS[event.kind].title, style="bold" if event.state == "started" else ""),
        Text(printable(f"{event.initiator}→{event.responder}")),
        Text(printable(wording.together(event.objects, one_of=event.one_of) if event.objects else "")),
        Text(event.cause, style="dim"),
        Text(wording.decision(event), style=style),
    )
