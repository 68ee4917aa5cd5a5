"""What foresight buys: the same plans with the predictive half of the realizer, and without it.

    python benchmarks/foresight.py [--seeds 5] [--json]

Without: a marked graph that waits and nothing else. A behavior begins, and leaves a point where it can wait, when all
that it waits for has been measured and all who share the instant are there; the last to come never stops. What cannot
wait (a stroke, a word) comes when it comes: nothing is kept back, hurried, slowed or paused for its sake, nothing is
learned from phases that took longer, nobody is expected.

Skew is from the first to the last point of an instant that behaviors share. Off plan is how far, early or late, a
point is from the instant that the plan had for it: of an exact body, what foresight is for; of a slow one, mostly the
body. Late is the point that is furthest behind the plan, of each run.
"""

import argparse
import asyncio
import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import mean

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from msgspec import Struct
from msgspec.structs import replace

from benchmarks.event_driven_against_fixed_schedule import (
    BLOCKS,
    block,
    in_closed_loop,
    skews,
    slow,
    stage,
    together,
)
from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Before, Gaze, Gesture, Mark, Pointing, Speech, Timing
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.body import PerformBehavior, SyncPointArrived, SyncPointReached
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus
from engage_hri.services.control.config import Stall, Variability
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.points import Point
from engage_hri.services.realizer.together.planning import planned_alone
from engage_hri.services.requests.ends import Pending, Requester
from engage_hri.services.runtime.virtual_time import run_virtual

PATIENCE: Seconds = 120.0
FIXED_TIMES = block(
    "fixed-times",
    (
        Pointing(id="point", target="red", mode="RIGHT_HAND", timing=(Timing("stroke", "2"),)),
        Gaze(id="gaze", target="red", timing=(Timing("stroke", "1.5"), Timing("relax", "3"))),
        Speech(id="say", text="This one", timing=(Timing("end", "2"),)),
        Gesture(id="beat", lexeme="BEAT", mode="LEFT_HAND", timing=(Timing("stroke", "4"),)),
    ),
)
NO_LATER_THAN = block(
    "no-later-than",
    (
        Speech(id="say", text="Now take this one and turn it", marks=(Mark("this", 9), Mark("turn", 21))),
        Pointing(id="point", target="blue", mode="RIGHT_HAND"),
        Gesture(id="beat", lexeme="BEAT", mode="LEFT_HAND"),
    ),
    Before(ref="say:this", syncs=("point:stroke",)),
    together("beat:stroke", "say:turn"),
)
ALL = (*BLOCKS, FIXED_TIMES, NO_LATER_THAN)
BODIES: Mapping[str, Variability] = {
    "exact": Variability(), "noise 5 %": Variability(noise=0.05), "noise 20 %": Variability(noise=0.2),
    "0.7x": slow(0.7), "2x": slow(2.0),
    "stall 1 s": Variability(stall=(Stall(part="right_arm", before="stroke_start", seconds=1.0),)),
}  # fmt: skip


class Waiting:
    """A plan run as a marked graph: tokens move when points are measured, and nothing is foreseen."""

    def __init__(self, plan: Plan, bus: Bus, requests: Requester) -> None:
        self._plan = plan
        self._bus = bus
        self._requests = requests
        self._behaviors = {each.id: each for each in plan.behaviors}
        self._waits: list[list[tuple[int, Seconds]]] = [[] for _ in plan.members]
        for place in plan.net.places:
            if place.kind in ("order", "delay", "series"):
                self._waits[place.target].append((place.source, place.lag))
        self._asking = {
            member.point: transition
            for transition, members in enumerate(plan.members)
            for member in members
            if member.can_wait
        }
        self._began = bus.now()
        self._instants: dict[int, Seconds] = {0: self._began}
        self._granted: set[Point] = set()
        self._there: set[Point] = set()
        self.times: dict[Point, Seconds] = {}
        self._told: dict[str, str] = {}
        self.pending: dict[str, Pending] = {}

    def take(self, message: object) -> None:
        match message:
            case SyncPointArrived(behavior=behavior, sync=sync):
                self._there.add(Point(behavior, sync))
            case SyncPointReached(behavior=behavior, sync=sync, at=at):
                point = Point(behavior, sync)
                self.times[point] = self._bus.local(at)
                self._there.add(point)

    def step(self) -> Seconds | None:
        """Let all go on that may; returns when to look again if nothing is measured until then."""
        due: list[Seconds] = []
        while True:
            count = len(self._instants) + len(self._granted)
            due = [at for transition in range(len(self._plan.members)) if (at := self._fire(transition)) is not None]
            if len(self._instants) + len(self._granted) == count:
                break
        for id in self._behaviors:
            self._tell(id)
        return min(due, default=None)

    def _fire(self, transition: int) -> Seconds | None:
        """Take up an instant if it may be; returns when it may if that is a matter of time."""
        members = self._plan.members[transition]
        if transition not in self._instants and members and all(self._is_over(each.point) for each in members):
            self._instants[transition] = max(self.times.get(each.point, self._bus.now()) for each in members)
        if transition and transition in self._instants:
            return None
        if any(source not in self._instants for source, _ in self._waits[transition]):
            return None
        ready = max((self._instants[source] + lag for source, lag in self._waits[transition]), default=self._began)
        if ready > self._bus.now() + 1e-9:
            return ready
        if not members:
            self._instants[transition] = ready
        missing = [each for each in members if each.kind != "start" and each.point not in self._there]
        if not missing:
            self._granted.update(each.point for each in members)
        elif len(missing) == 1 and missing[0].can_wait:
            self._granted.add(missing[0].point)
        return None

    @property
    def is_over(self) -> bool:
        """Whether nothing more comes of any point of the plan."""
        return all(self._is_over(point) for point in self._plan.at if point.behavior)

    def _is_over(self, point: Point) -> bool:
        """Tell whether a point was reached, or never will be: its behavior has handed its part of the body over."""
        pending = self.pending.get(point.behavior)
        return point in self.times or (pending is not None and pending.outcome.done())

    def _tell(self, id: str) -> None:
        """Begin the behavior, or let it go on, as far as it may."""
        points = self._plan.chains[id].points
        if points[0] not in self._granted:
            return
        through = points[0]
        for point in points[1:]:
            if point in self._asking and point not in self._granted:
                break
            through = point
        if self._told.get(id) != through.sync:
            self._told[id] = through.sync
            perform = PerformBehavior(
                id=id, requester=self._bus.name, block="b", behavior=self._behaviors[id], through=through.sync
            )
            self.pending[id] = self._requests.send(keys.BEHAVIOR, perform)


class Run(Struct, frozen=True):
    skews: tuple[Seconds, ...]
    off_plan: tuple[Seconds, ...]
    late: Seconds
    """Seconds by which the point that is furthest behind the plan came after its instant."""


async def run(executor: str, block: Block, variability: Variability) -> Run:
    async with stage(variability) as (bus, requests):
        plan = await planned_alone(bus, block)
        waiting = Waiting(plan, bus, requests)
        began = bus.now()
        with bus.subscribe(keys.SYNC_POINT) as inbox:
            async with asyncio.timeout(PATIENCE):
                if executor == "foresight":
                    await in_closed_loop(block, plan, bus, requests)
                    await asyncio.sleep(0.01)
                    while len(inbox) and (received := await inbox.next()):
                        waiting.take(received.message)
                else:
                    while not waiting.is_over:
                        due = waiting.step()
                        received = await inbox.next(due)
                        if received is not None:
                            waiting.take(received.message)
                    await asyncio.gather(*(each.outcome for each in waiting.pending.values()))
    times = waiting.times
    off = {point: at - began - plan.predicted(point) for point, at in times.items() if point in plan.at}
    return Run(tuple(skews(plan, times)), tuple(map(abs, off.values())), max(0.0, *off.values()))


def measure(seeds: int) -> list[dict[str, object]]:
    rows: list[dict[str, object]] = []
    for name, variability in BODIES.items():
        for executor in ("foresight", "waiting only"):
            drawn = range(seeds) if variability.noise else (0,)
            runs = [
                run_virtual(run(executor, each, replace(variability, seed=seed))) for each in ALL for seed in drawn
            ]
            all_skews = [skew for each in runs for skew in each.skews]
            rows.append(
                {
                    "body": name,
                    "executor": executor,
                    "mean_skew_ms": round(1000 * mean(all_skews), 1),
                    "max_skew_ms": round(1000 * max(all_skews), 1),
                    "off_plan_ms": round(1000 * mean(each for one in runs for each in one.off_plan), 1),
                    "late_ms": round(1000 * mean(each.late for each in runs), 1),
                }
            )
    return rows


def show(rows: Sequence[Mapping[str, object]]) -> None:
    columns = ("mean_skew_ms", "max_skew_ms", "off_plan_ms", "late_ms")
    print(f"{'':14}{'':14}" + "".join(f"{each.replace('_', ' '):>14}" for each in columns))
    for row in rows:
        print(f"{row['body']:14}{row['executor']:14}" + "".join(f"{row[each]:>14}" for each in columns))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=5, help="runs of a body with noise")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    rows = measure(options.seeds)
    if options.json:
        print(json.dumps(rows))
    else:
        show(rows)


if __name__ == "__main__":
    main()
