"""Draw a scene with rich. No state: the same scene gives the same picture."""

from rich import box
from rich.console import Group, RenderableType
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from services.console import wording
from services.console.view import BlockInView, EventInView, Point, Scene

POINTS_SHOWN = 11
UTTERANCES_SHOWN = 5
EVENTS_SHOWN = 8
STATE_STYLES = {
    "started": "yellow",
    "succeeded": "green",
    "completed": "green",
    "failed": "red",
    "preempted": "dim",
    "withdrawn": "dim",
    "superseded": "dim",
}


def render(scene: Scene) -> RenderableType:
    """The whole live view, some 30 lines high."""
    upper = Table.grid(expand=True)
    upper.add_column(ratio=1)
    upper.add_column(ratio=1)
    upper.add_row(Group(_people(scene), _said(scene)), _points(scene))
    parts: list[RenderableType] = [upper, _events(scene)]
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
        doing = Text("looks ") + Text(wording.look(look.targets, scene.robot) if look else "around", style="bold")
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
    return Panel(table, title=title, title_align="left", box=box.ROUNDED, height=7)


def _said(scene: Scene) -> Panel:
    lines = []
    for utterance in scene.said[-UTTERANCES_SHOWN:]:
        style = "cyan" if utterance.actor == scene.robot else "magenta"
        text = Text(f"{utterance.actor}: ", style=style)
        text.append(utterance.text or "…", style="" if utterance.open else "dim")
        if utterance.open:
            text.append("▌", style="blink")
        lines.append(text)
    return Panel(Group(*lines), title="said", title_align="left", box=box.ROUNDED, height=POINTS_SHOWN - 3)


def _points(scene: Scene) -> Panel:
    block = scene.block
    table = Table(box=None, expand=True, pad_edge=False)
    table.add_column("sync point", no_wrap=True, overflow="ellipsis", ratio=1)
    for name in ("planned", "realised", "slip"):
        table.add_column(name, justify="right", no_wrap=True)
    for point in _window(block) if block else ():
        came = point.realised is not None
        slip = point.slip
        late = slip is not None and abs(slip) >= 0.05
        table.add_row(
            Text(f"{point.behavior}:{point.sync}", style="" if came else "dim"),
            wording.seconds(point.planned),
            Text(wording.seconds(point.realised), style="green" if came else "dim"),
            Text(wording.seconds(slip, sign=True), style="yellow" if late else "dim"),
        )
    # Ids are other people's: as Text, so that brackets in them are not read as markup.
    title = Text(f"block {block.id} {block.status or 'running'}" if block else "no block yet")
    return Panel(table, title=title, title_align="left", box=box.ROUNDED, height=POINTS_SHOWN + 4)


def _window(block: BlockInView) -> list[Point]:
    """The newest realised points and the next planned ones, by time."""
    came = sorted((p for p in block.points if p.realised is not None), key=lambda p: p.realised or 0.0)
    later = (p.planned for p in block.points if p.planned is not None)
    horizon = max(later, default=0.0)
    to_come = sorted(
        (p for p in block.points if p.realised is None), key=lambda p: horizon if p.planned is None else p.planned
    )
    ahead = min(len(to_come), max(4, POINTS_SHOWN - len(came)))
    return [*came[-(POINTS_SHOWN - ahead) :], *to_come[:ahead]] if ahead < POINTS_SHOWN else to_come[:ahead]


def _events(scene: Scene) -> Panel:
    table = Table(box=None, expand=True, pad_edge=False)
    for name in ("at", "connection event", "who", "about", "cause"):
        table.add_column(name, no_wrap=True, overflow="ellipsis")
    table.add_column("outcome", no_wrap=True, ratio=1)
    for row in scene.events[-EVENTS_SHOWN:]:
        table.add_row(*_event(row, scene))
    return Panel(table, title="connection events", title_align="left", box=box.ROUNDED, height=EVENTS_SHOWN + 3)


def _event(row: EventInView, scene: Scene) -> tuple[RenderableType, ...]:
    event = row.event
    return (
        wording.clock(row.began - scene.began),
        Text(wording.KINDS[event.kind]),
        Text(f"{event.initiator} → {event.responder}"),
        Text(wording.names(event.objects)),
        Text(event.cause),
        Text(wording.decision(event), style=STATE_STYLES[event.state]),
    )
