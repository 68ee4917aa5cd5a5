"""Synthesis of speech: milliseconds a sentence in its own process, against the engine alone.

python benchmarks/voice.py [--json]
"""

import asyncio
import json
import resource
import sys
import time
from collections.abc import Callable
from statistics import median, quantiles

from engage_hri.schemas.behaviors import Speech
from engage_hri.schemas.world import World
from engage_hri.services.control.voice.clauses import clause
from engage_hri.services.control.voice.espeak import EspeakSettings, EspeakSynthesizer
from engage_hri.services.control.voice.sounding import EspeakVoice
from engage_hri.services.control.voice.timeline import pieces

NOUNS = ("triangle", "square", "rectangle", "piece", "picture", "house", "corner")
WORLD = World(entities=())


def sentence(number: int) -> Speech:
    """A sentence of about 3 s that was never said before."""
    first, second = NOUNS[number % 7], NOUNS[number // 7 % 7]
    return Speech(id="s", text=f"Now move {first} number {number} so that it touches the {second}, please.")


def timed(count: int, act: Callable[[Speech], object]) -> list[float]:
    taken = []
    for number in range(count):
        begin = time.perf_counter()
        act(sentence(number))
        taken.append(1000 * (time.perf_counter() - begin))
    return taken


async def measured(count: int = 100) -> dict[str, list[float]]:
    engine, voice = EspeakSynthesizer(EspeakSettings()), EspeakVoice(EspeakSettings(device="none", patience=1.0))
    rows: dict[str, list[float]] = {}
    async with voice.connected():
        rows["the engine alone"] = timed(count, lambda speech: engine.say(pieces(speech)[0].phrase))
        rows["with words and lips laid out"] = timed(count, lambda speech: clause(engine, pieces(speech)[0].phrase))
        rows["an estimate of a new text"] = timed(count, lambda speech: voice.estimate(speech, None, WORLD))
        rows["an estimate of a known text"] = timed(count, lambda speech: voice.estimate(speech, None, WORLD))
    return rows


def main() -> None:
    rows = asyncio.run(measured())
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    first = median(next(iter(rows.values())))
    seconds = (
        sum(clause(EspeakSynthesizer(EspeakSettings()), pieces(sentence(n))[0].phrase).seconds for n in range(5)) / 5
    )
    if "--json" in sys.argv:
        print(
            json.dumps({name: {"p50": median(row), "p99": quantiles(row, n=100)[98]} for name, row in rows.items()})
        )
        return
    print(f"a sentence of {seconds:.1f} s, milliseconds")
    print(f"{'':34}{'p50':>8}{'p99':>8}{'ratio':>8}")
    for name, row in rows.items():
        print(f"{name:34}{median(row):8.2f}{quantiles(row, n=100)[98]:8.2f}{median(row) / first:8.2f}")
    print(f"processor of its process: {used.ru_utime + used.ru_stime:.2f} s in all, start included")


if __name__ == "__main__":
    main()
