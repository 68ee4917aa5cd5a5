"""The public client: what a collaboration manager needs of an engaged robot, from any process.

    async with connect(connect=["tcp/robot:7447"]) as robot:
        outcome = await robot.perform(Path("greeting.xml"))
        async for event in robot.connection_events():
            ...

It may start before the services it talks to: requests wait for them, at most `timeout` seconds where one is given.
"""

import uuid
from collections.abc import AsyncIterator, Collection, Iterable, Sequence
from contextlib import asynccontextmanager
from typing import TypeVar, get_args

from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import BlockBehavior, Constraint, EventKind
from engage_hri.schemas.blocks import (
    Block,
    BlockOutcome,
    Composition,
    Feedback,
    Held,
    PerformBlock,
)
from engage_hri.schemas.body import WordSpoken
from engage_hri.schemas.faults import Fault, RunFailed
from engage_hri.schemas.fragments import (
    FragmentOutcome,
    HeadOwner,
    HeardText,
    PerformFragment,
    TurnClosed,
    TurnFragment,
)
from engage_hri.schemas.participants import PeerGone
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, ActorLost, Utterance
from engage_hri.schemas.recognition import Floor, Interjection, Statistics
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus.config import Mode
from engage_hri.services.bus.interface import Bus, Hub, Keep
from engage_hri.services.client.event_stream import EventStream
from engage_hri.services.client.feeds import ActionFeed, EventFeed, Feed, LevelFeed, NewFeed, WorldFeed, first_of
from engage_hri.services.client.inputs import (
    BlockSource,
    FragmentSource,
    block_in,
    checked,
    fragment_in,
    listed,
    shown,
    taken,
)
from engage_hri.services.client.orders import OrderedRobot
from engage_hri.services.requests.ends import Pending, Requester
from engage_hri.services.runtime.configuration import bus_config

ANSWER_PATIENCE = 40.0
"""Seconds after a fragment's end for which `await_answer` waits: longer than an answer takes, and its words."""


UTTERANCES_KEPT = 256
"""Number of utterances of which a reader of outcomes is known to have been told."""


class PerformFailed(RunFailed):
    """A fragment or block failed while it ran, or what performed it has gone, so that its end is unknown.

    `outcome` tells what was done of it, as far as is known, and its `status` which of the two; `fault` tells why.
    """

    def __init__(self, fault: Fault, outcome: FragmentOutcome | BlockOutcome) -> None:
        super().__init__(fault)
        self.outcome = outcome


class NewWords:
    """Words that one reader of outcomes has not been told yet: each outcome repeats those since the turn before."""

    def __init__(self) -> None:
        self._told: dict[tuple[str, str], str] = {}
        """Text of each utterance, by person and id."""

    def of(self, heard: Iterable[HeardText]) -> tuple[HeardText, ...]:
        """Return those that are new, or say something else than before; from now on they are known."""
        new = tuple(each for each in heard if self._told.get((each.actor, each.id)) != each.text)
        for each in new:
            self._told.pop((each.actor, each.id), None)
            self._told[each.actor, each.id] = each.text
        while len(self._told) > UTTERANCES_KEPT:
            del self._told[next(iter(self._told))]
        return new


class Robot(OrderedRobot):
    """An engaged robot, as its collaboration manager sees it. Made by `connect` or, in a service, `Robot.on(bus)`.

    Errors carry a `fault` that says where and why. Once the client has ended (its `async with` has, or it broke), all
    methods that ask or follow raise RunFailed. They are called on the event loop that made it.
    """

    def __init__(self, bus: Bus, requests: Requester) -> None:
        super().__init__(bus, requests)
        self._words = NewWords()

    async def perform(
        self,
        fragment: FragmentSource,
        *,
        addressee: str | tuple[str, ...] | None = None,
        interruptible: bool | str | tuple[str, ...] | None = None,
        await_answer: bool = False,
        timeout: Seconds | None = None,
    ) -> FragmentOutcome:
        """Perform a turn fragment; returns when it is done or was interrupted.

        fragment: a `TurnFragment`, the path of a file with EBML or JSON, such a text itself, or JSON as a dict; also
        the tool input of a language model.
        addressee: to whom, in place of what the fragment says: an id, several, or `*` for all; None: as it says.
        interruptible: who may interrupt it, in place of what the fragment says: ids, `*`, True for those spoken to,
            False for nobody; None: as it says.
        await_answer: if it ends a turn, return only when that has been answered, or it is too late; `events` tell,
            and `heard` has the words.
        timeout: seconds to wait for it to be accepted, for example until generation is there; None: for ever.

        Raises:
            InputRefused: the fragment is wrong, or cannot be performed now. Nothing has moved.
            PerformFailed: it began, and failed.
            RunFailed: generation is gone, or has not come within `timeout`.
        """
        taken(timeout, Seconds | None, "timeout")
        parsed = fragment_in(fragment, self._unnamed())
        if addressee is not None:
            parsed = replace(parsed, addressee=addressee)
        if interruptible is not None:
            parsed = replace(parsed, interruptible=interruptible)
        return await self._end_of(self._send(parsed), await_answer=await_answer, timeout=timeout)

    def _send(self, fragment: TurnFragment) -> Pending:
        request = PerformFragment(id=self._request_id(fragment.id), fragment=fragment)
        return self._requests.send(keys.FRAGMENT, checked(keys.FRAGMENT, request))

    async def _end_of(
        self, pending: Pending, *, await_answer: bool, timeout: Seconds | None = None
    ) -> FragmentOutcome:
        """Return the outcome of a fragment that was sent in this very step, as `perform` does."""
        assert isinstance(pending.request, PerformFragment)
        fragment = pending.request.fragment
        awaits_answer = await_answer and fragment.turn_status in ("end", "full")
        outcome = await (self._answered(pending, timeout) if awaits_answer else self._performed(pending, timeout))
        return _successful(self._with_new_words(outcome), fragment.id)

    def _unnamed(self) -> str:
        """Make the id of a fragment or block that has none."""
        return f"{self._bus.name}-{self._life}-{next(self._numbers)}"

    def begin_to_perform(self, fragment: FragmentSource) -> None:
        """Send a fragment and do not wait for what becomes of it.

        fragment: as for `perform`; a fault that only generation can find is told on `faults`.

        Raises:
            InputRefused: it is no fragment, or a value in it is of the wrong type. Nothing was sent.
        """
        self._send(fragment_in(fragment, self._unnamed()))

    async def _performed(self, pending: Pending, timeout: Seconds | None) -> FragmentOutcome:
        outcome = await self._finished(pending, timeout)
        assert isinstance(outcome, FragmentOutcome)
        return outcome

    async def _answered(self, pending: Pending, timeout: Seconds | None) -> FragmentOutcome:
        fragment = pending.request.fragment  # type: ignore[attr-defined]
        with self._feed((TurnClosed, PeerGone), keys.TURN_CLOSED, keys.ANY_ROBOT_ALIVE) as news:
            outcome = await self._performed(pending, timeout)
            events = {event.id for event in outcome.events}
            deadline = self.now() + ANSWER_PATIENCE + (fragment.within or 0.0)
            while (told := await news.next(max(0.0, deadline - self.now()))) is not None:
                if isinstance(told, PeerGone):
                    if told.participant == "generation":
                        return _without_an_answer(outcome)
                # An earlier turn of the same name, told again, has other events.
                elif fragment.id in told.fragments and events <= {event.id for event in told.events}:
                    return replace(outcome, events=told.events, heard=told.heard, interjections=told.interjections)
        return outcome

    async def realize(
        self,
        block: BlockSource,
        behaviors: Iterable[BlockBehavior] = (),
        constraints: Iterable[Constraint] = (),
        *,
        composition: Composition = "MERGE",
        follows: Iterable[str] = (),
        timeout: Seconds | None = None,
    ) -> BlockOutcome:
        """Realize a BML block, past the policies: `realize(block)`, or `realize("greet", [Gaze(...), ...])`.

        block: a whole block, the path of a file with BML or JSON, such a text itself, or JSON as a dict; or the id of
            the block to make of the other arguments.
        behaviors: of the block to make; without any, `block` is no id.
        constraints: between the sync points of these behaviors.
        composition: beside what runs (`MERGE`), after it (`APPEND`), or in its place (`REPLACE`).
        follows: ids of live blocks; when one of them fails or is ended, this block ends, too.
        timeout: seconds to wait for it to be accepted; None: for ever.

        Raises:
            InputRefused: the block is wrong as a whole. Nothing has moved.
            PerformFailed: it began, and failed.
            RunFailed: the realizer is gone, or has not come within `timeout`.
        """
        if isinstance(block, str) and (parts := listed(behaviors, "behaviors")):
            between = listed(constraints, "constraints")
            made = Block(id=block, behaviors=parts, constraints=between, composition=composition)
        else:
            made = block_in(block, self._unnamed())
        request = PerformBlock(id=self._request_id(made.id), block=made, follows=listed(follows, "follows"))
        outcome = await self._ask(keys.BLOCK, request, timeout)
        assert isinstance(outcome, BlockOutcome)
        return _successful(outcome, made.id)

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

        actor: id of the person, or `all` for all together; empty: each of these.

        Raises:
            InputRefused: `actor` is no text.
            ValueError: a name that can be no person.
        """
        return self._feed((Statistics,), keys.statistics(keys.chunk(taken(actor, str, "actor"))), keep=Keep.LATEST)

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
        `disengaging`.
        """
        self._requests.check()
        return LevelFeed(self._bus.subscribe(keys.ANY_STATISTICS), self.now)

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

    def _with_new_words(self, outcome: FragmentOutcome) -> FragmentOutcome:
        """Leave out of an outcome what this client has been told by an earlier one."""
        return replace(outcome, heard=self._words.of(outcome.heard))


O = TypeVar("O", FragmentOutcome, BlockOutcome)  # noqa: E741


def _successful(outcome: O, subject: str) -> O:
    """Return the outcome, or raise PerformFailed if it says so. subject: id of the fragment or block."""
    if outcome.status in ("failed", "unknown"):
        raise PerformFailed(outcome.fault or Fault(reason="it failed", where=subject), outcome)
    return outcome


def _without_an_answer(outcome: FragmentOutcome) -> FragmentOutcome:
    """The outcome of a fragment that was performed, but of which nobody will tell how it was answered."""
    events = tuple(replace(each, state="lost") if each.state == "started" else each for each in outcome.events)
    return replace(outcome, events=events)


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
