"""Processor time of the simulated body: inverse kinematics, estimates in full and of postures, plans, and moving.

    python benchmarks/simulated_body.py [--laps 20] [--seconds 60] [--json]

Microseconds each, the least of all laps: what else the machine does makes it no less. Every lap has another table,
so that nothing that is remembered helps.

    look, point      joint angles on a target, ten targets (`look_at`, `point_at`)
    full, posture    an estimate of a gaze or a point with its phases, or without (`EstimateItem.only`)
    plan of N        a rehearsal of N gazes and points, one after the other, per behavior
    moving           processor time of a simulated second, in thousandths: it looks, points, nods and speaks without a
                     pause, and is measured 30 times a second
"""

import argparse
import asyncio
import json
import math
import random
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from time import process_time

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from msgspec.structs import replace

from engage_hri.schemas.behaviors import BlockBehavior, Gaze, Head, Pointing, Speech
from engage_hri.schemas.body import EstimateItem, PlannedTime
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import Entity, World
from engage_hri.services.control.contract.body import MovementAuthority
from engage_hri.services.control.figure import kinematics
from engage_hri.services.control.torso.body import SimulatedBody
from engage_hri.services.runtime.virtual_time import run_virtual

TARGETS = 10
PLANS = (3, 10, 20)
HERTZ = 30.0


def table(chance: random.Random) -> World:
    places = [(chance.uniform(0.35, 0.7), chance.uniform(-0.4, 0.4), 0.73) for _ in range(TARGETS)]
    return World(
        entities=tuple(
            Entity(id=f"piece-{number}", kind="object", position=place, radius=0.02)
            for number, place in enumerate(places)
        )
    )


def pairs(world: World) -> list[BlockBehavior]:
    looks: list[BlockBehavior] = [Gaze(id=f"look {each.id}", target=each.id) for each in world.entities]
    return [*looks, *(Pointing(id=f"point {each.id}", target=each.id) for each in world.entities)]


def timed(work: Callable[[], object], pieces: int) -> Seconds:
    began = process_time()
    work()
    return (process_time() - began) / pieces


# -- contenders: each returns seconds a piece -----------------------------------------------------------------------


def looks(world: World) -> Seconds:
    pose = dict(kinematics.HOME)
    return timed(lambda: [kinematics.look_at(each.position, pose) for each in world.entities], TARGETS)


def points(world: World) -> Seconds:
    pose = dict(kinematics.HOME)

    def work() -> None:
        for each in world.entities:
            with suppress(kinematics.Unreachable):
                kinematics.point_at("left" if each.position[1] > 0 else "right", each.position, each.radius, pose)

    return timed(work, TARGETS)


def estimated(kind: type[BlockBehavior], only: str) -> Callable[[World], Seconds]:
    def lap(world: World) -> Seconds:
        body = SimulatedBody()
        home = body.rehearse([EstimateItem(behavior=Gaze(id="g", target="piece-0"))], world)[0].pose_end
        asked = [each for each in pairs(world) if isinstance(each, kind)]
        items = [EstimateItem(behavior=each, pose=home, only=only) for each in asked]  # type: ignore[arg-type]
        return timed(lambda: body.rehearse(items, world), len(items))

    return lap


def planned(number: int) -> Callable[[World], Seconds]:
    def lap(world: World) -> Seconds:
        body, behaviors = SimulatedBody(), pairs(world)
        items = [
            EstimateItem(
                behavior=replace(behaviors[each % len(behaviors)], id=f"b{each}"),
                times=(PlannedTime(sync="start", at=0.1 + 2.0 * each),),
            )
            for each in range(number)
        ]
        return timed(lambda: body.rehearse(items, world), number)

    return lap


async def moving(seconds: Seconds) -> Seconds:
    """Processor time of a simulated second."""
    loop, chance = asyncio.get_running_loop(), random.Random(1)
    world, body = table(chance), SimulatedBody()
    body.see(world)
    until, began = loop.time() + seconds, process_time()

    async def perform(behaviors: Sequence[BlockBehavior]) -> None:
        while loop.time() < until:
            behavior = chance.choice(behaviors)
            with suppress(Exception):
                async for _ in body.perform(behavior, MovementAuthority(behavior, "end")):
                    pass
            await asyncio.sleep(0.05)

    async def measure() -> None:
        while loop.time() < until:
            body.state()
            await asyncio.sleep(1 / HERTZ)

    all_pairs = pairs(world)
    lists: list[list[BlockBehavior]] = [
        all_pairs[:TARGETS],
        all_pairs[TARGETS:],
        [Head(id="nod", lexeme="NOD")],
        [Speech(id="speech", text="and now we put this one on top of that one")],
    ]
    async with asyncio.TaskGroup() as tasks:
        for each in lists:
            tasks.create_task(perform(each))
        tasks.create_task(measure())
    return (process_time() - began) / (loop.time() - until + seconds)


async def in_turns(laps: int) -> dict[str, Seconds]:
    contenders: dict[str, Callable[[World], Seconds]] = {
        "look": looks,
        "point": points,
        "gaze, full": estimated(Gaze, ""),
        "gaze, posture": estimated(Gaze, "posture"),
        "point, full": estimated(Pointing, ""),
        "point, posture": estimated(Pointing, "posture"),
        **{f"plan of {number}": planned(number) for number in PLANS},
    }
    least = dict.fromkeys(contenders, math.inf)
    for lap in range(laps + 1):
        for name, contender in contenders.items():
            taken = contender(table(random.Random(f"{name} {lap}")))
            least[name] = min(least[name], taken) if lap else math.inf
    return least


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--laps", type=int, default=20)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    least = run_virtual(in_turns(options.laps))
    share = min(run_virtual(moving(options.seconds)) for _ in range(3))
    rows = {**{name: round(1e6 * each, 1) for name, each in least.items()}, "moving": round(1000 * share, 2)}
    if options.json:
        print(json.dumps(rows))
        return
    for name, value in rows.items():
        print(f"{name:16}{value:>9.1f}  {'thousandths' if name == 'moving' else 'us'}")


if __name__ == "__main__":
    main()
