"""`python -m tests.mutants`: change the code in one place, run the nearest tests, tell which change none has noticed.

Each mutant lives in a private copy of the tree. Of the tests that run its line, the nearest run first, and the first
red one ends it; a run that hangs ends it as well. What lives is either a hole in the tests or a change that changes
nothing: then `mutants.toml` beside this file has it, with the reason. The map of lines and tests is made once, by
`make mutants`.
"""

import argparse
import difflib
import json
import math
import os
import random
import re
import signal
import subprocess
import sys
import time
import tomllib
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from queue import SimpleQueue

from msgspec import Struct, to_builtins
from msgspec import json as fast

from tests.mutants.nearest import Nearest
from tests.mutants.operators import Change, changes, compiles

ROOT = Path(__file__).parents[2]
BUILD = ROOT / "build" / "mutants"
KEPT = Path(__file__).with_name("mutants.toml")
GOAL = 0.9
"""Share of the mutants of each folder that a test must notice; those that change nothing are not counted."""

STARTS = 30.0
"""Seconds that pytest needs to begin, at the worst."""


class Mutant(Struct):
    """One change. source: the line as it was. before, after: what has changed in it."""

    folder: str
    file: str
    change: Change
    source: str
    before: str

    @property
    def key(self) -> tuple[str, str, str, str]:
        """What stays the same when lines above it come and go."""
        return self.file, self.source, self.before, self.change.new


class Verdict(Struct):
    """killer: the test that failed; a file that could not be imported; `timeout`; or nothing: the mutant lives.

    tried: test files that have run. near: test files that run the line.
    """

    mutant: Mutant
    killer: str
    tried: int
    near: int
    seconds: float

    @property
    def is_noticed_anyhow(self) -> bool:
        """The mutant hung, or could not be imported: no claim of a test has failed."""
        return bool(self.killer) and "::" not in self.killer


def folders() -> dict[str, list[str]]:
    """Files by folder: each of services/, and schemas/ as one."""
    found: dict[str, list[str]] = {}
    for path in sorted([*ROOT.glob("services/*/**/*.py"), *ROOT.glob("schemas/**/*.py")]):
        file = path.relative_to(ROOT)
        found.setdefault("/".join(file.parts[:2]) if file.parts[0] == "services" else "schemas", []).append(str(file))
    return found


def drawn(seed: int, number: int, folder: str | None) -> list[Mutant]:
    """So many mutants, shared among folders by the root of their size. A folder's begin alike for any number."""
    pools = {name: [(file, each) for file in files for each in changes((ROOT / file).read_bytes())]
             for name, files in folders().items() if folder in (None, name)}  # fmt: skip
    whole = sum(math.sqrt(len(pool)) for pool in pools.values())
    shares = {name: math.ceil(number * math.sqrt(len(pool)) / whole) for name, pool in pools.items()}
    return [
        mutant for name, pool in pools.items()
        for mutant in _some(name, pool, random.Random(f"{seed}:{name}"), shares[name])
    ]  # fmt: skip


def _some(folder: str, pool: list[tuple[str, Change]], chance: random.Random, number: int) -> Iterator[Mutant]:
    """Each kind as likely, else most were numbers and removals; one of a line."""
    kinds = sorted({change.kind for _, change in pool})
    by_kind = {kind: [each for each in pool if each[1].kind == kind] for kind in kinds}
    places: set[tuple[str, int]] = set()
    while len(places) < number:
        file, change = chance.choice(by_kind[chance.choice(kinds)])
        source = (ROOT / file).read_bytes()
        if (file, change.line) not in places and compiles(change.applied(source)):
            places.add((file, change.line))
            yield Mutant(folder, file, change, source.decode().splitlines()[change.line - 1].strip(),
                         source[change.start : change.end].decode())  # fmt: skip


class Copy:
    """A private copy of the tree, as git sees it, with whatever is not committed."""

    def __init__(self, number: int) -> None:
        self._written = 1_000_000_000
        self.root = BUILD / f"tree-{os.getpid()}-{number}"
        subprocess.run(["rm", "-rf", self.root], check=True)
        self.root.mkdir(parents=True)
        files = subprocess.run(["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
                               cwd=ROOT, capture_output=True, check=True).stdout  # fmt: skip
        present = b"\0".join(
            name for name in files.split(b"\0") if name and os.path.lexists(ROOT / os.fsdecode(name))
        )
        subprocess.run(["xargs", "-0", "cp", "-a", "--parents", "-t", self.root], cwd=ROOT, input=present, check=True)
        (self.root / "build").mkdir()
        (self.root / "build/eyes").symlink_to(ROOT / "build/eyes")  # without models the tests of eyes skip

    def judged(self, mutant: Mutant, tests: Sequence[str], nearest: Nearest, budget: float) -> Verdict:
        """Run the nearest tests that take no longer than the budget together, at least one."""
        began, path, known = time.monotonic(), self.root / mutant.file, 0.0
        whole, left = path.read_bytes(), []
        for test in tests:
            if not left or known + nearest.seconds[test] <= budget:
                left.append(test)
                known += nearest.seconds[test]
        killer, tried = "", len(left)
        while left:
            self._write(path, mutant.change.applied(whole))
            try:
                killer = self._first_red(left, STARTS + 4.0 * known)
            finally:
                self._write(path, whole)
            # What is in real time may be late by itself: it has to be green without the mutant.
            file = killer.partition("::")[0]
            if file not in nearest.doubtful or not self._first_red([killer], STARTS + 4.0 * nearest.seconds[file]):
                break
            killer, left = "", left[left.index(file) + 1 :]
        return Verdict(mutant, killer, tried, len(tests), round(time.monotonic() - began, 1))

    def _write(self, path: Path, text: bytes) -> None:
        """With an age that no version of it has had: Python knows compiled code by age and size of its source."""
        path.write_bytes(text)
        self._written += 1
        os.utime(path, (self._written, self._written))

    def _first_red(self, tests: Sequence[str], bound: float) -> str:
        """The test that failed first, `timeout`, or nothing."""
        command = [sys.executable, "-m", "pytest", "-x", "-p", "tests.mutants.order", "-p", "no:cacheprovider",
                   "--tb=no", "-rfE", *tests]  # fmt: skip
        environment = {**os.environ, "PYTHONPATH": str(self.root)}
        process = subprocess.Popen(command, cwd=self.root, env=environment, stdout=subprocess.PIPE,
                                   stderr=subprocess.STDOUT, text=True, start_new_session=True)  # fmt: skip
        try:
            told, _ = process.communicate(timeout=bound)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
            return "timeout"
        match process.returncode:
            case 0 | 5:  # all green, or none was there to run
                return ""
            case 4 if "while loading conftest" in told:
                return "import of conftest.py"
            case 4:
                raise SystemExit(told)
        red = re.search(r"^(?:FAILED|ERROR) (\S+?\.py(?:::.*?)?)(?: - .*)?$", told, re.MULTILINE)
        return red[1] if red else "ended: " + told.strip().rpartition("\n")[2]


def diff(mutant: Mutant) -> str:
    source = (ROOT / mutant.file).read_bytes()
    lines = [text.decode().splitlines() for text in (source, mutant.change.applied(source))]
    return "\n".join(list(difflib.unified_diff(*lines, n=0, lineterm=""))[2:])


def known() -> dict[tuple[str, str, str, str], str]:
    """Reasons of `mutants.toml`."""
    return {(each["file"], each["line"], each["old"], each["new"]): each["reason"]
            for each in tomllib.loads(KEPT.read_text()).get("lives", [])}  # fmt: skip


def run(mutants: Sequence[Mutant], log: Path, jobs: int, budget: float) -> list[Verdict]:
    """Judge them, `jobs` at a time. Verdicts are written down: the next run judges what lived, and what is new."""
    old = [fast.decode(line, type=Verdict) for line in log.read_bytes().splitlines()] if log.exists() else []
    verdicts = {verdict.mutant.key: verdict for verdict in old}
    nearest, free = Nearest(ROOT), SimpleQueue[Copy]()
    for number in range(jobs):
        free.put(Copy(number))

    def one(mutant: Mutant) -> Verdict:
        copy = free.get()
        try:
            tests = nearest.tests(mutant.file, mutant.change, (ROOT / mutant.file).read_bytes())
            return copy.judged(mutant, tests, nearest, budget)
        finally:
            free.put(copy)

    killed = {key for key, verdict in verdicts.items() if verdict.killer}
    with ThreadPoolExecutor(jobs) as pool:
        for judging in as_completed([pool.submit(one, each) for each in mutants if each.key not in killed]):
            verdict = judging.result()
            with log.open("ab") as lines:
                lines.write(fast.encode(verdict) + b"\n")
            print(f"{verdict.mutant.file}:{verdict.mutant.change.line} {verdict.killer or 'LIVES'}", flush=True)
            verdicts[verdict.mutant.key] = verdict
    return [verdicts[mutant.key] for mutant in mutants]


def report(verdicts: Sequence[Verdict]) -> bool:
    """Print survivors, and a line for each folder. Returns whether each reaches the goal."""
    reasons, well = known(), True
    for verdict in verdicts:
        if not verdict.killer:
            mutant = verdict.mutant
            why = reasons.get(mutant.key, f"{verdict.tried} of {verdict.near} test files that run it are green")
            print(f"\n{mutant.file}:{mutant.change.line}: {why}\n{diff(mutant)}")
    print()
    for folder in sorted({verdict.mutant.folder for verdict in verdicts}):
        ours = [each for each in verdicts if each.mutant.folder == folder and each.mutant.key not in reasons]
        killed = sum(bool(verdict.killer) for verdict in ours)
        well &= killed >= GOAL * len(ours)
        anyhow = sum(verdict.is_noticed_anyhow for verdict in ours)
        told = f", {anyhow} without any claim" if anyhow else ""
        print(f"{folder:24}{killed:4} of {len(ours):3}  {killed / max(len(ours), 1):4.0%}{told}")
    return well


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m tests.mutants", description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--number", type=int, default=300, help="of all folders together (300)")
    parser.add_argument("--folder", choices=folders(), help="of this folder alone")
    parser.add_argument("--jobs", type=int, default=1, help="so many at a time")
    parser.add_argument(
        "--budget", type=float, default=90.0, help="seconds of tests for each mutant, by the map (90)"
    )
    parser.add_argument("--draw", action="store_true", help="print them, and run nothing")
    given = parser.parse_args()
    mutants = drawn(given.seed, given.number, given.folder)
    if given.draw:
        print(json.dumps(to_builtins(mutants), indent=1))
        return
    sys.exit(not report(run(mutants, BUILD / f"seed-{given.seed}.jsonl", given.jobs, given.budget)))


if __name__ == "__main__":
    main()
