"""Contenders measured beside one another in one run: in turns, so that a busy machine is busy for all of them."""

import asyncio
import json
import os
import subprocess
import sys
from collections.abc import Sequence
from statistics import quantiles
from typing import Protocol, Self

from engage_hri.schemas.units import Seconds


class Contender(Protocol):
    """One way there and back. `name` heads its row; `lap` returns the seconds of each of `count` trips."""

    name: str

    async def lap(self, count: int) -> list[Seconds]: ...


class OtherSide:
    """The process at the other end: this benchmark's file again, as `FILE --serve ROLE ENDPOINT ...`."""

    def __init__(self, file: str, role: str, endpoint: str, *more: str) -> None:
        self._command = [sys.executable, file, "--serve", role, endpoint, *more]

    def __enter__(self) -> Self:
        self._process = subprocess.Popen(self._command, stdout=subprocess.PIPE, text=True)
        assert self._process.stdout is not None
        if "stands\n" not in iter(self._process.stdout.readline, ""):  # Zenoh may say something before
            raise RuntimeError(f"{' '.join(self._command)} did not start")
        return self

    def __exit__(self, *exception: object) -> None:
        self._process.terminate()
        self._process.communicate()


def stands() -> None:
    """For the other side: say that it may begin. What it prints after that, as Zenoh's log, nobody reads."""
    print("stands", flush=True)
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


async def compare(contenders: Sequence[Contender], laps: int, trips: int) -> dict[str, list[Seconds]]:
    """`laps` turns of `trips` each, after one lap that does not count."""
    taken: dict[str, list[Seconds]] = {contender.name: [] for contender in contenders}
    for lap in range(laps + 1):
        for contender in contenders:
            async with asyncio.timeout(60.0):
                seconds = await contender.lap(trips)
            if lap:
                taken[contender.name] += seconds
    return taken


def percentile(seconds: Sequence[Seconds], percent: int) -> Seconds:
    return quantiles(seconds, n=100, method="inclusive")[percent - 1]


def report(taken: dict[str, list[Seconds]], as_json: bool) -> None:
    """The table: milliseconds, and each as a multiple of the first row."""
    first = next(iter(taken.values()))
    rows = [
        {
            "name": name,
            "trips": len(seconds),
            **{f"p{p}_ms": round(1000 * percentile(seconds, p), 3) for p in (50, 99)},
            **{f"p{p}_ratio": round(percentile(seconds, p) / percentile(first, p), 2) for p in (50, 99)},
        }
        for name, seconds in taken.items()
    ]
    if as_json:
        print(json.dumps(rows))
        return
    print(f"{'':44}{'trips':>7}{'p50 ms':>9}{'p99 ms':>9}{'p50 ratio':>11}{'p99 ratio':>11}")
    for row in rows:
        print(
            f"{row['name']:44}{row['trips']:>7}{row['p50_ms']:>9.3f}{row['p99_ms']:>9.3f}"
            f"{row['p50_ratio']:>11.2f}{row['p99_ratio']:>11.2f}"
        )
