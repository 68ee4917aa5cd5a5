"""Firings a second of the net that runs in the realizer, with the futures that tasks await, at three sizes.

The net is told of each sync point in the order of its plan, as if a body reported them. Every transition fires once,
at its planned time, which is checked. The rows: the net alone; with the futures of all transitions; and with a task
that awaits each of these futures, and is woken.

    python benchmarks/running_net.py [--laps N] [--json]
"""

import argparse
import asyncio
import gc
import json
import sys
from pathlib import Path
from statistics import median
from time import perf_counter

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from engage_hri.schemas.behaviors import After, BlockBehavior, Constraint, Pointing, Speech, Synchronize
from engage_hri.schemas.blocks import Block
from engage_hri.services.realizer.net.running import RunningNet
from engage_hri.services.realizer.perform.behavior_run import SyncPointFutures
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.plan.planner import plan_block

SIZES = (100, 1000, 10000)
PER_PAIR = 8
"""Transitions of a pointing gesture and the phrase that begins with its stroke."""
ROWS = ("net alone", "with futures", "awaited by a task each")


def references(transitions: int) -> Block:
    """One pointed reference after another, of about so many transitions."""
    behaviors: list[BlockBehavior] = []
    operators: list[Synchronize | After] = []
    for number in range(transitions // PER_PAIR):
        behaviors += (Pointing(id=f"p{number}", target="can"), Speech(id=f"s{number}", text="this one"))
        operators.append(Synchronize(ref=f"p{number}:stroke_start", syncs=(f"s{number}:start",)))
        if number:
            operators.append(After(ref=f"s{number - 1}:end", syncs=(f"p{number}:start",)))
            operators.append(After(ref=f"p{number - 1}:end", syncs=(f"p{number}:start",)))
    return Block(id="b", behaviors=tuple(behaviors), constraints=(Constraint(operators=tuple(operators)),))


async def play(plan: Plan, row: str) -> float:
    """Seconds of processor and of the loop for all firings of one block."""
    net, futures = RunningNet(plan.net, plan.members, plan.at), SyncPointFutures()
    woken: list[int] = []

    async def wait(transition: int) -> None:
        await futures.fired(plan.members[transition][0].point)
        woken.append(transition)

    tasks = []
    if row != "net alone":
        net.observe((futures.adopt(net),))
        awaited = [number for number, members in enumerate(plan.members) if members]
        if row == "with futures":
            for number in awaited:
                futures.fired(plan.members[number][0].point)
        else:
            tasks = [asyncio.ensure_future(wait(number)) for number in awaited]
            await asyncio.sleep(0)
    gc.collect()
    gc.disable()
    began = perf_counter()
    net.start(plan.schedule[0])
    for transition, members in enumerate(plan.members):
        at = plan.schedule[transition]
        net.tick(at)
        for member in members:
            if member.kind == "start":
                net.begin(member.behavior, at)
            net.reach(member.point, at)
    if tasks:
        await asyncio.gather(*tasks)
    taken = perf_counter() - began
    gc.enable()
    assert len(net.fired) == len(plan.net.transitions)
    assert all(abs(at - plan.schedule[each]) < 1e-6 for each, at in net.fired.items())
    assert len(woken) == len(tasks)
    return taken


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--laps", type=int, default=5)
    options.add_argument("--json", action="store_true")
    chosen = options.parse_args()
    rows = []
    for size in SIZES:
        plan = plan_block(references(size))
        taken: dict[str, list[float]] = {row: [] for row in ROWS}
        for _ in range(chosen.laps):
            for row in ROWS:
                taken[row].append(asyncio.run(play(plan, row)))
        alone = median(taken["net alone"])
        for row in ROWS:
            count, seconds = len(plan.net.transitions), median(taken[row])
            rows.append(
                {
                    "transitions": count,
                    "what": row,
                    "firings_per_s": round(count / seconds),
                    "ratio": round(seconds / alone, 2),
                }
            )
    if chosen.json:
        print(json.dumps(rows, indent=2))
        return
    print(f"{'transitions':>11}  {'':24}{'firings a second':>18}{'ratio':>8}")
    for each in rows:
        print(f"{each['transitions']:>11}  {each['what']:24}{each['firings_per_s']:>18,}{each['ratio']:>8}")


if __name__ == "__main__":
    main()
