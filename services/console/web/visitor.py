"""Visitors: each is somebody at a browser, whose orders are carried out here."""

import asyncio
from collections.abc import AsyncIterator, Coroutine, Iterator
from contextlib import asynccontextmanager, contextmanager
from functools import partial
from itertools import count
from typing import Any

from msgspec.structs import replace

from engage_hri.schemas.blocks import Block
from engage_hri.schemas.faults import EngageError, Fault, InputRefused
from engage_hri.schemas.fragments import FragmentOutcome
from engage_hri.schemas.summary import summary
from engage_hri.schemas.units import Seconds, Vector
from engage_hri.services.client.chunking import parts_of
from engage_hri.services.client.inputs import fragment_in
from engage_hri.services.client.people.perceive import check_id, perceive
from engage_hri.services.client.people.perceived_person import PerceivedPerson, free_seat, not_a_thing
from engage_hri.services.console.web import orders
from engage_hri.services.console.web.frames import Receipts, Viewer, You
from engage_hri.services.console.web.orders import Panel
from engage_hri.services.console.web.own_look import OwnLook
from engage_hri.services.console.web.scene import laid
from engage_hri.services.console.web.seats import SETTLED, Invitation
from engage_hri.services.console.web.service import WindowServer
from engage_hri.services.console.web.stage import StageFace
from engage_hri.services.text.marks import Ids

REACH: Seconds = 0.9
"""Time that a person takes to lay a thing elsewhere."""
PATIENCE: Seconds = 5.0
"""Time that the robot has to accept what it is asked for."""


class Visitor:
    """The one at a browser. trusted: the page was called with the token of the window.

    stage: what the stage shows, for a page of it, from which nobody does more than sit down; None: of the workshop.
    """

    def __init__(
        self, window: WindowServer, trusted: bool, receipts: Receipts, stage: StageFace | None = None
    ) -> None:
        self._window = window
        self.receipts = receipts
        self._stage = stage
        self._denied = orders.denied(window.bus.role, trusted, keyed=window.keyed, stage=stage is not None)
        self._tasks: set[asyncio.Task[None]] = set()
        self._person: PerceivedPerson | None = None
        self._look: OwnLook
        """Of that person, or of the last one; only a seat gives one."""
        self._sitting: asyncio.Task[None] | None = None
        self._stands_up = asyncio.Event()
        self._lets_go = asyncio.Event()
        self._inhibits = False
        self._acting: asyncio.Task[None] | None = None

    @property
    def person(self) -> str:
        """Id of the person that they are; empty: none."""
        return self._person.id if self._person else ""

    @contextmanager
    def seen(self) -> Iterator[OwnLook]:
        """Let a camera see them, who have a seat, while the body of `with` runs. Gives what is to be told of that."""
        look = self._look
        try:
            yield look
        finally:
            look.unseen()

    @property
    def you(self) -> You:
        if self._stage is not None:
            return You(person=self._person.id if self._person else "", denied=self._denied)
        body = self._window.picture.body
        invited = Invitation("", "") if self._person else self._window.invitation
        return You(
            person=self.person,
            there=invited.there,
            sit=invited.button,
            denied=self._denied,
            script=self._window.script.titles,
            faults=body.faults if body else (),
            inhibits=self._inhibits,
        )

    def frame(self, viewer: Viewer) -> bytes | None:
        """The next frame for this viewer."""
        picture, now = self._window.picture, self._window.bus.now()
        picture.advance(now)
        return viewer.frame(self._stage or picture, now, self.you, self.receipts)

    def take(self, given: orders.Given) -> None:
        """Carry out an order, or begin to; what fails is told."""
        panel: Panel = "part"
        try:
            order = orders.decoded(given.order)
            panel = orders.panel(order)
            if reason := self._denied.get(order.needs, ""):
                raise InputRefused(Fault(reason=reason, where="not allowed"))
            if given.until is not None and self._window.seconds > given.until:
                raise InputRefused(Fault(reason="it came too late"))
            if isinstance(order, orders.SeatOrder):
                self._be(order)
            else:
                self._drive(order)
        except EngageError as error:
            self.receipts.tell(panel, str(error), refused=given.number)

    async def leave(self) -> None:
        """End all that this visitor does. The person leaves, and a lease on the gaze ends."""
        for task in self._tasks:
            task.cancel()
        if self._tasks:
            await asyncio.wait(self._tasks)

    # -- a person -------------------------------------------------------------------------------------------------

    def _be(self, order: orders.SeatOrder) -> None:
        if isinstance(order, orders.SitOrder):
            if self._sitting is not None and not self._sitting.done():
                raise InputRefused(Fault(reason="you have a seat, or are about to", advice="leave it first"))
            self._stands_up.clear()
            self._sitting = self._begin(self._sit(order.name.strip()))
            return
        if self._person is None:
            raise InputRefused(Fault(reason="you have no seat", advice="take a seat first"))
        match order:
            case orders.LeaveOrder():
                self._stands_up.set()
            case orders.LookOrder(target=target):
                self._look.at(target)
            case orders.PointAt(target=target):
                self._begin(self._person.point_at(target))
            case orders.MoveHead(how=how):
                self._begin(self._person.nod() if how == "nod" else self._person.shake())
            case orders.Speak(on=on):
                self._person.begin("speak") if on else self._person.end("speak")
            case orders.Type(text=text):
                self._begin(self._person.type(text))
            case orders.Move(thing=thing, x=x, y=y):
                self._lay(self._person, thing, x, y)

    async def _sit(self, wanted: str) -> None:
        async with self._seat(wanted) as (name, position):
            try:
                async with perceive(name, hub=self._window.hub, position=position) as person:
                    look = OwnLook(person, self._window.bus.robot, position)
                    self._person, self._look = person, look
                    try:
                        await self._stands_up.wait()
                    finally:
                        look.close()
            finally:
                self._person = None

    @asynccontextmanager
    async def _seat(self, wanted: str) -> AsyncIterator[tuple[str, Vector]]:
        """Take a name, and a place before the robot, that nobody has, in no window either. Raises InputRefused."""
        seats, window = self._window.seats, self._window
        for tries in count():
            name = seats.name(wanted, {each.id for each in window.picture.world.people})
            for other in ("all", window.bus.robot):
                check_id(name, other)
            not_a_thing(name, window.picture.world)
            claim = seats.claim(name, tries)
            bus = window.hub.join(claim, role="perception")
            try:
                bus.declare_alive()
                await asyncio.sleep(SETTLED)
                if seats.is_first(claim):
                    people = {each.id: each.position for each in window.picture.world.people}
                    yield name, free_seat([*people.values()], skip=seats.before(claim, people))
                    return
            finally:
                seats.give_up(claim)
                await bus.leave()

    def _lay(self, person: PerceivedPerson, thing: str, x: float, y: float) -> None:
        if self._acting is not None and not self._acting.done():
            raise InputRefused(Fault(reason="your hand is on its way", advice="one thing after the other"))
        there = laid(self._window.picture.world, thing, x, y)
        if there is None:
            raise InputRefused(Fault(reason=f"{thing!r} is nothing that can be moved", where=person.id))

        async def act() -> None:
            self._look.at(thing)
            await person.act(thing, to=there.position, seconds=REACH)
            now = next((each for each in person.world if each.id == thing), there)
            if now.yaw != there.yaw:
                person.bring(replace(now, position=there.position, yaw=there.yaw))

        self._acting = self._begin(act())

    # -- the robot by hand ----------------------------------------------------------------------------------------

    def _drive(self, order: orders.PageOrder) -> None:
        by = getattr(order, "by", "") or "somebody"
        self._window.log(f"{by}: {orders.written(order)}")
        if (server := orders.server(order)) and not self._window.picture.has(server):
            self.receipts.tell("wizard", f"{server} is not on the bus: this waits for it, {PATIENCE:g} s at most")
        robot = self._window.robot
        match order:
            case orders.Tell(text=text, target=target):
                parts, left_out = parts_of(text, Ids([each.id for each in self._window.picture.world.objects]))
                if not parts and not target:
                    advice = "; ".join(left_out) or "write words, or choose an object"
                    raise InputRefused(Fault(reason="nothing to say", advice=advice))
                if left_out:
                    self.receipts.tell("wizard", "; ".join(left_out))
                self._drives(self._perform(orders.told(order, parts)))
            case orders.Prepared(number=number, addressee=addressee):
                if number >= len(self._window.script):
                    raise InputRefused(Fault(reason=f"the script has no fragment {number + 1}"))
                self._drives(self._perform(self._window.script.take(number, addressee)))
            case orders.BackchannelOrder(how=how, addressee=addressee):
                self._drives(self._perform(orders.backchannel(how, addressee)))
            case orders.InhibitGaze(on=True, mode=mode, target=target):
                if self._inhibits:
                    raise InputRefused(Fault(reason="you keep the gaze already", advice="let it go first"))
                self._lets_go.clear()
                self._drives(self._inhibit(mode, target))
            case orders.InhibitGaze():
                self._lets_go.set()
            case orders.SteerOrder(to="hold"):
                self._drives(self._steered("held", robot.hold(timeout=PATIENCE)))
            case orders.SteerOrder(to="continue"):
                self._drives(self._steered("goes on", robot.resume(timeout=PATIENCE)))
            case orders.SteerOrder(to="stop"):
                self._drives(self._steered("stopped", robot.stop(timeout=PATIENCE)))
            case orders.SwitchOrder(fault=fault, off=off):
                switch = robot.switch_off if off else robot.switch_on
                self._drives(_done(switch(fault, timeout=PATIENCE)))
            case orders.ConditionOrder(name=name, speech_only=speech_only, by=who):
                named = name.strip()
                self._drives(_done(robot.set_condition(named, speech_only=speech_only, by=who, timeout=PATIENCE)))

    def _drives(self, work: Coroutine[Any, Any, None]) -> None:
        self._begin(work, "wizard")

    async def _perform(self, thing: Any) -> None:
        if isinstance(thing, Block):
            await self._window.robot.realize(thing, timeout=PATIENCE)
            return
        fragment = fragment_in(thing, self._window.new_id())
        outcome = await self._window.robot.perform(fragment, timeout=PATIENCE)
        if isinstance(outcome, FragmentOutcome) and (problems := summary(outcome).problems):
            self.receipts.tell("wizard", "; ".join(problems))

    async def _steered(self, verb: str, work: Coroutine[Any, Any, tuple[str, ...]]) -> None:
        blocks = await work
        self.receipts.tell(
            "wizard", f"{verb}: {self._window.picture.in_words(blocks) or 'nothing is being performed'}"
        )

    async def _inhibit(self, mode: Any, target: str) -> None:
        async with self._window.robot.inhibit_gaze(mode, target=target, timeout=PATIENCE):
            self._inhibits = True
            try:
                await self._lets_go.wait()
            finally:
                self._inhibits = False

    def _begin(self, work: Coroutine[Any, Any, None], panel: Panel = "part") -> asyncio.Task[None]:
        async def contained() -> None:
            try:
                await work
            except EngageError as error:
                self.receipts.tell(panel, str(error))

        task = asyncio.create_task(contained(), name="visitor")
        self._tasks.add(task)
        task.add_done_callback(partial(self._ended, work))
        return task

    def _ended(self, work: Coroutine[Any, Any, None], task: asyncio.Task[None]) -> None:
        work.close()  # it has not begun if the visitor left in the very instant of the order
        self._tasks.discard(task)
        if not task.cancelled() and (error := task.exception()) is not None:
            self._window.bus.failed(error, "an order of the page")


async def _done(work: Coroutine[Any, Any, Any]) -> None:
    await work
