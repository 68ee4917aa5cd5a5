"""What is tied together, how far apart it comes; and how long it all takes: closed loop against a fixed schedule.

The same blocks, planned alike from the same estimates, on the same simulated body, in virtual time. The fixed
schedule sends every command at the instant that the plan had for it, as realizers do that take a clock for a body.
The body varies: joints slower or faster than it believes, one that stalls, one that is there already. With the extra
`mujoco` also the same torso with physics: stiff gears, a motor without current for a second, an arm that is near
already.
Skew is from the first to the last point of an instant that behaviors share, as measured by the body.
"""

import argparse
import asyncio
import json
import sys
from collections.abc import AsyncGenerator, AsyncIterator, Mapping, Sequence
from contextlib import aclosing, asynccontextmanager
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from statistics import mean

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from msgspec import Struct

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import (
    After,
    Before,
    BlockBehavior,
    Constraint,
    Gaze,
    Gesture,
    Head,
    Mark,
    Pointing,
    Speech,
    Synchronize,
)
from engage_hri.schemas.blocks import Block, BlockOutcome, PerformBlock
from engage_hri.schemas.body import PerformBehavior, SyncPointReached
from engage_hri.schemas.body_faults import BodyFault
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.control.config import ControlConfig, Displaced, Slow, Stall, Variability
from engage_hri.services.control.contract.body import Body, MovementAuthority, Progress
from engage_hri.services.control.service import embody
from engage_hri.services.realizer.config import RealizerConfig
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.points import Point
from engage_hri.services.realizer.service import realize
from engage_hri.services.realizer.together.planning import planned_alone
from engage_hri.services.requests.ends import Requester
from engage_hri.services.runtime.service import running
from engage_hri.services.runtime.virtual_time import run_virtual

WORLD = World(
    entities=(
        Entity(id="human", kind="person", position=(1.3, 0.0, 1.2)),
        Entity(id="red", kind="object", position=(0.50, -0.20, 0.73), radius=0.03),
        Entity(id="blue", kind="object", position=(0.45, -0.30, 0.73), radius=0.03),
    )
)
PARTS = ("head", "left_arm", "right_arm")


def block(id: str, behaviors: Sequence[BlockBehavior], *ties: Synchronize | After | Before) -> Block:
    return Block(id=id, behaviors=tuple(behaviors), constraints=(Constraint(operators=ties),))


def together(*points: str) -> Synchronize:
    return Synchronize(syncs=points)


FIGURE_4_4 = block(
    "figure-4.4",
    (
        Gaze(id="gaze", target="red"),
        Pointing(id="point", target="red", mode="RIGHT_HAND"),
        Speech(id="say", text="This can?"),
    ),
    together("gaze:stroke", "point:start"),
    together("point:stroke_start", "say:start"),
)
STROKE_ON_A_WORD = block(
    "stroke-on-a-word",
    (
        Gaze(id="gaze", target="blue"),
        Pointing(id="point", target="blue", mode="RIGHT_HAND"),
        Speech(id="say", text="Now take this one and turn it", marks=(Mark("this", 9), Mark("turn", 21))),
        Head(id="nod", lexeme="NOD"),
    ),
    together("gaze:stroke", "say:this"),
    together("point:stroke", "say:this"),
    together("nod:stroke_start", "say:turn"),
)
THREE_PHRASES = block(
    "three-phrases",
    (
        Speech(id="one", text="There is a red piece"),
        Pointing(id="point-1", target="red", mode="RIGHT_HAND"),
        Speech(id="two", text="and there is a blue one"),
        Pointing(id="point-2", target="blue", mode="RIGHT_HAND"),
        Speech(id="three", text="which go together"),
        Gesture(id="beat", lexeme="BEAT", mode="LEFT_HAND"),
        Gaze(id="look", target="human"),
    ),
    together("point-1:stroke_start", "one:start"),
    After(ref="point-1:stroke_end", syncs=("point-2:start",)),
    together("point-2:stroke_start", "two:start"),
    After(ref="one:end", syncs=("two:start",)),
    together("beat:stroke_start", "three:start", "look:stroke"),
    After(ref="two:end", syncs=("three:start",)),
)
BLOCKS = (FIGURE_4_4, STROKE_ON_A_WORD, THREE_PHRASES)


def slow(factor: float) -> Variability:
    return Variability(slow=tuple(Slow(part=part, factor=factor) for part in PARTS))


SWEEP: Mapping[str, "Variability | Physical"] = {
    "0.7x": slow(0.7), "1x": slow(1.0), "1.5x": slow(1.5), "2x": slow(2.0), "3x": slow(3.0), "4x": slow(4.0),
    "noise 20 %": Variability(noise=0.2),
    "stall 1 s": Variability(stall=(Stall(part="right_arm", before="stroke_start", seconds=1.0),)),
    "near already": Variability(displaced=(Displaced(joint="right_shoulder_pitch", angle=15.0),)),
}  # fmt: skip


class Physical(Struct, frozen=True):
    """The torso with physics. faults: that it has. seconds: how long each of the robot's pointings has them, from its
    first moment on; None: all the time."""

    faults: tuple[BodyFault, ...] = ()
    seconds: Seconds | None = None


Deviation = Variability | Physical
if find_spec("mujoco"):
    near = (
        BodyFault(kind="displaced", part="right_shoulder_pitch", amount=20.0),
        BodyFault(kind="displaced", part="right_elbow", amount=95.0),
    )
    SWEEP = {
        **SWEEP,
        "physics": Physical(),
        "gears 2x": Physical((BodyFault(kind="slow", amount=2.0),)),
        "gears 4x": Physical((BodyFault(kind="slow", amount=4.0),)),
        "no current 1 s": Physical((BodyFault(kind="stalled", part="right_arm"),), seconds=1.0),
        "near, physics": Physical(near),
    }


class Run(Struct, frozen=True):
    """skews: of every instant that is shared. total: from the first point to the last."""

    skews: tuple[Seconds, ...]
    total: Seconds


async def in_closed_loop(block: Block, plan: Plan, bus: Bus, requests: Requester) -> None:
    outcome = await requests.send(keys.BLOCK, PerformBlock(id=block.id, requester=bus.name, block=block)).outcome
    assert isinstance(outcome, BlockOutcome)
    assert outcome.status == "done"


async def by_the_clock(block: Block, plan: Plan, bus: Bus, requests: Requester) -> None:
    """Every start and every leaving of a hold point at its planned instant, whatever the body says.

    Only words wait for the words before them: there is one voice.
    """
    began = bus.now()
    commands = [member for members in plan.members for member in members if member.kind != "passive"]
    commands.sort(key=lambda member: plan.predicted(member.point))
    behaviors = {behavior.id: behavior for behavior in plan.behaviors}
    pending: list[asyncio.Task[None]] = []
    spoken: asyncio.Task[None] | None = None

    async def command(perform: PerformBehavior, before: asyncio.Task[None] | None) -> None:
        if before is not None:
            await before
        await requests.send(keys.BEHAVIOR, perform).outcome

    for member in commands:
        await asyncio.sleep(max(0.0, began + plan.predicted(member.point) - bus.now()))
        through = _until_next_hold(plan, member.point)
        behavior = behaviors[member.behavior]
        perform = PerformBehavior(
            id=behavior.id, requester=bus.name, block=block.id, behavior=behavior, through=through
        )
        is_speech = isinstance(behavior, Speech)
        pending.append(asyncio.create_task(command(perform, spoken if is_speech else None)))
        spoken = pending[-1] if is_speech else spoken
    await asyncio.gather(*pending)


def _until_next_hold(plan: Plan, point: Point) -> str:
    points = plan.chains[point.behavior].points
    holds = {member.point for members in plan.members for member in members if member.can_wait}
    number = points.index(point)
    while number + 1 < len(points) and plan.at[points[number + 1]] == plan.at[points[number]]:
        number += 1
    while number + 1 < len(points):
        instant = plan.at[points[number + 1]]
        if any(each in holds and plan.at[each] == instant for each in points):
            break
        number += 1
    return points[number].sync


EXECUTORS = {"event-driven": in_closed_loop, "fixed schedule": by_the_clock}


async def run(executor: str, block: Block, deviation: Deviation) -> Run:
    async with stage(deviation) as (bus, requests):
        plan = await planned_alone(bus, block)
        times: dict[Point, Seconds] = {}

        async def listen() -> None:
            with bus.subscribe(keys.SYNC_POINT) as inbox:
                async for received in inbox:
                    match received.message:
                        case SyncPointReached(behavior=behavior, sync=sync, at=at):
                            times[Point(behavior, sync)] = bus.local(at)

        listening = asyncio.create_task(listen())
        await EXECUTORS[executor](block, plan, bus, requests)
        await asyncio.sleep(0.01)
        listening.cancel()
        await asyncio.gather(listening, return_exceptions=True)
    return Run(tuple(skews(plan, times)), max(times.values()) - min(times.values()))


def skews(plan: Plan, times: Mapping[Point, Seconds]) -> list[Seconds]:
    """Seconds from the first to the last point of each shared instant. Who was taken over has no way home."""
    found = []
    for members in plan.members:
        measured = {member.behavior: times[member.point] for member in members if member.point in times}
        if len(measured) > 1:
            found.append(max(measured.values()) - min(measured.values()))
    return found


@asynccontextmanager
async def stage(deviation: Deviation) -> AsyncIterator[tuple[Bus, Requester]]:
    config = ControlConfig(variability=deviation if isinstance(deviation, Variability) else Variability())
    body = physical(deviation) if isinstance(deviation, Physical) else None
    if body is not None:
        await asyncio.sleep(2.0)  # somebody has moved an arm by then
    async with MemoryHub() as hub:
        eyes, bus = hub.join("simulation"), hub.join("benchmark")
        eyes.publish(keys.WORLD, WORLD)
        services = {
            "control": partial(embody, config=config, body=body),
            "realizer": partial(realize, config=RealizerConfig()),
        }
        async with running(hub, services), Requester(bus) as requests:
            yield bus, requests
        await bus.leave()
        await eyes.leave()


def physical(deviation: Physical) -> Body:
    """The torso with physics, and with what is wrong with it."""
    from engage_hri.services.control.mujoco.body import MujocoBody

    class Sick(MujocoBody):
        """A body whose faults come with each pointing, and go."""

        async def perform(
            self, behavior: BlockBehavior, authority: MovementAuthority
        ) -> AsyncGenerator[Progress, None]:
            if deviation.seconds is not None and isinstance(behavior, Pointing):
                loop = asyncio.get_running_loop()
                loop.call_later(0.1, self.switch_faults, deviation.faults)
                loop.call_later(0.1 + deviation.seconds, self.switch_faults, ())
            async with aclosing(super().perform(behavior, authority)) as stream:
                async for progress in stream:
                    yield progress

    body = Sick()
    if deviation.seconds is None:
        body.switch_faults(deviation.faults)
    return body


def measure() -> list[dict[str, object]]:
    rows: list[dict[str, object]] = []
    for name, deviation in SWEEP.items():
        for executor in EXECUTORS:
            runs = [run_virtual(run(executor, block, deviation)) for block in BLOCKS]
            all_skews = [skew for each in runs for skew in each.skews]
            rows.append(
                {
                    "body": name,
                    "executor": executor,
                    "mean_skew_ms": round(1000 * mean(all_skews), 1),
                    "max_skew_ms": round(1000 * max(all_skews), 1),
                    "total_s": round(sum(each.total for each in runs), 2),
                }
            )
    return rows


def plot(rows: Sequence[Mapping[str, object]], path: Path) -> None:
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot

    bodies = list(SWEEP)
    figure, axes = pyplot.subplots(1, 2, figsize=(13, 4.6))
    for axis, column, title in ((axes[0], "max_skew_ms", "largest skew, ms"), (axes[1], "total_s", "total time, s")):
        for offset, executor in ((-0.2, "event-driven"), (0.2, "fixed schedule")):
            values = [row[column] for row in rows if row["executor"] == executor]
            axis.bar([number + offset for number in range(len(bodies))], values, 0.4, label=executor)
        axis.set_xticks(range(len(bodies)), bodies, rotation=40, ha="right")
        axis.set_title(title)
        if "physics" in bodies:
            axis.axvline(bodies.index("physics") - 0.5, color="gray", linewidth=0.8)
        axis.legend()
    figure.suptitle(
        "Joints slower or faster than estimated: three blocks, shared instants as the body measured them;"
        " right of the line: the torso with physics"
    )
    figure.tight_layout()
    figure.savefig(path, dpi=90)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--plot", type=Path, metavar="PNG", help="needs matplotlib: pip install -e .[bench]")
    options = parser.parse_args()
    rows = measure()
    if options.plot:
        plot(rows, options.plot)
    if options.json:
        print(json.dumps(rows))
        return
    print(f"{'':16}{'':16}{'mean skew ms':>14}{'max skew ms':>14}{'total s':>10}")
    for row in rows:
        print(
            f"{row['body']:16}{row['executor']:16}{row['mean_skew_ms']:>14}{row['max_skew_ms']:>14}{row['total_s']:>10}"
        )


if __name__ == "__main__":
    main()
