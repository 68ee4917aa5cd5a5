"""Pieces on drawn tables from the robot's eyes: relations right, missed and invented, places, processor time.

python benchmarks/pieces.py [--tables 500] [--first 0] [--json]

--first: number of the first table. The mends so far were made on those below 100.

A fifth of the tables each: even light; noise 20; the same in light of 1.5 and of 0.45; and with a hand that comes
over the table once it has been seen. Colors are learned from one picture of other noise and another sun.
"""

import argparse
import json
import math
import sys
import time
from collections.abc import Sequence
from multiprocessing import Pool
from pathlib import Path
from typing import NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from engage_hri.schemas.units import Stamp
from engage_hri.schemas.world import Entity
from engage_hri.services.perception.eyes.camera import StatedCamera
from engage_hri.services.perception.pieces.finding import FlatTable, PieceFinder, learned
from engage_hri.services.perception.pieces.keeping import PieceKeeper
from engage_hri.services.perception.pieces.spotting import SpottedPieces
from tests.perception.pieces.appendix_a import poses_told, relations
from tests.perception.pieces.tables import EVEN, EYE, STARTS, TABLE, Hand, Light, drawn, layout

CONDITIONS = {
    "even light, noise 4": EVEN, "noise 20": Light(1.0, 20), "light 1.5, noise 20": Light(1.5, 20),
    "light 0.45, noise 20": Light(0.45, 20), "a hand comes, noise 10": Light(1.0, 10),
}  # fmt: skip
RATE = 5.0


class Judged(NamedTuple):
    """A table. away: millimetres; turned: degrees, of each piece that is told. first, later: milliseconds."""

    condition: str
    right: int
    missed: int
    invented: int
    pieces: int
    away: list[float]
    turned: list[float]
    first: float
    later: float
    wrong: list[str]


def judged(number: int) -> Judged:
    """Show a table twice, and twice more with the hand, if one comes; judge what is told then."""
    condition = [*CONDITIONS][number % len(CONDITIONS)]
    light = CONDITIONS[condition]
    camera = StatedCamera(EYE.field, EYE.at, -EYE.down, EYE.left, EYE.lean)
    flat = FlatTable(TABLE, camera, EYE.width, EYE.height)
    palette = learned(drawn(STARTS, EYE, Light(1.0, 4), seed=100_000 + number % 7), TABLE, flat)
    rng = np.random.default_rng([37, number])
    truth = layout(rng)
    hand = Hand(
        (float(rng.uniform(0.45, 0.75)), float(rng.uniform(-0.3, 0.3))),
        float(rng.normal(0, 0.4)),
        int(rng.integers(4)),
    )
    hands = [(), (), (hand,), (hand,), (hand,)] if condition.startswith("a hand") else [(), ()]
    finder, keeper, spent = PieceFinder(TABLE, flat, palette), PieceKeeper(TABLE), list[float]()
    told: tuple[Entity, ...] = ()
    for k, each in enumerate(hands):
        picture = drawn(truth, EYE, light, each, seed=number, take=k)
        begin = time.process_time()
        seen = finder.find(picture)
        spent.append(1000 * (time.process_time() - begin))
        spotted = SpottedPieces(at=Stamp("", k / RATE), **seen._asdict())
        told = keeper.feed(spotted, k / RATE)
    poses = poses_told(told)
    expected, found = relations(truth), relations(poses)
    alike = {form.id: form.turns_alike for form in TABLE.pieces}
    away = [1000 * math.dist(pose[:2], truth[id][:2]) for id, pose in poses.items()]
    turned = [math.degrees(abs(math.remainder(p[2] - truth[id][2], math.tau / alike[id]))) for id, p in poses.items()]
    wrong = [f"{number}: {' '.join(each)}" for each in sorted(found - expected)]
    beside = zip(poses, away, turned, strict=True)
    wrong += [f"{number}: {id} {a:.1f} mm, {t:.0f} degrees" for id, a, t in beside if a > 5 or t > 8]
    return Judged(
        condition, len(expected & found), len(expected - found), len(found - expected), len(truth), away, turned,
        spent[0], spent[1], wrong,
    )  # fmt: skip


def figures(rows: Sequence[Judged]) -> dict[str, float]:
    away, turned = (np.concatenate([getattr(row, name) for row in rows]) for name in ("away", "turned"))
    right, missed = sum(row.right for row in rows), sum(row.missed for row in rows)
    made = {
        "tables": len(rows),
        "relations": right + missed,
        "... right, %": 100 * right / max(right + missed, 1),
        "... invented": sum(row.invented for row in rows),
        "pieces told, %": 100 * len(away) / sum(row.pieces for row in rows),
        "place, mean, mm": away.mean(),
        "... of 95 in 100 at most": np.percentile(away, 95),
        "... within 3 mm, %": 100 * (away <= 3).mean(),
        "turn, of 95 in 100 at most, degrees": np.percentile(turned, 95),
        "processor of the first picture, ms, median": np.median([row.first for row in rows]),
        "... of the next one": np.median([row.later for row in rows]),
    }
    return {name: round(float(value), 2) for name, value in made.items()}


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--tables", type=int, default=500)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    with Pool(2) as pool:
        rows = pool.map(judged, range(options.first, options.first + options.tables), 1)
    told = {name: figures([row for row in rows if row.condition == name]) for name in CONDITIONS}
    told["all"] = figures(rows)
    if options.json:
        print(json.dumps(told))
        return
    for name, each in told.items():
        print(name, *(f"    {what:44s} {value:8.2f}" for what, value in each.items()), sep="\n")
    print("invented, and pieces that lie elsewhere:", *(line for row in rows for line in row.wrong), sep="\n    ")


if __name__ == "__main__":
    main()
