"""The public client: what a collaboration manager needs of an engaged robot, from any process.

    async with connect(connect=["tcp/robot:7447"]) as robot:
        outcome = await robot.perform(Path("greeting.xml"))
        async for event in robot.connection_events():
            ...

It may start before the services it talks to: requests wait for them, at most `timeout` seconds where one is given.
"""

import uuid
from collections.abc import AsyncIterator, Collection, Sequence
from contextlib import asynccontextmanager
from typing import Literal, get_args

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import EventKind
from engage_hri.schemas.blocks import Feedback, Held
from engage_hri.schemas.body import WordSpoken
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.fragments import HeadOwner, TurnClosed
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, ActorLost, Utterance
from engage_hri.schemas.recognition import Floor, Interjection, Statistics
from engage_hri.schemas.tool import ToolInput
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus.config import Mode
from engage_hri.services.bus.interface import Hub, Keep
from engage_hri.services.client.event_stream import EventStream
from engage_hri.services.client.feeds import (
    ActionFeed,
    EventFeed,
    Feed,
    LevelFeed,
    NewFeed,
    StatisticsFeed,
    WorldFeed,
    first_of,
)
from engage_hri.services.client.heard import HeardFeed
from engage_hri.services.client.inputs import listed, shown, taken
from engage_hri.services.client.performing import PerformingRobot
from engage_hri.services.client.turn import RobotTurn
from engage_hri.services.client.turn_ends import EndOfTurn
from engage_hri.services.runtime.configuration import bus_config
from engage_hri.services.runtime.installation import TURN_ENDS, offers


class Robot(PerformingRobot):
    """An engaged robot, as its collaboration manager sees it. Made by `connect` or, in a service, `Robot.on(bus)`.

    Errors carry a `fault` that says where and why. Once the client has ended (its `async with` has, or it broke), all
    methods that ask or follow raise RunFailed. They are called on the event loop that made it.
    """

    def turn(
        self,
        to: str | tuple[str, ...] = "",
        *,
        id: str = "",
        interruptible: bool | str | tuple[str, ...] = "",
        interruptible_after: Literal[0, 1, 2, 4] = 0,
        thinking: bool = False,
    ) -> RobotTurn:
        """Make a turn of the robot, for `async with`. What it says answers those who wait for an answer.

        to: ids of those spoken to, or `*` for all; empty: the only one there.
        id: of the turn, by which its fragments are named; empty: one is made up.
        interruptible: who may interrupt it: ids, `*` for anybody, False for nobody; empty: those spoken to.
        interruptible_after: seconds for which somebody has to speak to interrupt it.
        thinking: look away while nothing comes that is to be said.
        """
        whole = ToolInput(
            turn_status="full",
            parts=(),
            turn_index=2,
            addressee=to,
            interruptible=interruptible,
            interruptible_after=interruptible_after,
            thinking=thinking,
        )
        return RobotTurn(self, id or self._unnamed(), whole)

    def heard(self, *, language: str = "", ends: EndOfTurn | str = "") -> HeardFeed:
        """Follow the turns of people: each as soon as it begins, with its words as they come, until it is over.

        language: of the words, as `en-GB`, by which an unfinished sentence is known; empty: any.
        ends: what decides that a turn is over: an object of yours, or the name of one that an installed package
            offers (`engage.turn_ends`); empty: the rule of `EndOfTurn`.

        Raises:
            InputRefused: no package offers that, or it cannot be had.
        """
        taken(language, str, "language")
        self._requests.check()
        return HeardFeed(self._bus, _end_of_turn(ends), language)

    def connection_events(
        self, actor: str = "", kind: EventKind | Collection[EventKind] = (), *, open: bool = False
    ) -> EventFeed:
        """Follow connection events: every change in their lives, each once, in order.

        actor: id of the person; empty: of all people.
        kind: one kind or several; empty: all.
        open: begin with those that are open already, each as it was last told; otherwise from now on.

        Raises:
            InputRefused: `actor` is no text.
            ValueError: a name that can be no person, or no kind.
        """
        kinds = (kind,) if isinstance(kind, str) else listed(kind, "kind")
        taken(actor, str, "actor")
        if unknown := [each for each in kinds if each not in get_args(EventKind)]:
            raise ValueError(f"{', '.join(map(shown, unknown))}: the kinds are {', '.join(get_args(EventKind))}")
        self._requests.check()
        stream = EventStream(self.now(), self._bus.stamp, kinds=kinds, opening=open)
        return EventFeed(self._bus, stream, keys.event_stream(actor, kinds))

    def turns(self) -> Feed[TurnClosed]:
        """Follow the robot's turns: each once it is over and answered, or it is too late for an answer."""
        return self._feed((TurnClosed,), keys.TURN_CLOSED)

    def feedback(self, *, past: bool = False) -> Feed[Feedback]:
        """Follow blocks: their progress, sync points as realised, warnings.

        past: begin with what was told in the last 2 s; otherwise from now on.
        """
        if past:
            return self._feed(Feedback.__args__, keys.ANY_FEEDBACK)
        self._requests.check()
        return NewFeed(self._bus, Feedback.__args__, (keys.ANY_FEEDBACK,))

    def words(self) -> Feed[WordSpoken]:
        """Follow the robot's words: each when it has been said, from now on."""
        self._requests.check()
        return NewFeed(self._bus, (WordSpoken,), (keys.SYNC_POINT,))

    def faults(self) -> Feed[Fault]:
        """Follow the faults that services tell of: bad messages, and errors while one was taken."""
        return self._feed((Fault,), keys.ANY_FAULT)

    def worlds(self) -> Feed[World]:
        """Follow the world: now, if anything is perceived, and whenever it has changed. Only the newest is kept.

        A person of whom perception tells by several ids is there once, by the id by which events tell of them.
        """
        self._requests.check()
        return WorldFeed(self._bus)

    def head_owners(self) -> Feed[HeadOwner]:
        """Follow the owner of the robot's head, with the reason: now, and at every change."""
        return self._feed((HeadOwner,), keys.HEAD_OWNER)

    def holds(self) -> Feed[Held]:
        """Follow what is held of what the robot performs: now, and at every change."""
        return self._feed((Held,), keys.HELD)

    async def world(self, timeout: Seconds | None = None) -> World:
        """Return what is perceived now; waits for perception.

        timeout: seconds to wait; None: for ever.

        Raises:
            InputRefused: `timeout` is no number.
            NoReply: no world within `timeout`.
        """
        return await first_of(self.worlds(), "world", timeout)

    async def person(self, timeout: Seconds | None = None) -> Entity:
        """Return the person who is there, or the first to come.

        timeout: seconds to wait; None: for ever.

        Raises:
            InputRefused: `timeout` is no number.
            NoReply: nobody within `timeout`.
        """
        world = await first_of(self.worlds(), "person in the world", timeout, lambda world: bool(world.people))
        return world.people[0]

    def statistics_updates(self, actor: str = "") -> Feed[Statistics]:
        """Follow the statistics of a person, or of each and `all`: now, and at each change. Only the newest are kept.

        actor: id of the person, any that they have, or `all` for all together; empty: each of these.

        Raises:
            InputRefused: `actor` is no text.
            ValueError: a name that can be no person.
        """
        key = keys.statistics(keys.chunk(taken(actor, str, "actor")))
        if actor in ("", "all"):
            return self._feed((Statistics,), key, keep=Keep.LATEST)
        self._requests.check()
        return StatisticsFeed(self._bus, actor)

    async def statistics(self, actor: str = "all", timeout: Seconds | None = None) -> Statistics:
        """Return the statistics of a person, or of `all`, as they are now; waits for recognition.

        actor: id of the person, or `all` for all together.
        timeout: seconds to wait; None: for ever.

        Raises:
            InputRefused: `actor` is no text, or `timeout` no number.
            NoReply: none within `timeout`.
            ValueError: a name that can be no person.
        """
        return await first_of(self.statistics_updates(actor), f"statistics of {actor}", timeout)

    def engagement(self) -> Feed[Statistics]:
        """Follow the engagement of people: the level of each as it is now, and whenever it is another.

        `level` says it in a word, `engagement` as a number, `reasons` why. Who comes is `engaging`, who drifts away
        `disengaging`; an id that turns out to be somebody else's is `unknown`.
        """
        self._requests.check()
        return LevelFeed(self._bus)

    def floor(self) -> Feed[Floor]:
        """Follow who speaks, and to whom: now, and at every change."""
        return self._feed((Floor,), keys.FLOOR)

    def interjections(self) -> Feed[Interjection]:
        """Follow what people say into the robot's turns: at once, and again when it is decided what it is."""
        return self._feed((Interjection,), keys.ANY_INTERJECTION)

    def actions(self) -> Feed[ActionBegan | ActionEnded | ActorFound | ActorLost]:
        """Follow the actions of the robot and of people as they are seen, and the coming and going of people.

        It begins with the people who are there and with what goes on now. What a program told that was killed is over
        after 4 s: its people go, and their actions end.
        """
        self._requests.check()
        return ActionFeed(self._bus)

    def utterances(self) -> Feed[Utterance]:
        """Follow the words of people: partial results, final ones, corrections, as perception tells them."""
        return self._feed((Utterance,), keys.UTTERANCE)


def _end_of_turn(named: EndOfTurn | str) -> EndOfTurn:
    """Find what decides that a turn is over. Raises InputRefused."""
    if not isinstance(named, str):
        return named
    if not named:
        return EndOfTurn()
    found = {each.name: each for each in offers(TURN_ENDS)}
    if (offer := found.get(named)) is None:
        advice = f"there are {', '.join(sorted(found)) or 'none'}: `{TURN_ENDS}` among the entry points of a package"
        raise InputRefused(Fault(reason=f"no package offers {named!r}", where="ends", advice=advice))
    try:
        made: EndOfTurn = offer.load()()
    except Exception as error:
        reason = f"{offer.package} offers {named!r}, which cannot be had: {error}"
        raise InputRefused(Fault(reason=reason, where="ends", advice=offer.advice(error))) from error
    return made


@asynccontextmanager
async def connect(
    robot: str | None = None,
    *,
    connect: Sequence[str] = (),
    mode: Mode | None = None,
    listen: Sequence[str] = (),
    hub: Hub | None = None,
    name: str = "",
    keys: str = "",
) -> AsyncIterator[Robot]:
    """Join a robot's bus as a collaboration manager. The robot may come later: what is asked of it waits.

    If its services are not all in sight after 3 s, a warning in the log `engage` says which, and why. What is not
    given is taken from the variables `ENGAGE_BUS_ROBOT`, `ENGAGE_BUS_CONNECT` and their like, else from the section
    `[bus]` of the file that `ENGAGE_CONFIG` names.

    robot: the robot's namespace on the bus; `robot` where nothing says otherwise.
    connect: Zenoh endpoints to connect to, such as `tcp/192.0.2.1:7447`; none: this machine's.
    mode: client of a router, or peer; auto: client if an endpoint is on another machine.
    listen: Zenoh endpoints to listen on.
    hub: use this one instead; it stays open.
    name: the participant's, unique on the robot's bus; made up when empty. With keys, their holder's comes before it.
    keys: folder of keys that `engage keys` has made.

    Raises:
        InputRefused: the keys are no good, an endpoint is misspelled, or the file or a variable is wrong.
        RunFailed: an endpoint that is to be listened on is taken.
        ValueError: a name that cannot be in a key, or that the hub has already.
    """
    if hub is not None:
        async with _joined(hub, name) as client:
            yield client
        return
    # Only here: a client on an existing hub needs no Zenoh.
    from engage_hri.services.bus.keyring import read_keys
    from engage_hri.services.bus.zenoh.hub import open_hub
    from engage_hri.services.bus.zenoh.neighbors import hinting

    bus = bus_config(robot=robot, connect=tuple(connect), mode=mode, keys=keys)
    own = read_keys(bus.keys, "manager") if bus.keys else None
    async with (
        await open_hub(bus.robot, connect=bus.connect, listen=listen, mode=bus.mode, keys=own) as opened,
        _joined(opened, name) as client,
        hinting(client._bus, bus.connect),
    ):
        yield client


@asynccontextmanager
async def _joined(hub: Hub, name: str) -> AsyncIterator[Robot]:
    bus = hub.join(name or f"client-{uuid.uuid4().hex[:8]}")
    try:
        async with Robot.on(bus) as client:
            bus.declare_alive()
            yield client
    finally:
        await bus.leave()
