"""Replay on a bus: listeners get what they would have got, late ones too, and no live robot is disturbed."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault, InputRefused, RunFailed
from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.schemas.recognition import ConnectionEvent
from engage_hri.schemas.units import Stamp
from engage_hri.services.bus.interface import Hub, Received, Sample
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.commandline.study.replay import control_of, keys_in
from engage_hri.services.console.follow import following
from engage_hri.services.recording.player import Playback
from engage_hri.services.recording.reading import Recording, moved
from engage_hri.services.recording.replay import Control, ReplayBus, replay
from tests.recording.conftest import Anchor
from tests.recording.files import recording, sample


@asynccontextmanager
async def replaying(
    hub: MemoryHub, recording: Recording, *, speed: float = 1.0, begin: float = 0.0, commands: bool = False
) -> AsyncIterator[tuple[Playback, "asyncio.Queue[Control]", "asyncio.Task[None]"]]:
    async def same() -> Hub:
        return hub

    player = Playback(recording, asyncio.get_running_loop().time(), speed=speed)
    controls: asyncio.Queue[Control] = asyncio.Queue()
    stage = ReplayBus(player, same, commands=commands, owns=False)
    task = asyncio.create_task(replay(stage, player, controls, begin=begin))
    try:
        yield player, controls, task
    finally:
        task.cancel()
        await asyncio.wait([task])


def faults(number: int, key: str = "there") -> list[Sample]:
    """A message a second, of somebody who is there."""
    alive = sample(keys.alive(key), PeerAlive(participant=key, run="r"), 0.0, source=key, life="")
    said = [
        sample(keys.fault(key), Fault(reason=str(at)), float(at), source=key, life="r", number=at + 1)
        for at in range(number)
    ]
    states = [
        sample(keys.HEAD_OWNER, Fault(reason=f"state {at}"), at + 0.5, source=key, life="r", number=100 + at)
        for at in range(number)
    ]
    return [alive, *sorted([*said, *states], key=lambda one: one.at)]


async def test_a_whole_task_comes_again_message_for_message(anchor: Anchor) -> None:
    told = [(repr(type(message)), at) for message, at in anchor.told if _is_event(message)]
    original = anchor.recording
    again: list[tuple[str, float]] = []

    async with MemoryHub() as hub:
        inbox = hub.join("viewer").subscribe(keys.of_class("evt"), keys.of_class("state"), capacity=10**6)
        began = asyncio.get_running_loop().time()
        sink = lambda m, at: again.append((repr(type(m)), at - began)) if _is_event(m) else None  # noqa: E731
        async with following(hub.join("console"), [sink]), replaying(hub, original, speed=10.0) as (_, _, task):
            await task
        inbox.close()
        heard = [one async for one in inbox if one.source != "replay"]

    kept = [one for number in range(len(original)) if (one := original.received(number)) is not None]
    wanted = [one for one in kept if keys.key_class(one.key) in ("evt", "state") and one.source]
    assert [(one.key, one.source, _timeless(one)) for one in heard] == [
        (one.key, one.source, _timeless(one)) for one in wanted
    ]
    assert [name for name, _ in again] == [name for name, _ in told]
    assert [at for _, at in again] == pytest.approx([at / 10.0 for _, at in told], abs=1e-3)


def _is_event(message: object) -> bool:
    return isinstance(message, ConnectionEvent)


def _timeless(one: Received) -> object:
    return moved(one.message, lambda stamp: Stamp("", 0.0))


async def test_speed_pause_and_place_hold_on_the_bus() -> None:
    async with MemoryHub() as hub:
        bus = hub.join("viewer")
        inbox = bus.subscribe(keys.fault("there"))
        async with replaying(hub, recording(faults(9)), speed=2.0) as (player, controls, _):
            began = bus.now()
            first = [(one.message.reason, one.at - began) for one in [await inbox.next() for _ in range(3)] if one]  # type: ignore[union-attr]
            assert first == [("0", 0.0), ("1", 0.5), ("2", 1.0)]

            controls.put_nowait(_control(b" "))
            assert await inbox.next(began + 60.0) is None
            controls.put_nowait(_control(b" "))
            later = await inbox.next()

            assert later is not None
            assert later.at - began == pytest.approx(60.5)
            assert player.speed == 2.0


def _control(pressed: bytes) -> Control:
    control = control_of(pressed)
    assert control is not None
    return control


@pytest.mark.parametrize(
    ("came", "expected"),
    [
        (b"\x1b[C\x1b[C\x1b[D", [b"\x1b[C", b"\x1b[C", b"\x1b[D"]),
        (b" \x1b[A0q", [b" ", b"\x1b[A", b"0", b"q"]),
        (b"\x1bOA", [b"\x1b[A"]),
        (b"\x1b[1;5C\x1b[3~ ", [b"\x1b[1;5C", b"\x1b[3~", b" "]),
        (b"\xff\n\x1b", [b"\xff", b"\n", b"\x1b"]),
    ],
)  # fmt: skip
def test_keys_that_come_at_once_as_when_one_is_held_down_are_all_taken(came: bytes, expected: list[bytes]) -> None:
    assert keys_in(came) == expected


async def test_a_jump_is_a_restart_for_listeners_who_get_what_stood_then() -> None:
    async with MemoryHub() as hub:
        bus = hub.join("viewer")
        inbox = bus.subscribe(keys.alive("there"), keys.HEAD_OWNER, keys.fault("there"))
        async with replaying(hub, recording(faults(20)), begin=8.25) as (_, controls, _):
            assert await _next(inbox, 4) == ["here", "state 7", "state 8", "9"]

            controls.put_nowait(_control(b"\x1b[D"))

            assert await _next(inbox, 5) == ["gone", "here", "state 3", "4", "state 4"]


async def _next(inbox: object, count: int) -> list[str]:
    found = []
    for _ in range(count):
        one = await inbox.next()  # type: ignore[attr-defined]
        match one.message:
            case PeerAlive():
                found.append("here")
            case PeerGone():
                found.append("gone")
            case Fault(reason=reason):
                found.append(reason)
    return found


async def test_who_comes_in_the_middle_gets_the_state_of_then() -> None:
    async with MemoryHub() as hub, replaying(hub, recording(faults(20))):
        await asyncio.sleep(7.75)

        late = hub.join("late").subscribe(keys.HEAD_OWNER, keys.ANY_ALIVE)

        received = [await late.next() for _ in range(2)]
        told = {type(one.message).__name__: one for one in received if one is not None}
        assert told["Fault"].message == Fault(reason="state 7")
        assert told["Fault"].past
        assert told["PeerAlive"].source == "there"


async def test_a_participant_that_goes_takes_its_states_along() -> None:
    gone = sample(keys.alive("there"), PeerGone(participant="there"), 6.0, source="there", life="")
    after = sample(keys.fault("other"), Fault(reason="x"), 60.0, source="other", life="s")
    async with MemoryHub() as hub, replaying(hub, recording([*faults(5), gone, after])):
        await asyncio.sleep(10.0)

        late = hub.join("late").subscribe(keys.HEAD_OWNER)

        assert await late.next(asyncio.get_running_loop().time() + 1.0) is None


async def test_commands_are_said_only_if_they_are_asked_for() -> None:
    command = sample(keys.command(keys.BLOCK, "manager", "there"), Fault(reason="move"), 1.0)
    for asked in (False, True):
        async with MemoryHub() as hub:
            inbox = hub.join("viewer").subscribe(keys.of_class("cmd"))
            async with replaying(hub, recording([command]), commands=asked) as (_, _, task):
                await task
            inbox.close()

            assert len([one async for one in inbox]) == asked


class Occupied(MemoryHub):
    """A bus on which a robot lives, as it is on real sockets."""

    async def wait_until_free(self, *names: str) -> None:
        if taken := sorted(set(names) & set(self.alive)):
            raise InputRefused(Fault(reason="has this on the bus already", where=taken[0]))


async def test_a_live_robot_of_that_name_is_left_alone() -> None:
    async with Occupied() as hub:
        hub.join("control").declare_alive()
        async with replaying(hub, recording(faults(3))) as (_, _, task):
            with pytest.raises(InputRefused, match="control: has this on the bus already"):
                await task


async def test_a_replay_leaves_as_soon_as_a_live_robot_comes() -> None:
    async with MemoryHub() as hub, replaying(hub, recording(faults(30))) as (_, _, task):
        await asyncio.sleep(5.0)
        control = hub.join("control")
        control.declare_alive()

        with pytest.raises(RunFailed, match="a live control has come"):
            await task
        assert hub.alive == ("control",)
