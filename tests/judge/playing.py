"""A story performed by the realizer and the simulated body in virtual time. Nothing here judges.

Of the services only what starts them is imported; everything that is recorded came over the bus, as any client gets
it, or from `Body.state()`, the measurements that `RobotState` publishes.
"""

import asyncio
import logging
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import partial

import msgspec

from engage_hri.schemas import keys
from engage_hri.schemas.blocks import Block, BlockOutcome, Feedback, InterruptBehavior, PerformBlock
from engage_hri.schemas.body import EstimateBehaviors, EstimateItem, Estimates, SyncPointReached, WordSpoken
from engage_hri.schemas.documents.xml_decode import decode_xml
from engage_hri.schemas.faults import EngageError, RequestRefused
from engage_hri.services.bus.interface import LOG, Bus
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.control.config import ControlConfig, Variability
from engage_hri.services.control.contract.body import Body
from engage_hri.services.control.service import embody
from engage_hri.services.control.torso.body import SimulatedBody
from engage_hri.services.realizer.config import RealizerConfig
from engage_hri.services.realizer.service import realize
from engage_hri.services.requests.ends import Pending, Requester
from engage_hri.services.runtime.service import Service, running, serve
from engage_hri.services.runtime.virtual_time import VirtualTimeLoop
from tests.judge.lying import Lies, LyingBody
from tests.judge.record import End, Record, Sample, Steered, Told
from tests.judge.story import WORLD, Deed, Story
from tests.realizer.steering import steer

STEP = 0.02
"""Seconds between two measurements; each sync point is one more."""
BOUND = 180.0
"""Seconds after the last deed within which everything has to have ended; no block of ours needs half of that."""
SETTLING = 5.0
"""Seconds after that in which all parts have to come home."""


def play(story: Story, *, asks: bool = False) -> Record:
    """Perform a story. asks: ask the body first what each behavior would take.

    If parts of it are held, it is performed without the holds as well, to see what is late for them alone.
    """
    record = Record()
    if story.is_held:
        calm = play(story.let_go())
        record.late_anyhow = {(block, it.behavior) for block in calm.ends for it in calm.late(block)}
        record.refused_anyhow = {block for block in calm.ends if calm.status(block) == "refused"}
    bugs = _Bugs(record)
    LOG.addHandler(bugs)
    before, LOG.propagate = LOG.propagate, False
    try:
        with asyncio.Runner(loop_factory=partial(VirtualTimeLoop, limit=3600.0)) as runner:
            runner.run(_play(story, record, asks=asks))
    except Exception as error:
        record.errors.append(f"{type(error).__name__}: {error}")
    finally:
        LOG.propagate = before
        LOG.removeHandler(bugs)
    return record


class _Bugs(logging.Handler):
    def __init__(self, record: Record) -> None:
        super().__init__(logging.ERROR)
        self.record = record

    def emit(self, record: logging.LogRecord) -> None:
        self.record.errors.append(logging.Formatter().format(record))


class Player:
    """The client: does one deed after the other, and notes how each of its requests ends."""

    def __init__(self, requests: Requester, record: Record) -> None:
        self.requests = requests
        self.record = record
        self.pending: dict[str, Pending] = {}
        self.lives: dict[str, int] = {}
        """For each id, the number of blocks that were asked for."""
        self.is_over = False
        """True once nobody waits for ends any more."""
        self._number = 0

    def do(self, deed: Deed) -> None:
        """Do one deed. Each kind of `story.DeedKind` has its case."""
        match deed.kind:
            case "perform":
                block = decode_xml(deed.xml)
                assert isinstance(block, Block)
                number = self.lives[deed.block] = self.lives.get(deed.block, 0) + 1
                id = f"r-{deed.block}-{number}"
                request = PerformBlock(id=id, requester="judge", block=block, follows=deed.follows)
                self.pending[deed.block] = asked = self.requests.send(keys.BLOCK, request)
                self.record.asked[deed.block] = asyncio.get_running_loop().time()
                asked.outcome.add_done_callback(partial(self._ended, deed.block))
            case "cancel":
                self.requests.cancel(f"r-{deed.block}-{self.lives[deed.block]}")
            case "interrupt":
                self._number += 1
                id = f"i-{self._number}"
                deeds = InterruptBehavior(id=id, requester="judge", block=deed.block, behavior=deed.behavior)
                self.requests.send(keys.BLOCK, deeds)
            case "hold" | "continue":
                self._number += 1
                steering = steer(f"s-{self._number}", deed.kind, deed.block, deed.behavior)
                asked = self.requests.send(*steering)
                asked.outcome.add_done_callback(partial(self._steered, deed))

    def _steered(self, deed: Deed, future: "asyncio.Future[object]") -> None:
        if not future.cancelled() and future.exception() is None:
            now = asyncio.get_running_loop().time()
            self.record.steered.append(Steered(now, deed.kind == "hold", deed.block, deed.behavior))

    def _ended(self, block: str, future: "asyncio.Future[object]") -> None:
        if future.cancelled() or self.is_over:
            return
        now, error = asyncio.get_running_loop().time(), future.exception()
        if isinstance(error, RequestRefused):
            end = End(now, "refused", reason=str(error))
        elif isinstance(outcome := None if error else future.result(), BlockOutcome):
            end = End(now, outcome.status, outcome, str(outcome.fault or ""))
        else:
            end = End(now, "lost", reason=str(error or outcome))
        self.record.ends.setdefault(block, []).append(end)


async def _play(story: Story, record: Record, *, asks: bool) -> None:
    loop = asyncio.get_running_loop()
    async with _robot(story, record) as (bus, requests):
        if asks:
            await _ask(story, bus, record)
        player, began = Player(requests, record), loop.time()
        for deed in story.deeds:
            await asyncio.sleep(began + deed.at - loop.time())
            player.do(deed)
        outcomes = [each.outcome for each in player.pending.values()]
        await asyncio.wait(outcomes, timeout=BOUND)
        player.is_over = True
        await asyncio.sleep(SETTLING)


@asynccontextmanager
async def _robot(story: Story, record: Record) -> AsyncIterator[tuple[Bus, Requester]]:
    variability = msgspec.convert(story.faults, Variability)
    async with MemoryHub() as hub:
        eyes, bus = hub.join("simulation"), hub.join("judge")
        eyes.publish(keys.WORLD, WORLD)
        lies = msgspec.convert(story.lies, Lies)
        body = LyingBody(SimulatedBody(deviations=variability), lies)
        record.joints = tuple(angle.joint for angle in body.state().pose.joints)
        control = partial(embody, config=ControlConfig(variability=variability, state_rate=1.0), body=body)
        services = {
            "control": control,
            "realizer": partial(realize, config=RealizerConfig()),
        }
        async with running(hub, services), Requester(bus) as requests:
            tasks = [
                asyncio.create_task(_listen(bus, body, record), name="listen"),
                asyncio.create_task(_measure(body, record), name="measure"),
                asyncio.create_task(_vanish(hub, control, lies), name="vanish"),
            ]
            try:
                yield bus, requests
            finally:
                for task in tasks:
                    task.cancel()
                await asyncio.gather(*tasks, return_exceptions=True)
        await bus.leave()
        await eyes.leave()


async def _vanish(hub: MemoryHub, control: Service, lies: Lies) -> None:
    """Take the body from the bus for a while, as if its process had died."""
    if lies.gone is None:
        return
    await asyncio.sleep(lies.gone)
    hub.kill("control")
    if lies.back is not None:
        await asyncio.sleep(lies.back - lies.gone)
        await serve(hub, "control", control)


async def _ask(story: Story, bus: Bus, record: Record) -> None:
    for deed in story.blocks:
        block = decode_xml(deed.xml)
        assert isinstance(block, Block)
        items = tuple(EstimateItem(behavior=each) for each in block.behaviors)
        try:
            answer = await bus.query(keys.ESTIMATE, EstimateBehaviors(items=items), timeout=2.0)
        except EngageError as error:
            record.errors.append(str(error))
            continue
        assert isinstance(answer, Estimates)
        for each in answer.items:
            phases = tuple((it.since, it.to, it.natural, it.hold) for it in each.phases)
            record.natural[deed.block, each.behavior] = phases


async def _listen(bus: Bus, body: Body, record: Record) -> None:
    with bus.subscribe(keys.FEEDBACK, keys.SYNC_POINT) as inbox:
        async for received in inbox:
            match received.message:
                case SyncPointReached() as reached:
                    record.reported.append(reached)
                    _note(body, record)
                case WordSpoken() as word:
                    record.words.append(word)
                case message if isinstance(message, Feedback):
                    record.told.append(Told(asyncio.get_running_loop().time(), message))


async def _measure(body: Body, record: Record) -> None:
    while True:
        _note(body, record)
        await asyncio.sleep(STEP)


def _note(body: Body, record: Record) -> None:
    now = asyncio.get_running_loop().time()
    if not record.samples or now > record.samples[-1].at:
        state = body.state()
        joints = tuple(angle.angle for angle in state.pose.joints)
        arms = (state.left_arm, state.right_arm)
        record.samples.append(Sample(now, joints, state.gaze, arms, state.moving))
