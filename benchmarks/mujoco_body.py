"""The body with physics: processor time, the longest steps of the loop, inverse kinematics, and estimates that hold.

The first table is of a body that points, looks and beats time without pause. `--figures FILE.png` draws Figs 4.5 to
4.7 of the thesis from the physics: what was planned, and what the joints were measured to do, in closed loop and by a
fixed schedule. Needs `pip install -e .[mujoco]`; the iCub needs the package icub-models, the figures matplotlib.
"""

import argparse
import asyncio
import json
import math
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from statistics import median, quantiles
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.event_driven_against_fixed_schedule import EXECUTORS, FIGURE_4_4, Physical, stage
from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import BlockBehavior, Gaze, Gesture, Head, Pointing, PostureShift
from engage_hri.schemas.body import SyncPointReached
from engage_hri.schemas.body_faults import BodyFault
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import Entity, World
from engage_hri.services.control.contract.body import Body, BodyFailed, MovementAuthority, Reached
from engage_hri.services.control.mujoco.body import MujocoBody
from engage_hri.services.control.mujoco.described import DescribedBody
from engage_hri.services.control.mujoco.pulse import Pulse
from engage_hri.services.realizer.points import Point
from engage_hri.services.realizer.together.planning import planned_alone
from engage_hri.services.runtime.virtual_time import run_virtual
from engage_hri.services.tangram.table import tangram_table

ICUB = Path(__file__).resolve().parents[1] / "tests" / "control" / "mujoco" / "robots" / "icub.toml"
TABLE = tangram_table()
PIECES = tuple(TABLE.lying(piece, piece.start) for piece in TABLE.pieces)
WORLD = World(entities=(Entity(id="human", kind="person", position=TABLE.person.face), *PIECES))
ROUNDS = 6


def behaviors(number: int) -> list[BlockBehavior]:
    """A look, a point and a beat at a piece."""
    piece = PIECES[number % len(PIECES)].id
    return [
        Gaze(id=f"look-{number}", target=piece),
        Pointing(id=f"point-{number}", target=piece),
        Gesture(id=f"beat-{number}", lexeme="BEAT", mode="LEFT_HAND"),
        Head(id=f"nod-{number}", lexeme="NOD"),
        PostureShift(id=f"turn-{number}", lexeme="TURN_LEFT" if number % 2 else "TURN_RIGHT"),
    ]


async def performed(body: Body, behavior: BlockBehavior) -> dict[str, Seconds]:
    """When it passed its points."""
    authority = MovementAuthority(behavior, "end")
    return {each.sync: each.at async for each in body.perform(behavior, authority) if isinstance(each, Reached)}


async def busy(make: Callable[[], Body], rounds: int) -> dict[str, float]:
    """A body that moves without pause, in virtual time: what of it is processor time, and its longest step."""
    steps: list[float] = []
    tick = Pulse._tick

    def timed(self: Pulse) -> None:
        since = time.thread_time()  # its own time: on a busy machine it also waits for its turn
        tick(self)
        steps.append(time.thread_time() - since)

    body, loop = make(), asyncio.get_running_loop()
    body.see(WORLD)
    Pulse._tick = timed  # type: ignore[method-assign]
    try:
        began, used = loop.time(), time.process_time()
        for number in range(rounds):
            for behavior in behaviors(number):
                if body.estimate(behavior, None, WORLD).feasible:
                    await performed(body, behavior)
        seconds, used = loop.time() - began, time.process_time() - used
    finally:
        Pulse._tick = tick  # type: ignore[method-assign]
    steps.sort()
    return {
        "simulated_s": round(seconds, 1), "cpu_of_a_second": round(used / seconds, 3),
        "step_ms_p50": round(1000 * median(steps), 2), "step_ms_p99": round(1000 * quantiles(steps, n=100)[-1], 2),
        "step_ms_max": round(1000 * steps[-1], 2),
    }  # fmt: skip


async def errors(faults: Sequence[BodyFault]) -> dict[str, object]:
    """How much later than estimated a body comes to its points."""
    late: list[Seconds] = []
    failed = 0
    for number in range(ROUNDS):
        for behavior in behaviors(number):
            body = MujocoBody()
            body.see(WORLD)
            estimate = body.estimate(behavior, None, WORLD)
            if not estimate.feasible:
                continue
            body.switch_faults(faults)
            try:
                at = await performed(body, behavior)
            except BodyFailed:
                failed += 1
                continue
            expected = 0.0
            for phase in estimate.phases:
                expected += phase.natural
                late.append(at[phase.to] - at["start"] - expected)
    if not late:
        return {"late_ms_p50": None, "late_ms_max": None, "failed": failed}
    return {"late_ms_p50": round(1000 * median(late)), "late_ms_max": round(1000 * max(late)), "failed": failed}


async def inverse(body: DescribedBody) -> Iterator[float]:
    """Milliseconds that an aim of the iCub takes which it has not made before."""
    body.see(WORLD)
    spans = []
    for member in body._members:
        for entity in WORLD.entities:
            for behavior in (Gaze(id="g", target=entity.id), Pointing(id="p", target=entity.id)):
                since = time.thread_time()
                with suppress(Exception):
                    member.body.aim(behavior, WORLD)  # type: ignore[attr-defined]
                spans.append(1000 * (time.thread_time() - since))
    return iter([span for span in spans if span > 0.05])


async def turns(body: DescribedBody) -> list[float]:
    """Milliseconds of the thread that each turn of the loop takes while the iCub prepares aims and estimates them."""
    spans: list[float] = []
    run = asyncio.Handle._run

    def timed(self: asyncio.Handle) -> None:
        since = time.thread_time()
        run(self)
        spans.append(1000 * (time.thread_time() - since))

    body.see(WORLD)
    asyncio.Handle._run = timed  # type: ignore[method-assign]
    try:
        for entity in WORLD.entities:
            asked: list[BlockBehavior] = [Gaze(id="g", target=entity.id), Pointing(id="p", target=entity.id)]
            if (preparing := body.prepare(asked)) is not None:
                await preparing
            for behavior in asked:
                body.estimate(behavior, None, WORLD)
            await asyncio.sleep(0)
    finally:
        asyncio.Handle._run = run  # type: ignore[method-assign]
    return spans


CASES: Mapping[str, Sequence[BodyFault]] = {
    "healthy": (), "noisy 0.3": (BodyFault(kind="noisy"),), "slow 2x": (BodyFault(kind="slow"),),
    "slow 4x": (BodyFault(kind="slow", amount=4.0),), "sticky": (BodyFault(kind="sticky"),),
    "weak": (BodyFault(kind="weak"),), "stalled arm": (BodyFault(kind="stalled", part="right_arm"),),
    "table": (BodyFault(kind="table"),),
}  # fmt: skip


def measure() -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = [{"what": "torso, moving", **run_virtual(busy(MujocoBody, ROUNDS))}]
    if find_spec("icub_models"):
        rows.append({"what": "iCub, moving", **run_virtual(busy(lambda: DescribedBody(ICUB), ROUNDS))})

        async def solved() -> list[float]:
            return list(await inverse(DescribedBody(ICUB)))

        spans = sorted(run_virtual(solved()))
        rows.append({"what": "iCub, an aim", "ms_p50": round(median(spans), 1), "ms_max": round(spans[-1], 1)})

        async def taken() -> list[float]:
            return await turns(DescribedBody(ICUB))

        spans = sorted(run_virtual(taken()))
        rows.append(
            {"what": "iCub, a turn of aims", "ms_p50": round(median(spans), 1), "ms_max": round(spans[-1], 1)}
        )
    rows += [{"what": name, **run_virtual(errors(faults))} for name, faults in CASES.items()]
    return rows


# -- figures ------------------------------------------------------------------------------------------------------

FIGURES: Mapping[str, Physical] = {
    "Fig. 4.5: as planned": Physical(),
    "Fig. 4.6: the arm is slowed": Physical((BodyFault(kind="slow", part="right_arm", amount=4.0),)),
    "Fig. 4.7: the arm is closer than expected": Physical(
        (
            BodyFault(kind="displaced", part="right_shoulder_pitch", amount=20.0),
            BodyFault(kind="displaced", part="right_elbow", amount=95.0),
        )
    ),
}
ROWS = ("gaze", "point", "say")
JOINT = "right_elbow"


class Told(dict[str, Any]):
    """What a run came to: `planned` and `measured` times of points, and the joint over time."""


async def told(executor: str, physical: Physical) -> Told:
    """Perform the block of Fig. 4.4, and note plan and measurement."""
    from engage_hri.services.control.mujoco import body as module

    bodies: list[MujocoBody] = []
    made = module.MujocoBody.__init__

    def noted(self: MujocoBody, *rest: Any, **named: Any) -> None:
        made(self, *rest, **named)
        bodies.append(self)

    module.MujocoBody.__init__ = noted  # type: ignore[method-assign]
    try:
        async with stage(physical) as (bus, requests):
            plan = await planned_alone(bus, FIGURE_4_4)
            times: dict[Point, Seconds] = {}
            trace: list[tuple[Seconds, float, float]] = []
            body = bodies[-1]

            def sample(at: Seconds) -> None:
                trace.append((at, math.degrees(body.planned()[JOINT]), math.degrees(body.bench.measured[JOINT])))

            async def listen() -> None:
                with bus.subscribe(keys.SYNC_POINT) as inbox:
                    async for received in inbox:
                        if isinstance(message := received.message, SyncPointReached):
                            times[Point(message.behavior, message.sync)] = bus.local(message.at)

            listening = asyncio.create_task(listen())
            body.pulse.on_step = sample
            await EXECUTORS[executor](FIGURE_4_4, plan, bus, requests)
            await asyncio.sleep(0.3)
            listening.cancel()
            await asyncio.gather(listening, return_exceptions=True)
    finally:
        module.MujocoBody.__init__ = made  # type: ignore[method-assign]
    since = min(times.values())
    return Told(
        planned={point: plan.predicted(point) for point in plan.at},
        measured={point: at - since for point, at in times.items()},
        trace=[(at - since, *rest) for at, *rest in trace],
    )  # fmt: skip


def draw(path: Path) -> None:
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot

    executors = list(EXECUTORS)
    figure, axes = pyplot.subplots(
        2 * len(executors), len(FIGURES), figsize=(15, 9.5), sharex=True, height_ratios=[1.5, 1] * len(executors)
    )
    for column, (title, physical) in enumerate(FIGURES.items()):
        for row, executor in enumerate(executors):
            told_now = run_virtual(told(executor, physical))
            above, below = axes[2 * row][column], axes[2 * row + 1][column]
            _timeline(above, told_now)
            above.set_title(f"{title}\n{executor}" if row == 0 else executor, fontsize=10)
            times, plan, joint = zip(*told_now["trace"], strict=True)
            below.plot(times, plan, "--", color="0.5", linewidth=1.2, label="plan of the servo")
            below.plot(times, joint, color="#c0392b", linewidth=1.6, label="measured")
            below.set_ylabel("elbow, degrees", fontsize=8)
            if row == column == 0:
                below.legend(fontsize=8)
    for axis in axes[-1]:
        axis.set_xlabel("seconds")
    figure.suptitle("The block of Fig. 4.4 on the torso with physics: hollow as planned, filled as measured")
    figure.tight_layout()
    figure.savefig(path, dpi=80)


def _timeline(axis: Any, run: Told) -> None:
    """Sync points of each behavior on a line: planned hollow, measured filled; ties are upright lines."""
    colors = {"gaze": "#2980b9", "point": "#c0392b", "say": "#27ae60"}
    for place, name in enumerate(reversed(ROWS)):
        axis.axhline(place, color="0.9", zorder=0)
        for point, at in run["planned"].items():
            if point.behavior == name:
                axis.plot(at, place + 0.16, "o", mfc="none", mec=colors[name], ms=6)
        for point, at in run["measured"].items():
            if point.behavior == name:
                axis.plot(at, place - 0.12, "o", color=colors[name], ms=6)
    for one, other in ((("gaze", "stroke"), ("point", "start")), (("point", "stroke_start"), ("say", "start"))):
        ends = [(run["measured"].get(Point(*each)), 2 - ROWS.index(each[0]) - 0.12) for each in (one, other)]
        if all(at is not None for at, _ in ends):
            apart = abs(ends[0][0] - ends[1][0])
            axis.plot(*zip(*ends, strict=True), color="black" if apart < 0.05 else "#e67e22", linewidth=1.4)
            if apart >= 0.05:
                axis.text(
                    ends[0][0], sum(y for _, y in ends) / 2, f" {apart:.2f} s apart", color="#e67e22", fontsize=8
                )
    axis.set_yticks(range(len(ROWS)), reversed(ROWS))
    axis.set_ylim(-0.5, len(ROWS) - 0.5)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--figures", type=Path, metavar="PNG", help="draw Figs 4.5 to 4.7, and measure nothing")
    options = parser.parse_args()
    if options.figures:
        draw(options.figures)
        return
    rows = measure()
    if options.json:
        print(json.dumps(rows))
        return
    for row in rows:
        print(f"{row.pop('what'):16}", "  ".join(f"{name} {value}" for name, value in row.items()))


if __name__ == "__main__":
    main()
