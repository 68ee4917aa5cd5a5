"""What a recorder costs, and what is lost when it is killed.

    python benchmarks/recording.py [--laps 10] [--trips 100] [--json]
    python benchmarks/recording.py --kills 20
    python benchmarks/recording.py --play 60

The first: the honest trip of sync_to_command.py, from a sync point to the next command, without and with `engage
record` on the bus, each with processes of its own, in turns. `--kills`: so many recorders, killed (SIGKILL) at a time
that chance picks, while a message comes every 5 ms: the age of the newest one that is in the file, at the kill.
`--play`: a robot that plays the tangram with a person for so many seconds: bytes a minute, and the processor's time
of the recorder.
"""

import argparse
import asyncio
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
from pathlib import Path
from time import monotonic

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.bus_roundtrip import RawPings, connected, free_endpoint, serve_raw
from benchmarks.harness import Contender, OtherSide, compare, report
from benchmarks.sync_to_command import (
    HONEST,
    ROBOT,
    Body,
    _all_there,
    serve_client,
    serve_realizer,
    serve_recognition,
)
from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.participants import PeerAlive
from engage_hri.services.bus.zenoh.hub import open_hub
from engage_hri.services.commandline.shell.process import run, run_until_signal
from engage_hri.services.recording.disk import read

ENGAGE = (sys.executable, "-m", "engage_hri")
EVERY = 0.005
"""Seconds between two messages."""
RECORDED = "the same, recorded"
SERVERS = {"raw": serve_raw, "realizer": serve_realizer, "recognition": serve_recognition, "client": serve_client}


def recorder(path: Path, robot: str, *connect: str) -> "subprocess.Popen[bytes]":
    options = [each for endpoint in connect for each in ("--connect", endpoint)]
    return subprocess.Popen(
        [*ENGAGE, "record", str(path), "--robot", robot, *options], stderr=subprocess.DEVNULL
    )  # fmt: skip


async def measure(laps: int, trips: int, folder: Path, as_json: bool) -> None:
    """Trips without and with a recorder."""
    raw, plain, seen, follower, recorded, seen_too, follower_too = (free_endpoint() for _ in range(7))
    with (
        OtherSide(__file__, "raw", raw),
        OtherSide(__file__, "realizer", plain),
        OtherSide(__file__, "recognition", f"{seen},{plain}"),
        OtherSide(__file__, "client", f"{follower},{plain},{seen}"),
        OtherSide(__file__, "realizer", recorded),
        OtherSide(__file__, "recognition", f"{seen_too},{recorded}"),
        OtherSide(__file__, "client", f"{follower_too},{recorded},{seen_too}"),
    ):
        session = await connected(raw)
        own = free_endpoint()
        without = await open_hub(ROBOT, connect=[plain, seen, follower])
        with_it = await open_hub(ROBOT, listen=[own], connect=[recorded, seen_too, follower_too])
        async with without, with_it:
            await _all_there(without.join("this"), 3)
            bus = with_it.join("this")
            process = recorder(folder / "trips.mcap", ROBOT, own, recorded, seen_too)
            try:
                await _all_there(bus, 4)
                bodies = [Body(without.join("control"), 10, HONEST), Body(with_it.join("control"), 10, RECORDED)]
                contenders: list[Contender] = [RawPings(session), *bodies]
                report(await compare(contenders, laps, trips), as_json)
            finally:
                process.send_signal(signal.SIGINT)
                process.wait()
        session.close()  # type: ignore[no-untyped-call]


async def killed(path: Path, chance: random.Random) -> tuple[float, int]:
    """Kill a recorder. Returns the age of the newest message in its file by then, and how many are in it."""
    robot, endpoint = f"killed-{os.getpid()}", free_endpoint()
    async with await open_hub(robot, listen=[endpoint]) as hub:
        bus = hub.join("there")
        process = recorder(path, robot, endpoint)
        try:
            with bus.subscribe(keys.ANY_ALIVE) as presence:
                async for received in presence:
                    if isinstance(received.message, PeerAlive) and received.source.startswith("record-"):
                        break
            number, until = 0, monotonic() + 1.0 + 2.0 * chance.random()
            while monotonic() < until:
                number += 1
                bus.publish(keys.fault("there"), Fault(reason=str(number)))
                await asyncio.sleep(EVERY)
        finally:
            process.kill()
            now = monotonic()
            process.wait()
    recording = read(path)
    mine = [sample for n in range(len(recording)) if (sample := recording.sample(n)).key == keys.fault("there")]
    return now - mine[-1].sent, len(mine)


async def measure_kills(count: int, folder: Path, as_json: bool) -> None:
    chance, ages = random.Random(0), []
    for number in range(count):
        age, _ = await killed(folder / f"{number}.mcap", chance)
        ages.append(age)
    ages.sort()
    told = {"kills": count, "least": ages[0], "median": ages[count // 2], "most": ages[-1]}
    print(json.dumps(told) if as_json else "  ".join(f"{name} {value:.3g}" for name, value in told.items()), "(s)")


def measure_play(seconds: float, folder: Path, as_json: bool) -> None:
    """Record a robot that plays the tangram."""
    robot, path = f"recorded-{os.getpid()}", folder / "play.mcap"
    play = [*ENGAGE, "up", "--robot", robot, "--task", "--human", "stochastic", "--set", "collaboration.mode=task"]
    process = recorder(path, robot)
    robot_process = subprocess.Popen([*play, "--quiet"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        asyncio.run(asyncio.sleep(15.0))  # until all services stand
        (cpu, size), began = facts(process.pid, path), monotonic()
        asyncio.run(asyncio.sleep(seconds))
        (later, larger), took = facts(process.pid, path), monotonic() - began
    finally:
        for each in (robot_process, process):
            each.send_signal(signal.SIGINT)
        for each in (robot_process, process):
            each.wait()
    recording = read(path)
    rate = len(recording) / recording.duration
    told = {
        "MB a minute": (larger - size) / took * 60 / 1e6,
        "processor %": 100 * (later - cpu) / took,
        "messages/s": rate,
    }
    print(json.dumps(told) if as_json else "  ".join(f"{name} {value:.3g}" for name, value in told.items()))


def facts(pid: int, path: Path) -> tuple[float, int]:
    """Seconds of processor time of a process, and bytes of its file."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK"), path.stat().st_size


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--laps", type=int, default=10)
    parser.add_argument("--trips", type=int, default=100)
    parser.add_argument("--kills", type=int, metavar="N")
    parser.add_argument("--play", type=float, metavar="S")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--serve", nargs=2, metavar=("ROLE", "ENDPOINT"), help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.serve:
        role, endpoint = options.serve
        run_until_signal(SERVERS[role](endpoint))
        return
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if options.kills:
            run(measure_kills(options.kills, folder, options.json))
        elif options.play:
            measure_play(options.play, folder, options.json)
        else:
            run(measure(options.laps, options.trips, folder, options.json))


if __name__ == "__main__":
    main()
