"""`python -m tests.judge`: perform random stories, judge them, print a table and the smallest stories that fail."""

import argparse
import json
import sys
import time
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any, cast

import msgspec
from msgspec import Struct

from tests.judge import generate, laws_time, playing, reading
from tests.judge.case import Case, Finding
from tests.judge.generate import Kind
from tests.judge.laws import LAWS, judge
from tests.judge.shrinking import shrink
from tests.judge.story import Story, read, write
from tests.recognition.test_coded_timelines import JUDGES

DIGITS = 3


class Run(Struct):
    """What came of one story.

    dropped: behaviors, by the outcomes. unmade: behaviors of which something was told that was not made.
    late: blocks with a LATE warning. off: seconds by which each block that could be foreseen missed its predictions.
    """

    number: int
    blocks: int
    behaviors: int
    statuses: dict[str, int]
    dropped: list[str]
    unmade: list[str]
    late: int
    off: list[float]
    findings: list[Finding]
    seconds: float


def run(number: int, *, seed: int, kind: Kind, faults: bool, holds: bool = False) -> Run:
    """Perform and judge one story."""
    began = time.process_time()
    story = generate.story(seed, number, kind, faults=faults, holds=holds)
    record = playing.play(story, asks=kind == "sentences")
    case = Case(story, record)
    findings = judge(story, record)
    dropped = [
        f"{block}:{id}" for block in case.blocks if (end := record.outcome(block)) is not None for id in end.dropped
    ]
    return Run(
        number, len(case.blocks), sum(len(block.behaviors) for block in case.blocks.values()),
        Counter(record.status(block) or "none" for block in case.blocks), dropped,
        sorted({f"{each.block}:{each.behavior}" for each in findings if each.law == "pointless"}),
        sum(any(it.kind == "LATE" for it in record.warnings(block)) for block in case.blocks),
        [round(seconds, DIGITS) for seconds in laws_time.misses(case)], findings, time.process_time() - began,
    )  # fmt: skip


def breaks(story: Story, law: str, *, asks: bool) -> bool:
    """Whether a law is broken when this story is performed."""
    try:
        for deed in story.blocks:
            reading.read(deed.xml)
        return bool(story.blocks) and any(each.law == law for each in judge(story, playing.play(story, asks=asks)))
    except Exception:  # a story that cannot be performed is not the one that is looked for
        return False


def table(runs: list[Run]) -> str:
    """What was performed, and how many stories break each law."""
    statuses: Counter[str] = Counter()
    for each in runs:
        statuses.update(each.statuses)
    off = [seconds for each in runs for seconds in each.off]
    dropped = sum(len(each.dropped) for each in runs)
    count = sum(each.behaviors for each in runs)
    late = sum(seconds > laws_time.EXACT for seconds in off)
    share = 100 * late / max(1, len(off))
    lines = [
        f"{len(runs)} stories, {sum(each.blocks for each in runs)} blocks, {count} behaviors",
        f"ended: {', '.join(f'{name} {number}' for name, number in sorted(statuses.items()))}",
        f"behaviors dropped: {dropped}; told without having been made: {sum(len(each.unmade) for each in runs)}",
        f"blocks with something LATE: {sum(each.late for each in runs)}",
        f"blocks off their predictions by more than 10 ms: {late} of {len(off)} ({share:.1f} %)",
    ]
    broken = Counter(law for each in runs for law in {finding.law for finding in each.findings})
    lines += [f"{broken[law]:6d}  {law}: {meaning}" for law, meaning in LAWS.items()]
    seconds = sum(each.seconds for each in runs)
    return "\n".join([*lines, f"{len(runs) / max(seconds, 1e-9):.0f} stories a second of one core"])


def compared(runs: list[Run], before: dict[str, Any]) -> str:
    """Behaviors that are lost now, in stories where they were made before; and the other way.

    Lost is what was dropped, and what was told without having been made.
    """
    were = {each["number"]: each for each in before["runs"]}
    more, fewer = [], []
    for each in runs:
        if (then := were.get(each.number)) is not None:
            now, once = {*each.dropped, *each.unmade}, {*then["dropped"], *then["unmade"]}
            more += [f"{each.number} {name}" for name in sorted(now - once)]
            fewer += [f"{each.number} {name}" for name in sorted(once - now)]
            refused = each.statuses.get("refused", 0) - then["statuses"].get("refused", 0)
            (more if refused > 0 else fewer).extend([f"{each.number} refused"] * abs(refused))
    return f"lost now and not then: {len(more)} {more[:20]}\nlost then and not now: {len(fewer)} {fewer[:20]}"


def show(runs: list[Run], options: argparse.Namespace) -> None:
    """Print the first failures of each law, shrunk, with how to see them again."""
    asks = options.kind == "sentences"
    for law in LAWS:
        failing = [each for each in runs if any(finding.law == law for finding in each.findings)]
        if failing:
            print(f"\n{law}: stories {', '.join(str(each.number) for each in failing[:40])}")
        for each in failing[: options.examples]:
            story = generate.story(
                options.seed, each.number, options.kind, faults=options.faults, holds=options.holds
            )
            smallest = shrink(story, lambda one, law=law: breaks(one, law, asks=asks))  # type: ignore[misc]
            folder = Path(options.save) / f"{law.replace(' ', '-').replace(',', '')}-{options.kind}-{each.number}"
            write(smallest, folder)
            found = [it for it in judge(smallest, playing.play(smallest, asks=asks)) if it.law == law]
            print(f"  {story.seed}: {found[0] if found else each.findings[0]}")
            print(f"  python -m tests.judge --story {folder}")
            for deed in smallest.deeds:
                follows = f" follows {', '.join(deed.follows)}" if deed.follows else ""
                print(f"    {deed.at:.2f} s {deed.kind} {deed.block} {deed.behavior}{follows}")
                print("".join(f"      {line.strip()}\n" for line in deed.xml.splitlines() if line.strip()), end="")


def replay(folder: Path) -> int:
    """Perform a story from its files, and print all that was told and found."""
    story = read(folder)
    record = playing.play(story, asks=True)
    for told in record.told:
        print(f"{told.at:9.3f}  {msgspec.json.encode(told.message).decode()}")
    for block, ends in record.ends.items():
        for end in ends:
            print(f"{end.at:9.3f}  {block} ended: {end.status} {end.reason}")
    found = judge(story, record)
    print("\n".join(map(str, found)) or "nothing is wrong")
    return 1 if found else 0


def judge_talk(first: int, runs: int, jobs: int, examples: int) -> int:
    """Compare what recognition tells of random talk with what a coder writes down, and print the differences."""
    numbers, failed = range(first, first + runs), 0
    for name, (differences, _) in JUDGES.items():
        with ProcessPoolExecutor(jobs) as pool:
            found = list(pool.map(differences, numbers, chunksize=8))
        wrong = [(seed, differing) for seed, (_, differing) in zip(numbers, found, strict=True) if differing]
        print(f"{runs} timelines of {name}, {sum(count for count, _ in found)} events; {len(wrong)} timelines differ")
        for seed, differing in wrong[:examples]:
            print(f"timeline {seed}", *differing, sep="\n  ")
        failed += len(wrong)
    return 1 if failed else 0


def parsed(arguments: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.judge", description=__doc__)
    parser.add_argument("--runs", type=int, default=200, help="number of stories")
    parser.add_argument("--first", type=int, default=0, help="number of the first story")
    parser.add_argument("--seed", type=int, default=1, help="another seed, other stories")
    kinds = parser.add_mutually_exclusive_group()
    kinds.add_argument("--streams", dest="kind", action="store_const", const="streams", help="several blocks each")
    kinds.add_argument("--sentences", dest="kind", action="store_const", const="sentences", help="untimed sentences")
    kinds.add_argument("--webs", dest="kind", action="store_const", const="webs", help="blocks tied to each other")
    kinds.add_argument("--talk", action="store_true", help="talk and looks of people (not blocks)")
    kinds.add_argument("--crowds", dest="kind", action="store_const", const="crowds", help="many small blocks")
    parser.set_defaults(kind="alone")
    parser.add_argument("--faults", action="store_true", help="a body that is slow, stalls, fails, loses reports")
    parser.add_argument("--holds", action="store_true", help="parts of the stories are held for a while")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--examples", type=int, default=1, help="failures of each law that are shrunk and shown")
    parser.add_argument("--save", default="build/judge", help="folder for the failures")
    parser.add_argument("--json", help="file for all numbers")
    parser.add_argument("--against", help="file that --json wrote before: what is lost now that was not then")
    parser.add_argument("--story", help="folder of one story: perform it again and show everything")
    return parser.parse_args(arguments)


def main(arguments: list[str]) -> int:
    options = parsed(arguments)
    if options.story:
        return replay(Path(options.story))
    if options.talk:
        return judge_talk(options.first, options.runs, options.jobs, options.examples)
    one = partial(run, seed=options.seed, kind=cast(Kind, options.kind), faults=options.faults, holds=options.holds)
    numbers = range(options.first, options.first + options.runs)
    if options.jobs > 1:
        with ProcessPoolExecutor(options.jobs) as pool:
            runs = list(pool.map(one, numbers, chunksize=8))
    else:
        runs = [one(number) for number in numbers]
    print(table(runs))
    if options.json:
        numbers_told = {"seed": options.seed, "kind": options.kind, "faults": options.faults, "holds": options.holds}
        Path(options.json).write_text(
            json.dumps({**numbers_told, "runs": msgspec.to_builtins(runs)}), encoding="utf-8"
        )
    if options.against:
        print(compared(runs, json.loads(Path(options.against).read_text(encoding="utf-8"))))
    show(runs, options)
    return 1 if any(each.findings for each in runs) else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
