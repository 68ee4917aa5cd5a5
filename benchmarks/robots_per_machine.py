"""What one robot takes of a machine while it plays the tangram: a process for each service, beside all in one.

    python benchmarks/robots_per_machine.py [--seconds 40] [--settle 8] [--json]

Each way plays by itself, in real time, one after the other; this process only looks. Processor time is that of all
its processes between two looks, as the kernel counts it. Memory is the proportional share (Pss): what several
processes have in common counts once. Linux only.
"""

import argparse
import json
import os
import subprocess
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.bus_roundtrip import free_endpoint

TICKS = os.sysconf("SC_CLK_TCK")
WAYS = {"a process for each service": (), "all in one (`--in-one`)": ("--in-one",)}


def family(pid: int) -> list[int]:
    """A process and all that descend from it."""
    found = [pid]
    for each in found:
        for task in Path(f"/proc/{each}/task").iterdir():
            found += map(int, (task / "children").read_text().split())
    return found


def processor_seconds(pids: list[int]) -> float:
    """Time that the processes have computed so far, in user and system mode."""
    fields = [Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split() for pid in pids]
    return sum(int(each[11]) + int(each[12]) for each in fields) / TICKS


def megabytes(pids: list[int]) -> float:
    """Proportional share of memory."""
    lines = (line for pid in pids for line in Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines())
    return sum(int(line.split()[1]) for line in lines if line.startswith("Pss:")) / 1024


def measure(way: tuple[str, ...], settle: float, seconds: float) -> dict[str, float]:
    """Start a robot, let it play, and look twice."""
    command = [sys.executable, "-m", "engage_hri", "up", "--task", "--quiet", "--robot", "measured", *way]
    robot = subprocess.Popen([*command, "--listen", free_endpoint()], stdout=subprocess.DEVNULL)
    try:
        time.sleep(settle)
        before, began = processor_seconds(family(robot.pid)), time.monotonic()
        time.sleep(seconds)
        pids = family(robot.pid)
        share = (processor_seconds(pids) - before) / (time.monotonic() - began)
        return {"processes": len(pids), "percent_of_a_core": 100 * share, "MB": megabytes(pids)}
    finally:
        robot.terminate()
        robot.wait()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=40.0, help="between the two looks")
    parser.add_argument("--settle", type=float, default=8.0, help="before the first look")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    found = {name: measure(way, options.settle, options.seconds) for name, way in WAYS.items()}
    if options.json:
        print(json.dumps(found))
        return
    first = next(iter(found.values()))
    for name, each in found.items():
        cores, memory = (each[key] / first[key] for key in ("percent_of_a_core", "MB"))
        print(
            f"{name:28} {each['processes']:2.0f} processes  {each['percent_of_a_core']:5.1f} % of a core"
            f" ({cores:.2f})  {each['MB']:4.0f} MB ({memory:.2f})  {100 / each['percent_of_a_core']:3.0f} a core"
        )


if __name__ == "__main__":
    main()
