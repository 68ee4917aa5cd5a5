"""The window: follows the bus, keeps the picture, and shows it to browsers.

Each browser gets a frame, draws it, says so, and gets the next one: a slow one misses frames and slows nothing.
"""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from itertools import count

from engage_hri.schemas import keys
from engage_hri.schemas.body import Capabilities, DescribeBody
from engage_hri.schemas.faults import EngageError
from engage_hri.schemas.messages import Message
from engage_hri.schemas.participants import AskStatus, PeerAlive, PeerGone, Status
from engage_hri.schemas.perception import OngoingActions
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus, Hub, Subscription
from engage_hri.services.client.robot import Robot
from engage_hri.services.console.follow import FOLLOWED, following
from engage_hri.services.console.web.health import NOTABLE
from engage_hri.services.console.web.orders import Script
from engage_hri.services.console.web.picture import Picture
from engage_hri.services.console.web.seats import Invitation, Seats, invitation

PATTERNS = (
    *FOLLOWED, keys.ANY_ALIVE, keys.WORLD, keys.ROBOT_STATE, keys.ROBOT_MOTION, keys.NET, keys.ROBOT_ONGOING,
    keys.ANY_PERCEIVED_ONGOING, keys.settings("hearing"),
)  # fmt: skip
"""Expressions for all that the window shows."""
ASKED_EVERY: Seconds = 3.0
"""Time between two questions for the status of all services, while somebody looks."""
PATIENCE: Seconds = 1.0
"""Time that they have to answer."""


class WindowServer:
    """The picture of a robot's bus, kept up to date, and what people need who take part.

    keyed: its role is that of its keys. viewers: number of browsers; while there is none, services are not asked how
    they are. listeners: what gets each message.
    """

    def __init__(
        self, hub: Hub, bus: Bus, robot: Robot, script: Script, *, keyed: bool = False, began: Seconds | None = None
    ) -> None:
        self.hub = hub
        self.keyed = keyed
        self.bus = bus
        self.robot = robot
        self.script = script
        self.picture = Picture(bus.robot, bus.now() if began is None else began)
        self.seats = Seats()
        self.viewers = 0
        self.listeners: set[Callable[[Message], None]] = set()
        self._here: set[str] = set()
        self._numbers = count(1)

    def __call__(self, message: Message, at: Seconds) -> None:
        """Take a message. at: its local instant."""
        self.seats.feed(message)
        match message:
            case PeerAlive(participant=name):
                self._here.add(name)
            case PeerGone(participant=name):
                self._here.discard(name)
        self.picture.feed(message, at, self.bus.now())
        for listener in self.listeners:
            listener(message)

    @property
    def seconds(self) -> Seconds:
        """Seconds of the picture now."""
        return self.picture.zero(self.bus.now())

    @property
    def invitation(self) -> Invitation:
        """Invitation to who may sit down."""
        return invitation(self.picture.present, self.picture.reporters, self._here)

    async def note_reporters(self, reports: Subscription) -> None:
        """Note who tells of whom, until the subscription is closed."""
        async for received in reports:
            if isinstance(received.message, OngoingActions):
                self.picture.note_reporter(received.message.actor, keys.reporter_of(received.key), self.bus.now())

    def new_id(self) -> str:
        """Make an id for a fragment that somebody makes at the page."""
        return f"by-hand-{self.bus.run[:4]}-{next(self._numbers)}"

    def log(self, text: str) -> None:
        """Write what somebody has ordered to the log, and show it to all who look."""
        self.bus.log.info("%s", text)
        self.picture.note(text, self.bus.now())

    def warn(self, text: str) -> None:
        """Show all who look a warning that no message tells."""
        self.picture.note(text, self.bus.now(), "warning")

    async def look_after(self) -> None:
        """Ask the services how they are, again and again, and the body once what it is; until cancelled."""
        described = False
        while True:
            if self.viewers:
                await self._ask()
            if not described and "control" in self._here:
                described = await self._describe()
            await asyncio.sleep(ASKED_EVERY if described or "control" not in self._here else PATIENCE)

    async def _ask(self) -> None:
        there = [name for name in NOTABLE if name in self._here]
        answers = await asyncio.gather(
            *(self.bus.query(keys.status(name), AskStatus(), PATIENCE) for name in there), return_exceptions=True
        )
        silent = set()
        for name, answer in zip(there, answers, strict=True):
            if isinstance(answer, Status):
                self.picture.feed(answer, self.bus.now(), self.bus.now())
            elif isinstance(answer, EngageError):
                silent.add(name)
            elif isinstance(answer, BaseException):
                raise answer
        self.picture.silence(frozenset(silent), self.bus.now())

    async def _describe(self) -> bool:
        try:
            body = await self.bus.query(keys.DESCRIBE, DescribeBody(), PATIENCE)
        except EngageError:
            return False
        if isinstance(body, Capabilities):
            self.picture.feed(body, self.bus.now(), self.bus.now())
        return True


@asynccontextmanager
async def window(
    hub: Hub, bus: Bus, script: Script, *, keyed: bool = False, began: Seconds | None = None
) -> AsyncIterator[WindowServer]:
    """Follow the bus while the body of `async with` runs. bus: the window's own, with its role.

    keyed: the role is that of its keys. began: the instant of this machine that counts as zero; None: now.
    """
    async with Robot.on(bus) as robot:
        shown = WindowServer(hub, bus, robot, script, keyed=keyed, began=began)
        async with following(bus, (shown,), patterns=PATTERNS):
            with bus.subscribe(keys.ANY_PERCEIVED_ONGOING) as reports:
                looking = asyncio.create_task(shown.look_after(), name="status")
                noting = asyncio.create_task(shown.note_reporters(reports), name="who tells of whom")
                try:
                    yield shown
                finally:
                    looking.cancel()
                    noting.cancel()
                    await asyncio.wait([looking, noting])
