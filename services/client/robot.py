"""The public client: what a collaboration manager needs of an engaged robot, from any process.

    async with connect(connect=["tcp/robot:7447"]) as robot:
        outcome = await robot.perform(Path("greeting.xml"))
        async for event in robot.connection_events():
            ...

It may start before the services it talks to: requests wait for them, at most `timeout` seconds where one is given.
Refused input raises InputRefused, failure at run time RunFailed, each with the `fault` that says where and why.
"""

import asyncio
import uuid
from collections.abc import AsyncIterator, Awaitable, Callable, Collection, Iterable, Sequence
from contextlib import asynccontextmanager
from itertools import count
from pathlib import Path
from typing import Any, Literal, TypeVar, get_args

import msgspec
from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.actions import ActionBegan, ActionEnded, ActorFound, ActorLost
from engage_hri.schemas.attention import HeadOwner, Inhibit
from engage_hri.schemas.behaviors import BlockBehavior, Constraint, EventKind
from engage_hri.schemas.blocks import (
    BehaviorInterrupted,
    Block,
    BlockOutcome,
    Composition,
    InterruptBehavior,
    PerformBlock,
)
from engage_hri.schemas.documents.json_codec import read
from engage_hri.schemas.faults import Fault, InputRefused, NoReply, RunFailed
from engage_hri.schemas.feedback import Feedback
from engage_hri.schemas.fragments import FragmentOutcome, PerformFragment, TurnClosed, TurnFragment
from engage_hri.schemas.messages import decode, published
from engage_hri.schemas.recognition import Statistics
from engage_hri.schemas.requests import Outcome, Request
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus.interface import Bus, Hub, Keep
from engage_hri.services.client.event_stream import EventStream
from engage_hri.services.client.feeds import EventFeed, Feed
from engage_hri.services.requests.ends import Pending, Requester, RequestRefused

FragmentSource = TurnFragment | str | bytes | Path | dict[str, Any]
"""A fragment, or EBML or JSON that describes one (a language model's tool input, too), or the file it stands in."""
ANSWER_PATIENCE = 20.0
"""Seconds after a fragment's end: longer than any answer of a person is waited for."""


class PerformFailed(RunFailed):
    """A fragment or block failed while it ran. `outcome` tells what was done of it."""

    def __init__(self, fault: Fault, outcome: FragmentOutcome | BlockOutcome) -> None:
        super().__init__(fault)
        self.outcome = outcome


class Robot:
    """An engaged robot, as its collaboration manager sees it. Made by `connect` or, in a service, `Robot.on(bus)`."""

    def __init__(self, bus: Bus, requests: Requester) -> None:
        self._bus = bus
        self._requests = requests
        self._numbers = count(1)
        self._life = bus.new_life()
        """In the names of fragments that have none: another client of this name, or its next life, has others."""

    @classmethod
    @asynccontextmanager
    async def on(cls, bus: Bus) -> AsyncIterator["Robot"]:
        """The client of a participant that has its own bus already."""
        async with Requester(bus) as requests:
            yield cls(bus, requests)

    @property
    def id(self) -> str:
        """The robot's actor id, which is its namespace."""
        return self._bus.robot

    def now(self) -> Seconds:
        return self._bus.now()

    def local(self, stamp: Stamp) -> Seconds:
        """A message's stamp on this process' clock, comparable with `now`."""
        return self._bus.local(stamp)

    # -- requests -----------------------------------------------------------------------------------------------

    async def perform(
        self, fragment: FragmentSource, *, await_answer: bool = False, timeout: Seconds | None = None
    ) -> FragmentOutcome:
        """Perform a turn fragment; returns when it is done or was interrupted.

        await_answer: if it ends a turn, only when that has been answered, or it is too late; `events` tell.
        timeout: how long to wait for it to be accepted, for example until generation is there.
        Raises InputRefused (nothing has moved), PerformFailed, or RunFailed (generation is gone, or never came).
        """
        parsed = _fragment(fragment, f"{self._bus.name}-{self._life}-{next(self._numbers)}")
        request = self._fragment_request(parsed)
        answered = await_answer and parsed.turn_status in ("end", "full")
        outcome = await (self._answered(request, timeout) if answered else self._performed(request, timeout))
        return _unless_failed(outcome, parsed.id)

    def begin_to_perform(self, fragment: TurnFragment) -> None:
        """Send a fragment and do not wait for what becomes of it."""
        self._requests.send(keys.FRAGMENT, _checked(self._fragment_request(fragment)))

    def _fragment_request(self, fragment: TurnFragment) -> PerformFragment:
        return PerformFragment(id=self._request_id(fragment.id), fragment=fragment)

    async def _performed(self, request: PerformFragment, timeout: Seconds | None) -> FragmentOutcome:
        outcome = await self._ask(keys.FRAGMENT, request, timeout)
        assert isinstance(outcome, FragmentOutcome)
        return outcome

    async def _answered(self, request: PerformFragment, timeout: Seconds | None) -> FragmentOutcome:
        with self.turns() as turns:
            outcome = await self._performed(request, timeout)
            events = {event.id for event in outcome.events}
            deadline = self.now() + ANSWER_PATIENCE
            while (turn := await turns.next(max(0.0, deadline - self.now()))) is not None:
                # An earlier turn of the same name, told again, has other events.
                if request.fragment.id in turn.fragments and events <= {event.id for event in turn.events}:
                    return replace(outcome, events=turn.events)
        return outcome

    async def realize(
        self,
        block: Block | str,
        behaviors: Iterable[BlockBehavior] = (),
        constraints: Iterable[Constraint] = (),
        *,
        composition: Composition = "MERGE",
        timeout: Seconds | None = None,
    ) -> BlockOutcome:
        """Realize a BML block, past the policies: `realize(block)`, or `realize("greet", [Gaze(...), ...])`.

        Raises as `perform` does.
        """
        if isinstance(block, str):
            block = Block(
                id=block, behaviors=tuple(behaviors), constraints=tuple(constraints), composition=composition
            )
        request = PerformBlock(id=self._request_id(block.id), block=block)
        outcome = await self._ask(keys.BLOCK, request, timeout)
        assert isinstance(outcome, BlockOutcome)
        return _unless_failed(outcome, block.id)

    async def interrupt(self, block: str, behavior: str, *, timeout: Seconds | None = None) -> BehaviorInterrupted:
        """End one behavior of a live block, which goes on without it; returns when it has ended, with what was said.

        To end a whole block, cancel the task that awaits its `realize`.
        Raises InputRefused if it is not being performed, or as `perform` does.
        """
        id = self._request_id(f"{block}:{behavior}")
        request = InterruptBehavior(id=id, block=block, behavior=behavior)
        outcome = await self._ask(keys.BLOCK, request, timeout)
        assert isinstance(outcome, BehaviorInterrupted)
        return outcome

    @asynccontextmanager
    async def inhibit_gaze(
        self,
        mode: Literal["release", "hold", "target"] = "hold",
        *,
        target: str = "",
        part: Literal["gaze", "point-left", "point-right"] = "gaze",
        ttl: Seconds = 5.0,
        timeout: Seconds | None = None,
    ) -> AsyncIterator[None]:
        """Hold a lease on the gaze (or an arm) while the body of `async with` runs, renewing it as long as we live.

        Raises InputRefused, for example when `target` is unknown. If the lease is lost the body runs on.
        """
        request = Inhibit(id=self._request_id("inhibit"), part=part, mode=mode, target=target, ttl=ttl)
        pending = self._requests.send(keys.INHIBIT, _checked(request))
        try:
            await self._answer_of(pending, pending.accepted, timeout)
        except (asyncio.CancelledError, RunFailed):
            self._requests.cancel(request.id, "requester gave up")
            raise
        try:
            yield
        finally:
            self._requests.cancel(request.id, "released")
        # Only on the good way: who is cancelled, or fails, is not to wait, nor to hear of a lease that was lost.
        await asyncio.wait([pending.outcome], timeout=ttl)

    async def _ask(self, key: str, request: Request, timeout: Seconds | None) -> Outcome:
        pending = self._requests.send(key, _checked(request))
        try:
            if timeout is not None:
                await self._answer_of(pending, pending.accepted, timeout)
            outcome: Outcome = await self._answer_of(pending, pending.outcome, None)
            return outcome
        except (asyncio.CancelledError, RunFailed):
            self._requests.cancel(request.id, "requester gave up")
            raise

    async def _answer_of(self, pending: Pending, answer: Awaitable[Any], timeout: Seconds | None) -> Any:
        server = keys.server_of(pending.key)
        try:
            return await asyncio.wait_for(answer, timeout)
        except TimeoutError as error:
            advice = f"is {server} running?"
            raise RunFailed(
                Fault(reason=f"no answer within {timeout} s", where=pending.request.id, advice=advice, service=server)
            ) from error
        except RequestRefused as error:
            raise InputRefused(error.fault) from error

    def _request_id(self, subject: str) -> str:
        return f"{self._bus.name}/{subject}#{next(self._numbers)}"

    # -- what happens -------------------------------------------------------------------------------------------

    def connection_events(
        self, actor: str = "", kind: EventKind | Collection[EventKind] = (), *, open: bool = False
    ) -> EventFeed:
        """Every change in the life of the connection events with one person, or all, of one kind, several, or all.

        open: first those that are open already, each as it was last told; otherwise from now on.
        Raises ValueError for what can be no person or kind.
        """
        kinds = (kind,) if isinstance(kind, str) else tuple(kind)
        if unknown := set(kinds) - set(get_args(EventKind)):
            raise ValueError(f"{', '.join(map(repr, unknown))}: the kinds are {', '.join(get_args(EventKind))}")
        self._requests.check()
        stream = EventStream(self.now(), self._bus.stamp, kinds=kinds, opening=open)
        return EventFeed(self._bus, stream, keys.event_stream(actor, kinds))

    def turns(self) -> Feed[TurnClosed]:
        """Each turn of the robot once it is over and answered, or it is too late for an answer."""
        return self._feed((TurnClosed,), keys.TURN_CLOSED)

    def feedback(self) -> Feed[Feedback]:
        """What is told of blocks: progress, sync points as realised, warnings."""
        return self._feed(Feedback.__args__, keys.ANY_FEEDBACK)

    def actions(self) -> Feed[ActionBegan | ActionEnded | ActorFound | ActorLost]:
        """What the robot and the people are seen to do."""
        return self._feed((ActionBegan, ActionEnded, ActorFound, ActorLost), keys.ANY_ACTION)

    def faults(self) -> Feed[Fault]:
        return self._feed((Fault,), keys.ANY_FAULT)

    def worlds(self) -> Feed[World]:
        """The world now, if anything is perceived, and then whenever it has changed; only the newest is kept."""
        return self._feed((World,), keys.WORLD, keep=Keep.LATEST)

    def head_owners(self) -> Feed[HeadOwner]:
        """Who owns the robot's head, and why: now, and at every change."""
        return self._feed((HeadOwner,), keys.HEAD_OWNER)

    async def world(self, timeout: Seconds | None = None) -> World:
        """What is perceived now; waits for perception. Raises NoReply after `timeout` seconds without it."""
        with self.worlds() as worlds:
            return _there(await worlds.next(timeout), "world", timeout)

    async def person(self, timeout: Seconds | None = None) -> Entity:
        """The person who is there, or the first to come. Raises NoReply after `timeout` seconds without one."""
        deadline = None if timeout is None else self.now() + timeout
        with self.worlds() as worlds:
            while True:
                left = None if deadline is None else max(0.0, deadline - self.now())
                world = _there(await worlds.next(left), "person in the world", timeout)
                if world.people:
                    return world.people[0]

    def standings(self, actor: str = "") -> Feed[Statistics]:
        """The statistics of a person, or of each and `all`: now, and when they change; only the newest are kept."""
        return self._feed((Statistics,), keys.statistics(keys.chunk(actor)), keep=Keep.LATEST)

    async def statistics(self, actor: str = "all", timeout: Seconds | None = None) -> Statistics:
        """The statistics of a person, or of `all`; waits for recognition. Raises NoReply after `timeout` seconds."""
        with self.standings(actor) as feed:
            return _there(await feed.next(timeout), f"statistics of {actor}", timeout)

    def _feed(self, kinds: tuple[type, ...], *patterns: str, keep: Keep = Keep.EVERY) -> Feed[Any]:
        self._requests.check()
        return Feed(self._bus.subscribe(*patterns, keep=keep), kinds, self._bus.now)


@asynccontextmanager
async def connect(
    robot: str = "robot",
    *,
    connect: Sequence[str] = (),
    listen: Sequence[str] = (),
    hub: Hub | None = None,
    name: str = "",
) -> AsyncIterator[Robot]:
    """Join a robot's bus as a collaboration manager.

    connect, listen: Zenoh endpoints. hub: use this one instead; it stays open. If there is no such robot after 3 s, a
    warning in the log `engage` names those that are there.
    name: the participant's, unique on the robot's bus; made up when empty.
    """
    if hub is not None:
        async with _joined(hub, name) as client:
            yield client
        return
    # Only here: a client on an existing hub needs no Zenoh.
    from engage_hri.services.bus.zenoh.hub import open_hub
    from engage_hri.services.bus.zenoh.neighbors import tell_if_alone

    async with await open_hub(robot, connect=connect, listen=listen) as opened, _joined(opened, name) as client:
        hint = asyncio.create_task(tell_if_alone(client._bus, connect), name="hint")
        try:
            yield client
        finally:
            hint.cancel()
            await asyncio.gather(hint, return_exceptions=True)


@asynccontextmanager
async def _joined(hub: Hub, name: str) -> AsyncIterator[Robot]:
    bus = hub.join(name or f"client-{uuid.uuid4().hex[:8]}")
    try:
        async with Robot.on(bus) as client:
            bus.declare_alive()
            yield client
    finally:
        await bus.leave()


def _fragment(source: FragmentSource, unnamed: str) -> TurnFragment:
    """unnamed: the id of one that has none. Raises InputRefused with file, line or JSON path."""
    match source:
        case TurnFragment():
            return source
        case Path():
            try:
                data, place = source.read_bytes(), str(source)
            except OSError as error:
                raise InputRefused(Fault(reason=error.strerror or str(error), where=str(source))) from error
        case str():
            data, place = _encoded(source.encode), ""
        case bytes():
            data, place = source, ""
        case dict():
            data, place = _encoded(lambda: msgspec.json.encode(source)), ""
    things = read(data, place, unnamed)
    match things:
        case (TurnFragment() as fragment,):
            return fragment
        case (Block(),):
            raise InputRefused(Fault(reason="a BML block, not a turn fragment", where=place, advice="use `realize`"))
    raise InputRefused(Fault(reason=f"{len(things)} things, not one turn fragment", where=place))


R = TypeVar("R", bound=Request)


def _checked(request: R) -> R:
    """As its server will get it: structs take any values where they are made. Raises InputRefused."""
    try:
        decode(*published(request))  # type: ignore[arg-type]
    except (UnicodeEncodeError, OverflowError, TypeError, ValueError, RecursionError, msgspec.MsgspecError) as error:
        raise InputRefused(Fault(reason=str(error), where=str(request.id))) from error
    return request


def _encoded(encode: Callable[[], bytes]) -> bytes:
    """Raises InputRefused for half a character, and for values that JSON does not have."""
    try:
        return encode()
    except (UnicodeEncodeError, TypeError, ValueError, RecursionError, msgspec.MsgspecError) as error:
        raise InputRefused(Fault(reason=str(error), advice="text in Unicode, or what JSON can hold")) from error


O = TypeVar("O", FragmentOutcome, BlockOutcome)  # noqa: E741


def _unless_failed(outcome: O, subject: str) -> O:
    if outcome.status == "failed":
        raise PerformFailed(outcome.fault or Fault(reason="it failed", where=subject), outcome)
    return outcome


S = TypeVar("S", bound=Struct)


def _there(message: S | None, what: str, timeout: Seconds | None) -> S:
    if message is None:
        raise NoReply(Fault(reason=f"no {what} within {timeout} s", advice="is its service running?"))
    return message
