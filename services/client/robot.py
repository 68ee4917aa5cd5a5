"""The public client: what a collaboration manager needs of an engaged robot, from any process.

    async with connect(connect=["tcp/robot:7447"]) as robot:
        outcome = await robot.perform(Path("greeting.xml"))
        async for event in robot.connection_events():
            ...

It may start before the services it talks to: requests wait for them, at most `timeout` seconds where one is given.
"""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Collection, Iterable
from contextlib import asynccontextmanager
from itertools import count
from typing import Any, Literal, Self, get_args

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
    PerformanceSteered,
    PerformBlock,
    Steer,
    SteerPerformance,
    SteerRobot,
)
from engage_hri.schemas.body import Capabilities, DescribeBody
from engage_hri.schemas.body_faults import BodyFault, BodyFaults, FaultsSwitched, SwitchFaults
from engage_hri.schemas.conditions import ConditionSet, SetCondition, StudyCondition
from engage_hri.schemas.faults import Fault, InputRefused, NoReply, RunFailed
from engage_hri.schemas.feedback import Feedback
from engage_hri.schemas.fragments import FragmentOutcome, PerformFragment, TurnClosed, TurnFragment
from engage_hri.schemas.holds import Held
from engage_hri.schemas.perception import Utterance
from engage_hri.schemas.presence import PeerGone
from engage_hri.schemas.recognition import Statistics
from engage_hri.schemas.requests import Outcome, Request
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus.interface import Bus, Keep
from engage_hri.services.client.event_stream import EventStream
from engage_hri.services.client.feeds import ActionFeed, EventFeed, Feed, NewFeed
from engage_hri.services.client.hearing import NewWords
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
from engage_hri.services.client.results import in_time, successful
from engage_hri.services.requests.ends import Pending, Requester, RequestRefused

ANSWER_PATIENCE = 40.0
"""Seconds after a fragment's end for which `await_answer` waits: longer than an answer takes, and its words."""


class Robot:
    """An engaged robot, as its collaboration manager sees it. Made by `connect` or, in a service, `Robot.on(bus)`.

    Errors carry a `fault` that says where and why. Once the client has ended (its `async with` has, or it broke), all
    methods that ask or follow raise RunFailed. They are called on the event loop that made it.
    """

    def __init__(self, bus: Bus, requests: Requester) -> None:
        self._bus = bus
        self._requests = requests
        self._numbers = count(1)
        self._words = NewWords()
        self._life = bus.new_life()
        """Part of the ids of fragments without one, so that they differ from those of another client or life."""

    @classmethod
    @asynccontextmanager
    async def on(cls, bus: Bus) -> AsyncIterator[Self]:
        """Make the client of a participant that has its own bus already.

        bus: its view of the bus. It stays open.
        """
        async with Requester(bus) as requests:
            yield cls(bus, requests)

    @property
    def id(self) -> str:
        """The robot's actor id, which is its namespace."""
        return self._bus.robot

    def now(self) -> Seconds:
        """Return the time on this process' clock: seconds, the time of the event loop."""
        return self._bus.now()

    def local(self, stamp: Stamp) -> Seconds:
        """Convert a message's stamp to seconds on this process' clock, comparable with `now`.

        stamp: an instant on any clock of the bus.
        """
        return self._bus.local(stamp)

    async def perform(
        self, fragment: FragmentSource, *, await_answer: bool = False, timeout: Seconds | None = None
    ) -> FragmentOutcome:
        """Perform a turn fragment; returns when it is done or was interrupted.

        fragment: a `TurnFragment`, the path of a file with EBML or JSON, such a text itself, or JSON as a dict; also
        the tool input of a language model.
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
        return successful(self._with_new_words(outcome), fragment.id)

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
                    return replace(outcome, events=told.events, heard=told.heard)
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
        return successful(outcome, made.id)

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
        """Keep the gaze (or an arm) from what fragments want, while the body of `async with` runs.

        It is a lease, renewed as long as this process lives. If it is lost the body runs on.

        mode: `release` lets the head go to the base gaze, `hold` keeps it where it is, `target` keeps it on `target`.
        target: id of an entity; for the mode `target` only.
        part: the head's gaze, or the arm that is not to point.
        ttl: seconds for which the lease holds when this process has died.
        timeout: seconds to wait for it to be accepted; None: for ever.

        Raises:
            InputRefused: for example, `target` is unknown.
            RunFailed: generation is gone, or has not come within `timeout`.
        """
        request = Inhibit(id=self._request_id("inhibit"), part=part, mode=mode, target=target, ttl=ttl)
        pending = self._requests.send(keys.INHIBIT, checked(keys.INHIBIT, request))
        try:
            await self._answer_of(pending, pending.accepted, timeout)
        except (asyncio.CancelledError, RunFailed):
            self._requests.cancel(request.id, "requester gave up")
            raise
        try:
            yield
        finally:
            self._requests.cancel(request.id, "released")
        # Only after a body without an error: one that was cancelled, or failed, must not wait here.
        await asyncio.wait([pending.outcome], timeout=ttl)

    async def interrupt(self, block: str, behavior: str, *, timeout: Seconds | None = None) -> BehaviorInterrupted:
        """End one behavior of a live block, which goes on without it; returns when it has ended, with what was said.

        To end a whole block, cancel the task that awaits its `realize`.

        block: its id.
        behavior: its id within the block.
        timeout: seconds to wait for the request to be accepted; None: for ever.

        Raises:
            InputRefused: it is not being performed.
            RunFailed: the realizer is gone, or has not come within `timeout`.
        """
        id = self._request_id(f"{block}:{behavior}")
        request = InterruptBehavior(id=id, block=block, behavior=behavior)
        outcome = await self._ask(keys.BLOCK, request, timeout)
        assert isinstance(outcome, BehaviorInterrupted)
        return outcome

    async def hold(self, block: str = "", behavior: str = "", *, timeout: Seconds | None = None) -> tuple[str, ...]:
        """Hold a behavior, a block, or all that the robot performs, until `resume`; returns the ids of the blocks.

        Each behavior waits where it next can: a movement at its next hold point, speech between two words. Nothing
        begins, clocks stop, and nothing counts as late for it. What is held for longer than `realizer.longest_hold`
        is stopped.

        block: its id; empty: everything, and what comes meanwhile. Rules for access may keep that to operators.
        behavior: its id within the block; empty: all of it.
        timeout: seconds to wait for the request to be accepted; None: for ever.

        Raises:
            InputRefused: it is not being performed, or a behavior is given without its block.
            RunFailed: the realizer is gone, or has not come within `timeout`.
        """
        return await self._steer("hold", block, behavior, timeout)

    async def resume(self, block: str = "", behavior: str = "", *, timeout: Seconds | None = None) -> tuple[str, ...]:
        """Let what is held go on from where it is; returns the ids of the blocks.

        A block lets go all its behaviors, an empty `block` everything. Arguments and errors as in `hold`; it is also
        refused (InputRefused) if it is held still, because all of its block is, or the whole robot.
        """
        return await self._steer("continue", block, behavior, timeout)

    async def stop(self, block: str = "", behavior: str = "", *, timeout: Seconds | None = None) -> tuple[str, ...]:
        """End a behavior, a block, or all that the robot performs, safely; returns the ids of the blocks.

        It returns when they have ended: blocks as interrupted. Arguments and errors as in `hold`.
        """
        return await self._steer("stop", block, behavior, timeout)

    async def _steer(self, to: Steer, block: str, behavior: str, timeout: Seconds | None) -> tuple[str, ...]:
        if behavior and not block:
            raise InputRefused(Fault(reason="a behavior without its block", where=behavior))
        id = self._request_id(":".join((to, *filter(None, (block, behavior)))))
        if block:
            named = SteerPerformance(id=id, to=to, block=block, behavior=behavior)
            outcome = await self._ask(keys.BLOCK, named, timeout)
        else:
            outcome = await self._ask(keys.ROBOT, SteerRobot(id=id, to=to), timeout)
        assert isinstance(outcome, PerformanceSteered)
        if outcome.held_with:
            raise InputRefused(_still_held(block, behavior, outcome.held_with))
        return outcome.blocks

    async def switch_faults(
        self, faults: Iterable[BodyFault] = (), *, timeout: Seconds | None = None
    ) -> tuple[BodyFault, ...]:
        """Switch on exactly these faults of the body, in what is under way, too; returns what is on.

        Where others switch faults as well, `switch_on` and `switch_off` leave theirs as they are.

        faults: none: it is healthy again. `schemas/body_faults.py` says what each does. Rules for access keep this to
            operators and wizards.
        timeout: seconds to wait for the request to be accepted; None: for ever.

        Raises:
            InputRefused: the body cannot play one of them. Nothing has changed.
            RunFailed: control is gone, or has not come within `timeout`.
        """
        return await self._switch(on=tuple(faults), all_off=True, timeout=timeout)

    async def switch_on(self, *faults: BodyFault, timeout: Seconds | None = None) -> tuple[BodyFault, ...]:
        """Switch on these faults of the body besides those that are on; returns what is on.

        faults: each replaces one that differs from it in its amount alone. timeout, errors: as of `switch_faults`.
        """
        return await self._switch(on=faults, timeout=timeout)

    async def switch_off(self, *faults: BodyFault, timeout: Seconds | None = None) -> tuple[BodyFault, ...]:
        """Switch off these faults of the body, and no others; returns what is on.

        faults: of each, all go off that have the fields which it has; one with a kind alone means all of its kind.
        timeout, errors: as of `switch_faults`; InputRefused also if one of them is not on.
        """
        return await self._switch(off=faults, timeout=timeout)

    async def _switch(
        self,
        *,
        on: tuple[BodyFault, ...] = (),
        off: tuple[BodyFault, ...] = (),
        all_off: bool = False,
        timeout: Seconds | None,
    ) -> tuple[BodyFault, ...]:
        request = SwitchFaults(id=self._request_id("faults"), on=on, off=off, all_off=all_off)
        outcome = await self._ask(keys.FAULTS, request, timeout)
        assert isinstance(outcome, FaultsSwitched)
        return outcome.faults

    def body_faults(self) -> Feed[BodyFaults]:
        """Follow the faults that the body plays: now, and at every change."""
        return self._feed((BodyFaults,), keys.BODY_FAULTS)

    async def faults_on(self, timeout: Seconds | None = None) -> tuple[BodyFault, ...]:
        """Return the faults that the body plays now; waits for control.

        timeout: seconds to wait; None: for ever.

        Raises:
            NoReply: none within `timeout`.
        """
        with self.body_faults() as feed:
            return in_time(await feed.next(timeout), "state of the body", timeout).faults

    async def capabilities(self, timeout: Seconds = 1.0) -> Capabilities:
        """Return what the body says of itself: its parts and joints, what it can do, which faults it can play.

        timeout: seconds to wait for control.

        Raises:
            NoReply: no answer within `timeout`.
        """
        said = await self._bus.query(keys.DESCRIBE, DescribeBody(), timeout=timeout)
        if not isinstance(said, Capabilities):
            raise NoReply(Fault(reason="no capabilities of a body", where=keys.DESCRIBE))
        return said

    async def set_condition(
        self, name: str = "", *, speech_only: bool = False, by: str = "", timeout: Seconds | None = None
    ) -> None:
        """Begin a condition; from now on what the robot does counts under this name, until another begins.

        name: at most 80 characters; empty: what comes belongs to none. speech_only: the robot says the words of the
            task and nothing else, its head to the upper right (`degraded-generation`; thesis 5.3).
        by: who sets it, for the record. Rules for access keep this to operators and wizards.
        timeout: seconds to wait for the request to be accepted; None: for ever.

        Raises:
            InputRefused: the name is too long. Nothing has changed.
            RunFailed: generation is gone, or has not come within `timeout`.
        """
        request = SetCondition(id=self._request_id("condition"), name=name, speech_only=speech_only, by=by)
        outcome = await self._ask(keys.CONDITION, request, timeout)
        assert isinstance(outcome, ConditionSet)

    def conditions(self) -> Feed[StudyCondition]:
        """Follow the condition: the one in force now, and each that begins."""
        return self._feed((StudyCondition,), keys.STUDY_CONDITION)

    async def condition(self, timeout: Seconds | None = None) -> StudyCondition:
        """Return the condition that is in force now; waits for generation.

        timeout: seconds to wait; None: for ever.

        Raises:
            NoReply: none within `timeout`.
        """
        with self.conditions() as feed:
            return in_time(await feed.next(timeout), "condition of a study", timeout)

    async def _ask(self, key: str, request: Request, timeout: Seconds | None) -> Outcome:
        taken(timeout, Seconds | None, "timeout")
        return await self._finished(self._requests.send(key, checked(key, request)), timeout)

    async def _finished(self, pending: Pending, timeout: Seconds | None) -> Outcome:
        try:
            if timeout is not None:
                await self._answer_of(pending, pending.accepted, timeout)
            return await self._answer_of(pending, pending.outcome, None)  # type: ignore[no-any-return]
        except (asyncio.CancelledError, RunFailed):
            self._requests.cancel(pending.request.id, "requester gave up")
            raise

    async def _answer_of(self, pending: Pending, answer: Awaitable[Any], timeout: Seconds | None) -> Any:
        try:
            return await asyncio.wait_for(answer, timeout)
        except TimeoutError as error:
            reason, advice = f"no answer within {timeout} s", f"is {pending.server} running?"
            fault = Fault(reason=reason, where=pending.request.id, advice=advice, service=pending.server)
            raise RunFailed(fault) from error
        except RequestRefused as error:
            raise InputRefused(error.fault) from error

    def _request_id(self, subject: str) -> str:
        return f"{self._bus.name}/{subject}#{next(self._numbers)}"

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

    def faults(self) -> Feed[Fault]:
        """Follow the faults that services tell of: bad messages, and errors while one was taken."""
        return self._feed((Fault,), keys.ANY_FAULT)

    def worlds(self) -> Feed[World]:
        """Follow the world: now, if anything is perceived, and whenever it has changed. Only the newest is kept."""
        return self._feed((World,), keys.WORLD, keep=Keep.LATEST)

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
        taken(timeout, Seconds | None, "timeout")
        with self.worlds() as worlds:
            return in_time(await worlds.next(timeout), "world", timeout)

    async def person(self, timeout: Seconds | None = None) -> Entity:
        """Return the person who is there, or the first to come.

        timeout: seconds to wait; None: for ever.

        Raises:
            InputRefused: `timeout` is no number.
            NoReply: nobody within `timeout`.
        """
        taken(timeout, Seconds | None, "timeout")
        deadline = None if timeout is None else self.now() + timeout
        with self.worlds() as worlds:
            while True:
                left = None if deadline is None else max(0.0, deadline - self.now())
                world = in_time(await worlds.next(left), "person in the world", timeout)
                if world.people:
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
        taken(timeout, Seconds | None, "timeout")
        with self.statistics_updates(actor) as feed:
            return in_time(await feed.next(timeout), f"statistics of {actor}", timeout)

    def _feed(self, kinds: tuple[type, ...], *patterns: str, keep: Keep = Keep.EVERY) -> Feed[Any]:
        self._requests.check()
        return Feed(self._bus.subscribe(*patterns, keep=keep), kinds, self._bus.now)

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


def _without_an_answer(outcome: FragmentOutcome) -> FragmentOutcome:
    """The outcome of a fragment that was performed, but of which nobody will tell how it was answered."""
    events = tuple(replace(each, state="lost") if each.state == "started" else each for each in outcome.events)
    return replace(outcome, events=events)


def _still_held(block: str, behavior: str, held_with: Literal["block", "robot"]) -> Fault:
    where = f"{block}: {behavior}" if behavior else block
    if held_with == "robot":
        advice = "let the robot go on: `engage steer continue`, or `resume()`"
        return Fault(reason="still held, because the whole robot is", where=where, advice=advice)
    advice = f"let the block go on: `engage steer continue {block}`, or `resume({block!r})`"
    return Fault(reason=f"still held, because all of block {block} is", where=where, advice=advice)
