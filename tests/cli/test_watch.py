"""`engage watch`, the client and the plain example beside a recognition of its own process, over real sockets.

The test itself is the body and the perception of the robot.
"""

import asyncio
import json
import sys
from asyncio.subprocess import PIPE, Process
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any, NamedTuple, get_args

import pytest

from engage_hri.schemas import keys, messages
from engage_hri.schemas.blocks import Fired, NetMarked, NetPlace, NetPlanned, NetPoint, NetTransition
from engage_hri.schemas.perception import ActionBegan, ActionEnded
from engage_hri.schemas.recognition import ConnectionEvent
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.zenoh.hub import open_hub
from engage_hri.services.client.feeds import EventFeed
from engage_hri.services.client.robot import Robot, connect
from tests.bus.places import free_endpoint
from tests.cli.command import engage, start
from tests.cli.test_processes import PATIENCE, line, stopped

pytestmark = pytest.mark.real_time

EXAMPLE = Path(__file__).parents[2] / "examples" / "plain_zenoh_events.py"
MUTUAL = "mutual_facial_gaze"


class Scene(NamedTuple):
    """A recognition that runs by itself, our place on its bus, where that is, and how recognition is set."""

    recognition: list[Process]
    robot: Robot
    body: Bus
    where: tuple[str, ...]
    settings: tuple[str, ...] = ()

    def look(self, actor: str, target: str) -> None:
        key = keys.ROBOT_ACTION if actor == self.body.robot else keys.PERCEIVED_ACTION
        began = ActionBegan(actor=actor, action="look", at=self.body.stamp(), targets=(target,))
        self.body.publish(key, began)

    def look_away(self, actor: str) -> None:
        ended = ActionEnded(actor=actor, action="look", at=self.body.stamp())
        self.body.publish(keys.PERCEIVED_ACTION, ended)

    async def recognize(self) -> None:
        """Start another one."""
        self.recognition.append(await start("run", "recognition", *self.where, *self.settings))
        await line(self.recognition[-1], "recognition is ready")


@asynccontextmanager
async def scene(robot: str, endpoint: str, *settings: str) -> AsyncIterator[Scene]:
    async with await open_hub(robot, listen=[endpoint]) as hub, connect(hub=hub) as client:
        where = ("--robot", robot, "--connect", endpoint)
        made = Scene([], client, hub.join("control"), where, settings)
        try:
            await made.recognize()
            yield made
        finally:
            for process in made.recognition:
                await stopped(process)


@pytest.fixture
def endpoint() -> str:
    return free_endpoint()


async def heard(events: EventFeed, state: str) -> ConnectionEvent:
    while (event := await events.next(PATIENCE)) is not None:
        if event.state == state:
            return event
    raise AssertionError(f"nothing {state}")


def parsed(text: str) -> Any:
    """The line, which has exactly the keys of its message."""
    made = json.loads(text)
    (kind,) = (each for each in get_args(messages.LineMessage) if each.__struct_config__.tag == made["type"])
    assert list(made) == ["type", *kind.__struct_fields__]
    return made


async def test_late_joiners_of_all_kinds_and_the_death_of_recognition(endpoint: str) -> None:
    async with scene("seen", endpoint) as our, scene("other", free_endpoint()) as other:
        with our.robot.connection_events("ann") as early:
            for where in (our, other):
                where.look(where.body.robot, "ann")
                where.look("ann", where.body.robot)
                where.look("bob", where.body.robot)
            shared = await heard(early, "succeeded")
        command = ("watch", "--json", *our.where, "--actor", "ann", "--kind", MUTUAL)
        watch = await start(*command, "--only", "events", "--only", "statistics")
        plain = await asyncio.create_subprocess_exec(
            sys.executable, EXAMPLE, "--robot", "seen", "--actor", "ann", endpoint, stdout=PIPE, stderr=PIPE
        )
        try:
            joined = [parsed(await line(watch, "{", log=False)) for _ in range(2)]
            plain_joined = {await line(plain, "ann", log=False) for _ in range(2)}
            with our.robot.connection_events("ann", MUTUAL, open=True) as late:
                assert await late.next(PATIENCE) == shared
                our.recognition[0].kill()
                killed = our.robot.now()
                lost = await heard(late, "lost")
                waited = our.robot.now() - killed
                await our.recognize()
                our.look_away("ann")
                our.look("ann", "seen")
                again = await heard(late, "started")
            watched = [parsed(await line(watch, f'"{state}"', log=False)) for state in ("lost", "started")]
            plain_watched = [await line(plain, state, log=False) for state in (": lost", ": started")]
        finally:
            codes = [await stopped(watch), await stopped(plain)]

    assert {one["type"] for one in joined} == {"connection_event", "statistics"}
    assert [one["id"] for one in joined if "id" in one] == [shared.id]
    assert plain_joined == {"ann: engaging, 1 events\n", f"{shared.id}: {MUTUAL} of ann: succeeded after 0.00 s\n"}
    assert (lost.id, again.session != lost.session) == (shared.id, True)
    assert 2.0 <= waited < PATIENCE
    assert [one["id"] for one in watched] == [lost.id, again.id]
    assert [text.split(":")[0] for text in plain_watched] == [lost.id, again.id]
    assert codes == [0, 0]


async def test_a_reader_who_has_had_enough_ends_watch_without_a_word(endpoint: str) -> None:
    async with scene("seen", endpoint) as our:
        our.look("ann", "seen")
        watch = await start("watch", "--json", *our.where)
        assert watch.stdout is not None
        await line(watch, MUTUAL, log=False)
        watch.stdout._transport.close()  # type: ignore[attr-defined]
        our.look("bob", "seen")
        async with asyncio.timeout(PATIENCE):
            await watch.wait()
        assert watch.stderr is not None
        told = await watch.stderr.read()

    assert (watch.returncode, told) == (0, b"")


async def test_the_net_of_a_block_is_watched_as_lines_and_as_json(endpoint: str) -> None:
    transitions = tuple(NetTransition(points=(NetPoint(sync=sync),)) for sync in ("start", "end"))
    planned = (NetPlace(kind="order", source=0, target=1), NetPlace(kind="idle", source=1, target=0))
    async with await open_hub("seen", listen=[endpoint]) as hub:
        realizer = hub.join("realizer")

        def tell() -> None:
            start = NetPlanned(block="b", at=realizer.stamp(), transitions=transitions, places=planned, marked=(1,))
            fired = NetMarked(block="b", fired=(Fired(transition=0, time=0.25),), put=(0,), taken=(1,))
            realizer.publish(keys.NET, start)
            realizer.publish(keys.NET, fired)

        for form in ((), ("--json",)):
            watch = await start("watch", "--net", *form, "--robot", "seen", "--connect", endpoint)
            async with asyncio.TaskGroup() as group:
                telling = group.create_task(_again(tell))
                if form:
                    made = parsed(await line(watch, "net_planned", log=False))
                    moved = parsed(await line(watch, "net_marked", log=False))
                    assert [each["points"][0]["sync"] for each in made["transitions"]] == ["start", "end"]
                    assert (moved["fired"], moved["put"]) == ([{"transition": 0, "time": 0.25}], [0])
                else:
                    assert "b: bml:start fired at 0.25 s (planned 0.00 s)" in await line(watch, "fired", log=False)
                    assert "b: ● order from bml:start to bml:end" in await line(watch, "●", log=False)
                telling.cancel()
            assert await stopped(watch) == 0


async def _again(tell: Callable[[], None]) -> None:
    """Tell it until it is heard: nobody says when a watcher is there."""
    loop = asyncio.get_running_loop()
    while True:
        tell()
        turn = asyncio.Event()
        loop.call_later(0.2, turn.set)
        await turn.wait()


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (
            ("--kind", "gaze"),
            "--kind: unknown 'gaze' (known: directed_gaze, mutual_facial_gaze, adjacency_pair, backchannel)",
        ),
        (
            ("--only", "all"),
            "--only: unknown 'all' (known: events, statistics, words, feedback, head, holds, faults, condition)",
        ),
        (("--net", "--only", "events"), "--net: shows nets and nothing else (leave out --only, --actor and --kind)"),
        (("--actor", "a/b"), "--actor: 'a/b' can't be in a key: "),
    ],
)
def test_what_cannot_be_watched_is_refused(
    capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...], told: str
) -> None:
    result = engage(capsys)("watch", *arguments)

    assert (result.code, result.err.startswith(told), result.err.count("\n")) == (2, True, 1)
