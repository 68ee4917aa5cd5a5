"""Looks in films of rendered people of whom nothing was learned: from pictures to what recognition names.

python benchmarks/looks.py [--people 5] [--looks 60] [--json]     (`make eyes` fetches what it needs; an hour)

Of each film twice: as it is, and after six looks of which it is known at what they are. docs/eyes.md has the figures.
"""

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from multiprocessing import Pool
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from engage_hri.schemas.perception import FaceLandmarks, HeadPose
from engage_hri.services.perception.eyes.seeing import Seeing, SeenHead
from tests.perception.eyes.film_of_looks import EYES, FilmedPerson, filmed, landmarks
from tests.perception.eyes.judged_looks import WHO, JudgedLooks, judged, told_looks


def poses(told: Sequence[FaceLandmarks]) -> Iterator[HeadPose]:
    """What eyes tell of heads, as the service of eyes does."""
    seeing = Seeing(EYES)
    for each in told:
        for seen in seeing.feed(each, each.at.seconds):
            if isinstance(seen, SeenHead) and seen.person == WHO:
                yaw, pitch = seen.spread
                yield HeadPose(
                    actor=WHO, position=seen.place, direction=seen.direction, at=each.at, yaw_spread=yaw,
                    pitch_spread=pitch,
                )  # fmt: skip


def measured(person: FilmedPerson, told: Sequence[FaceLandmarks]) -> tuple[JudgedLooks, JudgedLooks]:
    """Judge a film, without and with sure looks."""
    heads = [*poses(told)]
    plain, learned = (
        judged(told_looks(heads, person.looks, learns=learns), person.looks) for learns in (False, True)
    )
    return plain, learned


def run(job: tuple[int, int]) -> tuple[JudgedLooks, JudgedLooks]:
    """Film somebody, and judge it."""
    person = filmed(*job)
    return measured(person, [*landmarks(person)])


def summary(sums: JudgedLooks) -> dict[str, float]:
    figures = {
        "robot, table or elsewhere right, % of the time": sums.kinds / sums.times,
        "... begun within 0.25 s, % of looks": sums.onsets / sums.all_looks,
        "piece among what is named, % of looks at pieces": sums.among / max(1, sums.pieces),
        "one piece named alone, % of looks at pieces": sums.sure / max(1, sums.pieces),
        "... and it is the right one, %": sums.sure_right / max(1, sums.sure),
    }
    return {name: round(100 * share, 1) for name, share in figures.items()}


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--people", type=int, default=5)
    parser.add_argument("--looks", type=int, default=60)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    with Pool(2) as pool:
        found = pool.map(run, [(number, options.looks) for number in range(options.people)], 1)
    plain, learned = (sum((each[k] for each in found), JudgedLooks()) for k in (0, 1))
    figures = {"as it is": summary(plain), "after six sure looks": summary(learned)}
    if options.json:
        print(json.dumps(figures))
        return
    for name, rows in figures.items():
        print(name)
        for row, value in rows.items():
            print(f"    {row:52s} {value:6.1f}")


if __name__ == "__main__":
    main()
