"""A program for a tree that has shared laughter: it shows where the new kind comes to, as JSON on standard output.

`python -m tests.recognition.laughing` in that tree; see test_new_kind.py.
"""

import asyncio
import io
import json
from collections.abc import Iterator
from typing import Any

from rich.console import Console

from engage_hri import embedded, perceive
from engage_hri.schemas.perception import ActionBegan
from engage_hri.schemas.recognition import Statistics
from engage_hri.services.commandline.look import watch
from engage_hri.services.console import view
from engage_hri.services.console.terminal import log as terminal_log
from engage_hri.services.console.terminal import render, tally
from engage_hri.services.console.terminal.log import Telling
from engage_hri.services.console.web import server
from engage_hri.services.control.testing.plugin import virtual_loop
from engage_hri.services.study import summary
from tests.recognition.observations import HUMAN, ROBOT, Log, stamp

LAUGHTER: Any = "shared_laughter"
LAUGH: Any = "laugh"
BLOCK = """
<bml id="joke" xmlns="http://www.bml-initiative.org/bml/bml-1.0" xmlns:ebml="edu.wpi.ebml">
  <ebml:event id="together" kind="shared_laughter" responder="ann"/>
</bml>
"""


def told(log: Log) -> list[str]:
    """Changes of all events, and answers of requests."""
    events = [
        f"{event.id} {event.initiator} {event.state} {event.at.seconds:g}"
        + ("" if event.delay is None else f" delay {event.delay:g}")
        + ("" if event.duration is None else f" lasting {event.duration:g}")
        for event in log.events
    ]
    return events + [f"answer: {outcome.state}" for outcome in log.outcomes]


def plays() -> Iterator[tuple[str, Log]]:
    """Small sessions, with what happens in each."""
    log = Log()
    log.begins(HUMAN, LAUGH, 1.0)
    log.begins(ROBOT, LAUGH, 1.5)
    log.ends(HUMAN, LAUGH, 3.0)
    log.ends(ROBOT, LAUGH, 3.5)
    yield "the person begins", log

    log = Log()
    log.begins(ROBOT, LAUGH, 1.0)
    log.begins(HUMAN, LAUGH, 1.25)
    log.ends(ROBOT, LAUGH, 2.0)
    yield "the robot begins", log

    log = Log()
    log.begins(HUMAN, LAUGH, 1.0)
    log.until(10.0)
    yield "nobody joins in", log

    log = Log(HUMAN, "ben")
    log.looks(HUMAN, "ben", 0.5)
    log.begins(HUMAN, LAUGH, 1.0)
    yield "it is to somebody else", log

    log = Log()
    log.requests_event(LAUGHTER, 1.0)
    log.begins(HUMAN, LAUGH, 2.0)
    log.lost(HUMAN, 2.5)
    log.until(10.0)
    yield "it is asked for, and the person goes", log

    log = Log()
    log.begins(HUMAN, LAUGH, 1.0)
    log.requests_event(LAUGHTER, 1.5)
    yield "the person laughs already", log

    log = Log()
    log.cancels(log.requests_event(LAUGHTER, 1.0), 1.5)
    log.requests_event(LAUGHTER, 2.0, limit=1.0)
    log.until(10.0)
    yield "it is asked for in vain", log


async def on_the_bus() -> dict[str, object]:
    """A block asks for it, and a person who is perceived joins in."""
    async with embedded(human="none") as robot, perceive("ann", hub=robot.hub) as ann:
        await ann.look_at(ann.robot)
        with robot.connection_events("ann", LAUGHTER, open=True) as events:
            performing = asyncio.create_task(robot.realize(BLOCK))
            first = await anext(aiter(events))
            open_then = [event.kind for event in events.open]
            ann.begin(LAUGH)
            states = [first.state, (await anext(aiter(events))).state]
            ann.end(LAUGH)
            states.append((await anext(aiter(events))).state)
            await performing
        await asyncio.sleep(2.0)
        statistics = await robot.statistics("ann")
    return {"states": states, "open": open_then, "counted": _counted(statistics)}


def _counted(statistics: Statistics) -> list[object]:
    return [[each.kind, each.count, each.succeeded] for each in statistics.session.kinds if each.kind == LAUGHTER]


def shown() -> dict[str, object]:
    """What people see of it."""
    scene, tallied, lines = view.empty(ROBOT, 0.0), tally.empty(0.0), []
    beginning = ActionBegan(actor=HUMAN, action=LAUGH, at=stamp(1.0), targets=(ROBOT,))
    _, log = next(plays())
    for message in (beginning, *log.events):
        before, scene = scene, view.feed(scene, message, message.at.seconds)
        tallied = tally.feed(tallied, message, message.at.seconds)
        line = terminal_log.line(message, before, scene, message.at.seconds, Telling())
        lines.append("" if line is None else line.strip())
    watch.Wanted(kinds=(LAUGHTER,)).check()
    return {
        "log": lines,
        "tally": "shared laughter" in _drawn(tally.render(tallied, ROBOT)),
        "live view": "shared laughter" in _drawn(render.render(scene)),
        "window": "shared laughter" in server.page_of(ROBOT),
        "study": f"{LAUGHTER}_count" in summary.sessions_csv([]) and LAUGHTER in summary.RESPONDED,
    }


def _drawn(picture: Any) -> str:
    console = Console(file=io.StringIO(), width=100)
    console.print(picture)
    return console.file.getvalue()  # type: ignore[attr-defined, no-any-return]


if __name__ == "__main__":
    with asyncio.Runner(loop_factory=virtual_loop) as runner:
        bus = runner.run(on_the_bus())
    print(json.dumps({"plays": {name: told(log) for name, log in plays()}, "bus": bus, "shown": shown()}))
