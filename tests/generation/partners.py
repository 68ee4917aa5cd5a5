"""The other sides of the generation service, played by hand: a body that answers estimates, a realizer on cue."""

import asyncio
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from functools import partial
from typing import Any

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Gaze, GazeShift, Pointing
from engage_hri.schemas.blocks import (
    Block,
    BlockOutcome,
    BlockProgress,
    PerformBlock,
    SyncPointProgress,
    WarningFeedback,
)
from engage_hri.schemas.body import (
    AbortBehavior,
    BehaviorAborted,
    BodyPose,
    Capabilities,
    DescribeBody,
    Estimate,
    EstimateBehaviors,
    Estimates,
    JointAngle,
    Ray,
)
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.fragments import HeadOwner, PerformFragment, TurnFragment
from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import ActionBegan
from engage_hri.schemas.recognition import (
    ConnectionEvent,
    Interjection,
    InterjectionReading,
    SignalTurn,
    TurnOutcome,
)
from engage_hri.schemas.requests import Cancel
from engage_hri.schemas.units import Stamp, Vector
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.service import generate
from engage_hri.services.requests.ends import Pending, RequestDesk, Requester
from engage_hri.services.runtime.service import Ready, running

EYES: Vector = (0.0, 0.0, 1.2)
HUMAN = Entity(id="human", kind="person", position=(1.3, 0.0, 1.2))


def piece(id: str, x: float, y: float, radius: float = 0.02) -> Entity:
    return Entity(id=id, kind="object", position=(x, y, 0.72), radius=radius)


TABLE = World(
    entities=(
        HUMAN,
        Entity(id="table", kind="surface", position=(0.6, 0.0, 0.72)),
        piece("left", 0.5, 0.4),
        piece("middle", 0.6, 0.0),
        piece("right", 0.5, -0.4),
    )
)


def ray(origin: Vector, target: Vector, tip: Vector | None = None) -> Ray:
    reach = tuple(b - a for a, b in zip(origin, target, strict=True))
    length = sum(part * part for part in reach) ** 0.5
    x, y, z = (part / length for part in reach)
    return Ray(origin=origin, axis=(x, y, z), tip=tip)


def estimates(world: World, head: float = 20.0, arm: float = 60.0) -> Any:
    """A body whose every motion to another target takes `head` and `arm` degrees."""

    def estimate(behavior: Any, pose: BodyPose | None) -> Estimate:
        entity = world.entity(behavior.target)
        if entity is None:
            return Estimate(behavior=behavior.id, feasible=False, fault=Fault(reason="no such target"))
        stays = pose is not None and pose.joints[0].joint == behavior.target
        after = BodyPose(joints=(JointAngle(behavior.target, 0.0),))
        if isinstance(behavior, Pointing):
            side = "left_arm" if entity.position[1] > 0 else "right_arm"
            hand = (0.2, 0.15 if side == "left_arm" else -0.15, 0.85)
            axis = ray(hand, entity.position, hand)
            degrees = 0.0 if stays else arm
            return Estimate(
                behavior=behavior.id, feasible=True, parts=(side,), arm_degrees=degrees, ray=axis, pose_after=after
            )
        degrees = 0.0 if stays else head
        axis = ray(EYES, entity.position)
        return Estimate(
            behavior=behavior.id, feasible=True, parts=("head",), head_degrees=degrees, ray=axis, pose_after=after
        )

    def answer(question: Message) -> Message:
        assert isinstance(question, EstimateBehaviors)
        return Estimates(items=tuple(estimate(item.behavior, item.pose) for item in question.items))

    return answer


class Partners:
    """Plays perception, body, realizer and recognition, and sends fragments. Everything heard is in `heard`."""

    def __init__(self, bus: Bus, client: Bus, realizer: Bus) -> None:
        self.bus = bus
        self.client = client
        self.realizer = realizer
        self.requests = Requester(client)
        self.desk = RequestDesk(realizer, "realizer", lambda cancel: None)
        self.turns = RequestDesk(bus, "recognition", lambda cancel: None)
        self.body = RequestDesk(bus, "control", lambda cancel: None)
        self.blocks: list[PerformBlock] = []
        self.cancelled: list[str] = []
        self.owners: list[HeadOwner] = []
        self.signals: list[SignalTurn] = []
        self.aborts: list[AbortBehavior] = []
        self.faults: list[Fault] = []
        self.warnings: list[WarningFeedback] = []
        self.refusal: Fault | None = None
        """How the realizer answers blocks; None: it takes them."""
        self.shifts_arrive = True
        """False: gaze shifts stay on their way."""
        self.told = asyncio.Event()

    async def listen(self) -> None:
        patterns = (*RequestDesk.patterns("realizer"), keys.TURN, keys.HEAD_OWNER, keys.BEHAVIOR, keys.ANY_FAULT)
        with self.bus.subscribe(*patterns, keys.ANY_REQUEST_STATE, keys.FRAGMENT_FEEDBACK) as inbox:
            async for received in inbox:
                self.requests.feed(received)
                match self.desk.take(received):
                    case PerformBlock() as request if self.refusal is not None:
                        self.desk.refuse(request.id, self.refusal)
                    case PerformBlock() as request:
                        self.blocks.append(request)
                        self.desk.accept(request.id)
                        if self.shifts_arrive and isinstance(request.block.behaviors[0], GazeShift):
                            self.end(request)
                    case Cancel(id=id):
                        self.cancelled.append(id)
                        self.end(next(block for block in self.blocks if block.id == id), "interrupted")
                match received.message:
                    case HeadOwner() as owner:
                        self.owners.append(owner)
                    case SignalTurn() as signal:
                        if self.turns.take(received):
                            self.signals.append(signal)
                            self.turns.end(TurnOutcome(id=signal.id, at=self.bus.stamp()))
                    case AbortBehavior() as abort:
                        if self.body.take(received):
                            self.aborts.append(abort)
                            self.body.end(BehaviorAborted(id=abort.id))
                    case WarningFeedback() as warning:
                        self.warnings.append(warning)
                    case Fault() as fault:
                        self.faults.append(fault)
                self.told.set()

    async def fragment_block(self, id: str) -> Block:
        """The block of fragment `id`, once it has come."""
        while True:
            self.told.clear()
            for request in self.blocks:
                if request.block.id == id:
                    return request.block
            await self.told.wait()

    def request(self, id: str) -> PerformBlock:
        return next(request for request in self.blocks if request.block.id == id)

    @property
    def shifts(self) -> list[tuple[str, str]]:
        """Gaze shifts of the arbiter: kind of block and target."""
        return [
            (request.block.id.rpartition("-")[0], request.block.behaviors[0].target)
            for request in self.blocks
            if isinstance(request.block.behaviors[0], GazeShift)
        ]

    def send(self, fragment: TurnFragment, id: str = "") -> Pending:
        request = PerformFragment(id=id or f"ask-{fragment.id}", requester=self.client.name, fragment=fragment)
        return self.requests.send(keys.FRAGMENT, request)

    def reach(self, block: str, behavior: str, sync: str) -> None:
        now = self.realizer.stamp()
        progress = SyncPointProgress(block=block, behavior=behavior, sync=sync, at=now, time=0.0)
        self.realizer.publish(keys.FEEDBACK, progress)

    def end(self, request: PerformBlock, status: Any = "done", **fields: Any) -> None:
        block = request.block.id
        now = self.realizer.stamp()
        self.realizer.publish(keys.FEEDBACK, BlockProgress(block=block, progress="end", at=now, status=status))
        self.desk.end(BlockOutcome(id=request.id, block=block, status=status, **fields))

    def event(self, id: str, state: Any, **fields: Any) -> None:
        now = self.bus.stamp()
        fields = {"kind": "directed_gaze", "initiator": "robot", "responder": "human", **fields}
        event = ConnectionEvent(id=id, state=state, at=now, started=now, **fields)
        self.bus.publish(keys.connection_event("human", event.kind), event)

    def interjects(self, reading: InterjectionReading) -> None:
        """Tell what the human says into the robot's turn, from 1.0 on."""
        told = Interjection(actor="human", since=Stamp("loop", 1.0), at=self.bus.stamp(), reading=reading)
        self.bus.publish(keys.interjection("human"), told)

    def speaks(self, actor: str) -> None:
        key = keys.ROBOT_ACTION if actor == "robot" else keys.PERCEIVED_ACTION
        self.bus.publish(key, ActionBegan(actor=actor, action="speak", at=self.bus.stamp()))

    def see(self, world: World) -> None:
        self.bus.publish(keys.WORLD, world)


@asynccontextmanager
async def stage(
    hub: MemoryHub,
    config: GenerationConfig | None = None,
    world: World | None = TABLE,
    costs: Mapping[str, float] | None = None,
) -> AsyncIterator[Partners]:
    """The generation service among its partners. config: None: the defaults, but that the head does not look away."""

    async def body(bus: Bus, ready: Ready) -> None:
        bus.answer(keys.DESCRIBE, lambda question: _described(question))
        bus.answer(keys.ESTIMATE, estimates(world or TABLE, **(costs or {})))
        ready()
        await asyncio.get_running_loop().create_future()

    ours, client, realizer = hub.join("test"), hub.join("manager"), hub.join("realizer")
    partners = Partners(ours, client, realizer)
    if world is not None:
        partners.see(world)
    config = config or GenerationConfig(policies_off=("aversion",))
    services = {"control": body, "generation": partial(generate, config=config)}
    async with running(hub, services):
        listening = asyncio.create_task(partners.listen())
        for bus in (client, realizer):
            bus.declare_alive()
        await asyncio.sleep(0)
        try:
            yield partners
        finally:
            partners.requests.close()
            partners.desk.close()
            partners.turns.close()
            listening.cancel()
            await asyncio.gather(listening, return_exceptions=True)


def _described(question: Message) -> Message:
    assert isinstance(question, DescribeBody)
    return Capabilities(body="paper", types=("gaze", "pointing", "speech"), parts=("head",), gaze_half_angle=0.1)


def gaze_targets(block: Block) -> list[str]:
    return [behavior.target for behavior in block.behaviors if isinstance(behavior, Gaze)]
