"""Faults at random in a robot that plays: `python -m tests.lab.faults --runs 300 --seed 1 --machines 3`. Needs root.

A robot spread over machines of the laboratory plays the tangram again and again. In each run one thing breaks at a
random moment, for a random time, and heals. All processes write down what they do (recorded.py); verdict.py judges.
A service that ended is started again after a moment, as its unit would (docs/deploy.md).
"""

import argparse
import asyncio
import json
import os
import random
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

from tests.lab import verdict
from tests.lab.lab import Lab, Process, laboratory, missing
from tests.lab.verdict import PERSON, Injury, Motion, Span

LAYOUT: dict[int, dict[int, tuple[str, ...]]] = {
    3: {1: ("router", "control"), 2: ("realizer", "generation", "recognition"), 3: ("simulation", "collaboration")},
    7: {
        1: ("router",), 2: ("control",), 3: ("realizer",), 4: ("generation",), 5: ("recognition",),
        6: ("simulation",), 7: ("collaboration",),
    },
}  # fmt: skip
"""Processes of each machine, by the number of machines."""
KINDS = ("kill", "freeze", "cut", "reboot", "router", "clock")
CALM = "calm"
"""No fault: play goes on for a while."""
HELD_WITHIN = 0.5 + 0.1
"""Seconds after a fault by which the body holds: the bound, and a moment for a busy machine to write it down."""
BACK_WITHIN = 3.0
STANDSTILL = 1.5
"""Seconds without a turn of our own loop that a busy host does not explain."""
AFTERMATH = 2.0
"""Seconds after everything is back in which a hold still comes of the fault: services begin anew."""
HUNG_AFTER = 40.0
"""Calm seconds after which a request without an end is hung: more than the longest behavior, event or patience."""
LONG = 60.0
ENDS_WITHIN = 8.0
"""Seconds after everything is back in which an end still comes of the fault: the longest grace, and another."""
SETTINGS = (
    "--set", "recognition.gaze_resolution=table", "--set", "simulation.human=appendix-b",
    "--set", "collaboration.placement=4",
)  # fmt: skip
"""More words in less time than with people: the manager soon asks again."""


class Broken(NamedTuple):
    """A fault. kind: of `KINDS`. what: who or where. seconds: how long it lasts. stops: it cuts the realizer off."""

    kind: str
    what: str
    seconds: float
    stops: bool

    def __str__(self) -> str:
        return f"{self.kind} {self.what} for {self.seconds:g} s"


class Run(NamedTuple):
    """Result of a run. back: seconds after healing until all see one another. next: until the next word."""

    broken: Broken
    span: Span
    motion: Motion
    back: float | None
    next: float | None
    wrong: list[str]


CLIENTS = {"collaboration"}


class Stage:
    """A robot over machines, and its records."""

    def __init__(self, lab: Lab, folder: Path, machines: int) -> None:
        self.lab = lab
        self.layout = LAYOUT[machines]
        self.address = f"tcp/{lab.machines[1].ip}:7447"
        self.processes: dict[str, Process] = {}
        self.ids: dict[str, str] = {}
        """Process of each service, as the records name it."""
        self.events: list[dict[str, Any]] = []
        self.plays = 0
        self.faults: list[Span] = []
        self.injuries: list[Injury] = []
        self._folder = folder
        self._read: dict[Path, int] = {}
        self._ready: dict[str, asyncio.Event] = {}
        self._readers: set[asyncio.Task[None]] = set()
        self.stood_still: list[tuple[float, float]] = []
        """Times for which the host itself stood still, as one of many on a large machine may. They prove nothing."""
        self.slow: list[tuple[float, float]] = []
        """Times in which it stood still for long enough that processes may miss one another."""
        self._watch = asyncio.create_task(self._watch_host(), name="host")

    @property
    def services(self) -> tuple[str, ...]:
        return tuple(name for names in self.layout.values() for name in names if name != "router")

    def machine_of(self, name: str) -> int:
        return next(number for number, names in self.layout.items() if name in names)

    # -- processes -------------------------------------------------------------------------------------------------

    async def start(self, *names: str) -> float:
        """Start processes and wait until they are ready; returns when they were."""
        for name in names:
            if name == "router":
                words = ("router", "--listen", self.address)
            else:
                words = ("run", name, "--connect", self.address)
                words += SETTINGS if name in ("simulation", "collaboration", "recognition") else ()
            record = self._folder / f"{name}.jsonl"
            process = self.processes[name] = await self.lab.machines[self.machine_of(name)].spawn(
                sys.executable, "-m", "tests.lab.recorded", str(record), *words,
                stdin=asyncio.subprocess.DEVNULL, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.STDOUT,
            )  # fmt: skip
            self._ready[name] = asyncio.Event()
            reader = asyncio.create_task(self._drain(name, process, self._ready[name]), name=f"lines of {name}")
            self._readers.add(reader)
            reader.add_done_callback(self._readers.discard)
        for name in names:
            await asyncio.wait_for(self._ready[name].wait(), LONG)
        return time.monotonic()

    async def _drain(self, name: str, process: Process, ready: asyncio.Event) -> None:
        assert process.stdout is not None
        with (self._folder / f"{name}.log").open("a") as log:
            async for line in process.stdout:
                log.write(f"{time.monotonic():.3f} {line.decode()}")
                log.flush()
                if "is ready" in line.decode():
                    ready.set()
        await process.wait()

    async def signal(self, name: str, number: signal.Signals, *, its_child: bool = False) -> None:
        process = self.processes[name]
        if process.returncode is None:
            await self.lab.machines[self.machine_of(name)].kill(process, number, its_child=its_child)

    def injured(self, fault: Broken) -> frozenset[str]:
        """Whom a fault hits: those that the others miss, and the router if they miss that."""
        match fault.kind:
            case "kill" | "freeze":
                hit = frozenset((fault.what,))
            case "reboot" | "clock":
                hit = frozenset(self.layout[int(fault.what.partition("+")[0])])
            case "router":
                hit = frozenset(("router",))
            case "cut" if fault.what.startswith("1-"):  # all that there is goes over the router on machine 1
                hit = frozenset((*self.layout[int(fault.what[2:])], "router"))
            case _:
                hit = frozenset()
        return hit | {PERSON} if hit & {"simulation", "router"} else hit  # of whom the simulation tells

    async def revive(self) -> float | None:
        """Start what has ended by itself; the tangram begins anew when it has come to its end."""
        ended = [name for name, process in self.processes.items() if process.returncode is not None]
        if not ended:
            return None
        began = time.monotonic()
        if "collaboration" in ended:
            self.plays += 1
            await self.signal("simulation", signal.SIGKILL)
            ended = sorted({*ended, "simulation"}, reverse=True)
        over = await self.start(*ended)
        self.injuries.append(
            Injury("kill", frozenset((*ended, PERSON)), began - 2.0, over)
        )  # it may have ended for a while
        return over

    # -- records ---------------------------------------------------------------------------------------------------

    def read(self) -> None:
        """Take in what was written since the last time, in the order in which it happened."""
        new = []
        for path in self._folder.glob("*.jsonl"):
            with path.open("rb") as file:
                file.seek(self._read.get(path, 0))
                whole = file.read().rpartition(b"\n")[0]
            self._read[path] = self._read.get(path, 0) + len(whole) + bool(whole)
            for line in whole.splitlines():
                new.append(json.loads(line) | {"service": path.stem})
        self.events += sorted(new, key=lambda each: float(each["t"]))
        for each in self.events[-len(new) or len(self.events) :]:
            if each["what"] == "began":
                self.ids[each["service"]] = each["process"]

    def living(self) -> list[str]:
        return [self.ids[name] for name in self.services if self.processes[name].returncode is None]

    def back_since(self) -> float | None:
        """Time since which all services see whom they need; None: they do not. Nobody asks the simulation."""
        self.read()
        latest = 0.0
        playing = {name for name in self.services if self.processes[name].returncode is None}
        for name in playing:
            seen = verdict.sees(self.events, self.ids.get(name, ""))
            needed = playing - {name} - CLIENTS if name == "simulation" else playing - {name}
            if not needed <= seen.keys():
                return None
            latest = max(latest, *(seen[each] for each in needed))
        return latest

    async def until(self, holds: Callable[[], bool], seconds: float) -> bool:
        """Wait until something holds of the records; False: it did not in time."""
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            self.read()
            if holds():
                return True
            await asyncio.sleep(0.1)
        return False

    def words_since(self, at: float) -> list[float]:
        return [each["at"] for each in self.events if each["what"] == "word" and each["t"] >= at]

    async def _watch_host(self) -> None:
        while True:
            before = time.monotonic()
            await asyncio.sleep(0.2)
            if time.monotonic() - before > HELD_WITHIN:
                self.slow.append((before, time.monotonic()))
            if time.monotonic() - before > STANDSTILL:
                self.stood_still.append((before - 1.0, time.monotonic() + LONG))

    def close(self) -> None:
        for task in (self._watch, *self._readers):
            task.cancel()


# -- faults ----------------------------------------------------------------------------------------------------------


def draw(chance: random.Random, stage: Stage, kinds: Sequence[str]) -> Broken:
    """A fault at random."""
    kind = chance.choice(kinds)
    realizer, control = stage.machine_of("realizer"), stage.machine_of("control")
    match kind:
        case "kill":
            what = chance.choice(stage.services)
            return Broken(kind, what, chance.choice([0.5, 1.0, 3.0, 6.0]), what == "realizer")
        case "freeze":
            what = chance.choice(stage.services)
            return Broken(kind, what, chance.choice([0.3, 1.0, 2.0, 3.0, 6.0]), what == "realizer")
        case "cut":
            one, other = sorted(chance.sample(sorted(stage.layout), 2))
            stops = 1 in (one, other) and bool({one, other} & ({realizer, control} - {1}))
            seconds = 60.0 if chance.random() < 0.04 else chance.choice([0.5, 1.0, 3.0, 10.0])
            return Broken(kind, f"{one}-{other}", seconds, stops)
        case "calm":
            return Broken(kind, "play", 30.0, False)
        case "reboot" | "clock":
            number = chance.choice([each for each in stage.layout if each != 1])
            ahead = f"+{chance.choice([0, 3, 1000, 86400])}" if kind == "clock" else ""
            return Broken(kind, f"{number}{ahead}", chance.choice([0.5, 2.0]), number == realizer)
        case _:
            if chance.random() < 0.5:
                return Broken("router", "frozen", chance.choice([0.3, 1.0, 2.0, 4.0]), True)
            return Broken("router", "killed", chance.choice([0.3, 1.0, 3.0, 6.0]), True)


@asynccontextmanager
async def broken(stage: Stage, fault: Broken) -> AsyncIterator[tuple[Span, float]]:
    """Break something for its time, and heal it. The body is run with the time of both, and when it was in force."""
    began = time.monotonic()
    heal: Callable[[], Awaitable[Any]]
    match fault.kind:
        case "router" if fault.what == "frozen":
            await stage.signal("router", signal.SIGSTOP, its_child=True)

            async def heal() -> None:
                with suppress(ProcessLookupError):  # whoever watches over it has ended it meanwhile
                    await stage.signal("router", signal.SIGCONT, its_child=True)
        case "kill" | "router":
            name = "router" if fault.kind == "router" else fault.what
            await stage.signal(name, signal.SIGKILL)

            async def heal() -> None:
                await stage.start(name)
        case "calm":

            async def heal() -> None:
                pass
        case "freeze":
            await stage.signal(fault.what, signal.SIGSTOP)

            async def heal() -> None:
                await stage.signal(fault.what, signal.SIGCONT)
        case "cut":
            one, other = map(int, fault.what.split("-"))
            await stage.lab.cut(one, other)

            async def heal() -> None:
                await stage.lab.heal(one, other)
        case _:
            number, _, ahead = fault.what.partition("+")
            machine = stage.lab.machines[int(number)]
            await machine.crash()
            machine.ahead = int(ahead) if ahead else machine.ahead

            async def heal() -> None:
                await machine.boot()
                await stage.start(*stage.layout[machine.number])

    in_force = time.monotonic()  # a busy host may take a while to kill a process
    await asyncio.sleep(fault.seconds)
    over = time.monotonic()
    await heal()
    begins_anew = fault.kind in ("kill", "reboot", "clock") or fault.what == "killed"
    healed = time.monotonic() if begins_anew else over
    yield Span(began, healed), in_force


async def one(stage: Stage, chance: random.Random, kinds: Sequence[str]) -> Run:
    """Wait for a random moment, break something, and judge."""
    await asyncio.sleep(chance.uniform(0.2, 2.0))
    if chance.random() < 0.8:  # most moments of the tangram are the person's: amid the robot's words more happens
        since = time.monotonic()
        await stage.until(lambda: bool(stage.words_since(since)), 12.0)
        await asyncio.sleep(chance.uniform(0.0, 1.0))
    await stage.revive()
    fault = draw(chance, stage, kinds)
    stage.read()
    control = stage.ids["control"]
    async with broken(stage, fault) as (span, in_force):
        await stage.until(lambda: bool(stage.words_since(span.healed)) or _has_ended(stage), 12.0)
        # Who was frozen or cut off learns late that others have missed it: what counts is the last time.
        is_back = await stage.until(lambda: stage.back_since() is not None, 20.0)
        back = max(0.0, (stage.back_since() or span.healed) - span.healed) if is_back else None
    if fault.kind != CALM:
        stage.injuries.append(
            Injury(
                fault.kind, stage.injured(fault), span.began, span.healed + (BACK_WITHIN if back is None else back)
            )
        )
    words = stage.words_since(span.healed)
    wrong = []
    stage.faults.append(span)
    before = verdict.calm_ago(time.monotonic(), stage.faults, HUNG_AFTER)
    if back is None or back > BACK_WITHIN:
        wrong.append(f"back after {back} s")
    if fault.stops:
        within = in_force - span.began + HELD_WITHIN
        wrong += [f"not held: {each}" for each in verdict.unheld(stage.events, control, span, within)]
    wrong += [f"hung: {each}" for each in verdict.unanswered(stage.events, stage.living(), before)]
    if any(since < time.monotonic() and span.began < to for since, to in stage.stood_still):
        print("the host stood still: not counted:", "; ".join(wrong) or "nothing was wrong", flush=True)
        wrong = []
    took = verdict.motion(stage.events, control, span) if fault.stops else Motion(None, None, None)
    return Run(fault, span, took, back, max(0.0, words[0] - span.healed) if words else None, wrong)


def _has_ended(stage: Stage) -> bool:
    return stage.processes["collaboration"].returncode is not None


async def play(
    folder: Path, runs: int, seed: int, machines: int, kinds: Sequence[str] = KINDS, settle: float = HUNG_AFTER
) -> list[str]:
    """Play and break things; prints each run and the distributions. Returns what was wrong.

    settle: seconds at the end after which what has no end counts as lost, if it is half as old.
    """
    chance, results, wrong = random.Random(seed), list[Run](), list[str]()
    async with laboratory(folder, tuple(LAYOUT[machines]), seed=seed) as lab:
        stage = Stage(lab, folder, machines)
        await stage.start("router")
        await stage.start(*stage.services)
        for number in range(runs):
            run = await one(stage, chance, kinds)
            results.append(run)
            wrong += [f"run {number}, {run.broken}: {each}" for each in run.wrong]
            print(f"{number:>3} {run.broken}: {_told(run)}{'; '.join(['', *run.wrong])}", flush=True)
            await stage.revive()
        await asyncio.sleep(settle)
        stage.read()
        lost = verdict.unanswered(stage.events, stage.living(), time.monotonic() - max(settle, HUNG_AFTER) / 2)
        wrong += [f"lost: {each}" for each in lost]
        slow = [(since - 1.0, to + ENDS_WITHIN) for since, to in stage.slow]
        # What the host itself did is in no log of ours: ends that may come of it are not judged.
        judged = [
            each
            for each in stage.events
            if each["what"] not in ("answer", "told") or not any(since <= each["t"] <= to for since, to in slow)
        ]
        wrong += [f"untrue: {each}" for each in verdict.untrue(judged, stage.injuries, ENDS_WITHIN)]
        if len(stage.slow):
            print(f"the host stood still {len(stage.slow)} times; {len(stage.events) - len(judged)} ends not judged")
        wrong += [f"doubled: {each}" for each in verdict.doubled(stage.events)]
        wrong += [f"spoken twice: {each}" for each in verdict.spoken_twice(stage.events, "collaboration")]
        stage.close()
    faults = [
        (run.span.began - 0.1, run.span.healed + (run.back or 0.0) + AFTERMATH)
        for run in results
        if run.broken.kind != CALM
    ]
    wrong += [
        f"held without a fault: {each}"
        for each in verdict.groundless(stage.events, [*faults, *stage.stood_still, *slow])
    ]
    ends = [each for each in judged if each["what"] == "told" and verdict.is_not_done(each)]
    causes = Counter(f"{each['cause'] or 'itself'} of {each['blamed'] or each['speaker']}" for each in ends)
    told = Counter(each["told"].split(":")[0] for each in stage.events if _is_fragment(each))
    (folder / "faults.json").write_text(
        json.dumps([{**each._asdict(), "injured": sorted(each.injured)} for each in stage.injuries])
    )
    print(f"\n{len(results)} faults, seed {seed}, {machines} machines; {stage.plays} tangrams came to their end")
    print(f"fragments told to the manager: {dict(told)}")
    print(f"causes of {len(ends)} ends that were not done, to whoever had asked: {dict(causes.most_common())}")
    for name, values in (
        ("held after", [run.motion.held for run in results if run.broken.stops]),
        ("last word after", [run.motion.quiet for run in results if run.broken.stops and run.motion.held]),
        ("still after", [run.motion.still for run in results if run.broken.stops and run.motion.held]),
        *((f"back after {kind}", [run.back for run in results if run.broken.kind == kind]) for kind in KINDS),
        ("next word after", [run.next for run in results]),
    ):
        print(f"{name}: {verdict.shares(values)}")
    print("\n".join(wrong) or "nothing was wrong")
    return wrong


def _is_fragment(event: dict[str, Any]) -> bool:
    return bool(event["what"] == "told" and "|perform_fragment|" in event["whose"])


def _told(run: Run) -> str:
    figures = {"held": run.motion.held, "quiet": run.motion.quiet, "still": run.motion.still}
    figures |= {"back": run.back, "next word": run.next}
    return ", ".join(f"{name} {value:.2f}" for name, value in figures.items() if value is not None)


def main() -> int:
    """Run as the command line says; 1 if something was wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--machines", type=int, choices=sorted(LAYOUT), default=3)
    parser.add_argument("--kinds", nargs="+", choices=(*KINDS, CALM), default=KINDS)
    parser.add_argument("--folder", type=Path, help="where records are kept; a new one unless given")
    options = parser.parse_args()
    if why := missing(*(("time",) if "clock" in options.kinds else ())):
        print(why, file=sys.stderr)
        return 3
    folder = options.folder or Path(tempfile.mkdtemp(prefix="faults-"))
    folder.mkdir(parents=True, exist_ok=True)
    print(f"records: {folder}", flush=True)
    return bool(asyncio.run(play(folder, options.runs, options.seed, options.machines, options.kinds)))


if __name__ == "__main__":
    os.umask(0o077)
    sys.exit(main())
