"""Replay of a recording on a bus: its participants come, say what they said, and go, each under its own name.

Instants in the messages are moved to the clock of the replay, so that readers see what they would have seen then.
Commands stay away, unless they are asked for: a robot that heard them would move.
"""

import asyncio
from collections.abc import Awaitable, Callable, Iterable

from engage_hri.schemas import keys
from engage_hri.schemas.access import PARTICIPANTS
from engage_hri.schemas.faults import Fault, RunFailed
from engage_hri.schemas.messages import Message
from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.bus.interface import Bus, Hub, Received, Sample, Subscription
from engage_hri.services.recording.player import Playback, readable
from engage_hri.services.recording.reading import RecordingTimes, moved

NAME = "replay"
"""Name of the participant that says what programs without a name said, and watches for a live robot."""
Open = Callable[[], Awaitable[Hub]]
Control = Callable[[Playback, Seconds], Seconds | None]
"""What somebody wants of the player: done to it, or a time to go to that is returned."""


class ReplayBus:
    """The bus on which it plays. unread: messages that nobody can read, and that are left out."""

    def __init__(self, player: Playback, open: Open, *, commands: bool = False, owns: bool = True) -> None:
        """open: opens a hub. owns: the hub is closed with the stage. commands: say those, too."""
        self.unread = 0
        self._player = player
        self._times = RecordingTimes(player.timeline.recording)
        self._open = open
        self._owns = owns
        self._commands = commands
        self._hub: Hub | None = None
        self._buses: dict[str, Bus] = {}
        self._own: set[str] = set()
        """Lives of the replay itself, those that have gone, too."""
        self._runs: dict[str, str] = {}
        """Recorded life of each participant that is there."""
        self._states: dict[str, set[str]] = {}
        """Keys of the states of each recorded life."""
        self._answers: set[str] = set()

    async def begin(self) -> None:
        """Come to the bus. Raises InputRefused: a live robot of this name is there."""
        self._hub = await self._open()
        await self._hub.wait_until_free(*keys.SERVICES)
        self._of(NAME)

    async def end(self) -> None:
        """Leave the bus: for those who listen the robot has gone."""
        for bus in self._buses.values():
            await bus.leave()
        self._buses, self._runs, self._states = {}, {}, {}
        self._answers = set()
        if self._hub is not None and self._owns:
            await self._hub.close()
        self._hub = None

    @property
    def bus(self) -> Bus:
        return self._buses[NAME]

    def is_own(self, run: str) -> bool:
        """True for a life of the replay itself."""
        return run in self._own

    async def say(self, samples: Iterable[Sample]) -> None:
        """Say these messages now."""
        samples = list(samples)
        read = list(readable(samples))
        self.unread += len(samples) - len(read)
        for received in read:
            await self._say(received)

    async def _say(self, received: Received) -> None:
        kind, message = keys.key_class(received.key), received.message
        match message:
            case PeerAlive(participant=name, run=run):
                self._runs[name] = run
                self._of(name).declare_alive()
            case PeerGone(participant=name):
                await self._go(name)
            case _ if kind == "rpc":
                self._answer(received)
            case _ if kind != "alive" and (kind != "cmd" or self._commands):
                told: Message = moved(message, lambda stamp: self._instant(stamp, received.at))
                if kind == "state":
                    self._states.setdefault(received.life, set()).add(received.key)
                self._of(received.source).publish(received.key, told)

    def _of(self, name: str) -> Bus:
        name = name or NAME
        if name not in self._buses:
            assert self._hub is not None
            self._buses[name] = self._hub.join(name, PARTICIPANTS.get(name, "perception"))
            self._own.add(self._buses[name].run)
        return self._buses[name]

    async def _go(self, name: str) -> None:
        run = self._runs.pop(name, "")
        if run and run not in self._runs.values():
            self.bus.withdraw(*self._states.pop(run, ()))
        if (bus := self._buses.pop(name, None)) is not None:
            await bus.leave()

    def _answer(self, received: Received) -> None:
        """Answer a question as it was answered then."""
        if received.key not in self._answers:
            self._answers.add(received.key)
            self._of(received.source).answer(received.key, lambda question: received.message)

    def _instant(self, stamp: Stamp, told_at: Seconds) -> Stamp:
        """The same instant by the clock of the replay, as fast as it plays now."""
        bus, player = self.bus, self._player
        now = bus.now()
        recording = player.timeline.recording
        at = self._times.at(stamp, told_at - recording.began)
        return bus.stamp(now if at is None else now + (at - player.at(now)) / player.speed)


async def replay(
    stage: ReplayBus, player: Playback, controls: "asyncio.Queue[Control]", *, begin: Seconds = 0.0
) -> None:
    """Play to the end. begin: time in the recording to begin at.

    To go to another time is a restart of the robot, for all who listen: they get what stands then. Raises
    InputRefused or RunFailed: a live robot of this name is there, or comes.
    """
    goal: Seconds | None = begin
    while goal is not None:
        await stage.begin()
        try:
            goal = await _play(stage, player, controls, goal)
        finally:
            await stage.end()


async def _play(
    stage: ReplayBus, player: Playback, controls: "asyncio.Queue[Control]", begin: Seconds
) -> Seconds | None:
    """Play from a time on, until the end, or until it is to go to another time, which is returned."""
    playing = asyncio.create_task(_say_what_is_due(stage, player, controls, begin), name="playing")
    with stage.bus.subscribe(keys.ANY_ROBOT_ALIVE) as presence:
        watching = asyncio.create_task(_watch(stage, presence), name="live robot")
        try:
            await asyncio.wait((playing, watching), return_when=asyncio.FIRST_COMPLETED)
        finally:
            is_over = playing.done()
            for task in (playing, watching):
                task.cancel()
            await asyncio.wait((playing, watching))
    if not is_over:
        watching.result()
    return playing.result()


async def _say_what_is_due(
    stage: ReplayBus, player: Playback, controls: "asyncio.Queue[Control]", begin: Seconds
) -> Seconds | None:
    loop = asyncio.get_running_loop()
    await stage.say(player.seek(begin, loop.time()))
    while True:
        await stage.say(player.advance(loop.time()))
        if player.is_over:
            return None
        try:
            async with asyncio.timeout_at(player.deadline):
                goal = (await controls.get())(player, loop.time())
            if goal is not None:
                return goal
        except TimeoutError:
            pass


async def _watch(stage: ReplayBus, presence: Subscription) -> None:
    """Raise RunFailed as soon as a live robot comes."""
    async for received in presence:
        match received.message:
            case PeerAlive(participant=name, run=run) if name in keys.SERVICES and not stage.is_own(run):
                reason = f"a live {name} has come: the replay has left"
                raise RunFailed(
                    Fault(reason=reason, where=stage.bus.robot, advice="give one of them another --robot")
                )
