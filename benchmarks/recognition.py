"""Recognition: observations a second for 1, 3 and 10 people, an hour replayed, what is kept over a day, passers-by.

    python benchmarks/recognition.py [--laps 5] [--observations 10000] [--hours 24] [--only speed] [--json]

What is observed is `tests/recognition/meeting.py`: people who look about, speak, gesture and move objects, and a
robot with blocks, feedback and requests. It goes through session and statistics as in the service, without a bus.

Seconds are those of the processor, so that others on the machine matter little.

- speed: microseconds per observation, and as a multiple of one person's, with statistics counted and made once at the
  end, as in a replay; beside the statistics alone, kept up with each change and made anew from the log;
- hour: how long an hour takes;
- passers: thousands of people who come, look, speak and go, one after the other, told of and filmed: milliseconds a
  visit, and what is kept;
- day: at each hour the objects and bytes that can be reached from session and statistics, and the process's memory.
"""

import argparse
import gc
import json
import os
import sys
from collections.abc import Iterable
from itertools import islice, takewhile
from pathlib import Path
from statistics import median
from time import process_time
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from engage_hri.schemas.recognition import ConnectionEvent
from engage_hri.schemas.units import Seconds
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.events.machine import Effect
from engage_hri.services.recognition.events.session import Observation, Session
from engage_hri.services.recognition.statistics.published import PublishedStatistics
from tests.recognition import recomputed
from tests.recognition.kept import reachable
from tests.recognition.meeting import meeting
from tests.recognition.observations import ROBOT
from tests.recognition.passers import Lobby, visit

Rows = list[dict[str, Any]]
PEOPLE = (1, 3, 10)
HOUR: Seconds = 3600.0
VISITS = (100, 1000, 2000, 10_000)


class Recognition:
    """Session and statistics, driven as the service does."""

    def __init__(self) -> None:
        self.session = Session(ROBOT, RecognitionConfig())
        self.published = PublishedStatistics(ROBOT, RecognitionConfig())
        self.log: list[ConnectionEvent] | None = None
        """Fill it to keep the events."""
        self.ended_at: Seconds = 0.0

    def run(self, observed: Iterable[tuple[Seconds, Observation]]) -> None:
        for at, observation in observed:
            while (due := self._deadline) is not None and due <= at:
                self._tell(self.session.advance(due), due)
            self._tell(self.session.feed(observation, at), at)
            self.ended_at = at
        self.published.overall(self.ended_at)

    @property
    def _deadline(self) -> Seconds | None:
        session, published = self.session.deadline, self.published.deadline
        if session is None or published is None:
            return session if published is None else published
        return min(session, published)

    def _tell(self, effects: list[Effect], now: Seconds) -> None:
        events = [effect for effect in effects if isinstance(effect, ConnectionEvent)] if effects else []
        self.published.feed(events, self.session.busy, now, self.session.contacts())
        if self.log is not None:
            self.log += events


def speed(laps: int, observations: int) -> Rows:
    """All contenders in turns; the median of the laps."""
    streams = {people: list(islice(meeting(people), observations)) for people in PEOPLE}
    taken: dict[int, list[Seconds]] = {people: [] for people in PEOPLE}
    for _ in range(laps):
        for people, stream in streams.items():
            recognition = Recognition()
            since = process_time()
            recognition.run(stream)
            taken[people].append((process_time() - since) / observations)
    one = median(taken[1])
    return [
        {
            "people": people,
            "per_second": round(1 / median(seconds)),
            "us": round(1e6 * median(seconds), 1),
            "ratio": round(median(seconds) / one, 2),
        }
        for people, seconds in taken.items()
    ]


def statistics(observations: int) -> Rows:
    """The events of one person's meeting, each change told at once: kept up, and made anew for each change."""
    recognition = Recognition()
    recognition.log = []
    recognition.run(islice(meeting(1), observations))
    log, config = recognition.log, RecognitionConfig()
    since = process_time()
    published = PublishedStatistics(ROBOT, config)
    for change in log:
        published.feed([change], set(), change.at.seconds)
        published.told(change.at.seconds)
    kept_up = (process_time() - since) / len(log)
    sample = range(len(log) // 20, len(log), max(1, len(log) // 20))
    since = process_time()
    for number in sample:
        for actor in ("", log[0].responder):
            lives = recomputed.lives(log[:number], actor)
            recomputed.statistics(lives)
            recomputed.statistics(recomputed.of_window(lives, log[number].at.seconds, config.window))
    anew = (process_time() - since) / len(sample)
    return [
        {"changes": len(log), "kept_up_us": round(1e6 * kept_up, 1), "anew_us": round(1e6 * anew, 1),
         "ratio": round(anew / kept_up, 1)}
    ]  # fmt: skip


def hour() -> Rows:
    rows = []
    for people in PEOPLE:
        stream = list(takewhile(lambda observed: observed[0] < HOUR, meeting(people)))
        recognition = Recognition()
        since = process_time()
        recognition.run(stream)
        seconds = process_time() - since
        rows.append({"people": people, "observations": len(stream), "cpu_seconds": round(seconds, 2),
                     "times_real_time": round(HOUR / seconds)})  # fmt: skip
    return rows


def day(hours: int, people: int) -> Rows:
    recognition, observed = Recognition(), meeting(people)
    rows: Rows = []
    for number in range(1, hours + 1):
        end = number * HOUR
        stream = takewhile(lambda one: one[0] < end, observed)  # noqa: B023  # drops one observation an hour
        since = process_time()
        recognition.run(stream)
        seconds = process_time() - since
        gc.collect()
        kept = list(reachable(recognition.session, recognition.published))
        rows.append({"hour": number, "objects": len(kept), "kB": round(sum(map(sys.getsizeof, kept)) / 1000, 1),
                     "process_MB": round(resident() / 1e6, 1), "cpu_seconds": round(seconds, 1)})  # fmt: skip
        del kept
    return rows


def passers() -> Rows:
    """Time of the last hundred visits; `known`: people who have not been forgotten."""
    rows: Rows = []
    for raw in (False, True):
        lobby, visits, taken = Lobby(RecognitionConfig()), 0, 0.0
        for number in VISITS:
            while visits < number:
                since = process_time()
                for at, observation in visit(visits, raw=raw):
                    lobby.feed(observation, at)
                taken = process_time() - since if visits % 100 == 0 else taken + process_time() - since
                visits += 1
            gc.collect()
            kept = list(reachable(*lobby.kept()))
            rows.append({"perception": "raw" if raw else "symbolic", "visits": number,
                         "ms_a_visit": round(10 * taken, 2), "known": len(lobby.recognizer.session.persons),
                         "objects": len(kept), "kB": round(sum(map(sys.getsizeof, kept)) / 1000)})  # fmt: skip
    return rows


def resident() -> int:
    """Bytes of this process in memory."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")


def report(title: str, rows: Rows) -> None:
    print(f"\n{title}\n")
    print("| " + " | ".join(name.replace("_", " ") for name in rows[0]) + " |")
    print("|---" * len(rows[0]) + "|")
    for row in rows:
        print("| " + " | ".join(map(str, row.values())) + " |")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--laps", type=int, default=5)
    parser.add_argument("--observations", type=int, default=10_000)
    parser.add_argument("--hours", type=int, default=24)
    parser.add_argument("--people", type=int, default=1, help="in the day")
    parser.add_argument("--only", choices=("speed", "hour", "passers", "day"))
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    measured: dict[str, Rows] = {}
    if options.only in (None, "speed"):
        measured["observations"] = speed(options.laps, options.observations)
        measured["statistics of each change"] = statistics(options.observations)
    if options.only in (None, "hour"):
        measured["an hour replayed"] = hour()
    if options.only in (None, "passers"):
        measured["passers-by"] = passers()
    if options.only in (None, "day"):
        measured["kept"] = rows = day(options.hours, options.people)
        last, first = rows[-1], rows[0]
        measured["last hour against first"] = [
            {name: round(last[name] / first[name], 3) for name in ("objects", "kB", "process_MB", "cpu_seconds")}
        ]
    if options.json:
        print(json.dumps(measured, indent=2))
        return
    for title, rows in measured.items():
        report(title, rows)


if __name__ == "__main__":
    main()
