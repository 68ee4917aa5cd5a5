"""Eyes on rendered people of whom nothing was learned: faces found, errors of heads, processor time of a picture.

python benchmarks/eyes.py [--pictures 24] [--first 100] [--people 5001] [--page] [--json]

`make eyes` fetches what it needs. --pictures: of each of ten people. --first: number of the first person, as a seed
of the pictures. --people: ten others are made up, from this seed on; those who are learned from have smaller ones.
--page: what a page finds in the same pictures, in Chromium, beside that.
"""

import argparse
import asyncio
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

from engage_hri.schemas.perception import FaceLandmarks
from engage_hri.schemas.recognition import SureLook
from engage_hri.schemas.units import Stamp
from engage_hri.services.perception.eyes.config import EyesConfig
from engage_hri.services.perception.eyes.head_pose import head, yaw_pitch
from engage_hri.services.perception.eyes.looking import packed
from engage_hri.services.perception.eyes.seeing import Seeing
from engage_hri.services.perception.eyes.sources.litert import FaceFinder
from engage_hri.services.recognition.perceive.sure_looks import Angles, SureLooks
from tests.perception.eyes.cases import CHUNKS, cases
from tests.perception.eyes.fetched import MODELS
from tests.perception.eyes.film_of_looks import habit, stray
from tests.perception.eyes.page_faces import found as found_by_page
from tests.perception.eyes.people import CAMERA, JUDGED, Looks, crowd

FIRST = 100
"""Number of the first person who is judged, as a seed: those who are learned from have smaller ones."""
SURE = 6
"""Pictures of each person in which it is known where the head points, for what is learned of them."""
Chunk = tuple[int, Looks, int, int, int]
"""Person, how it looks, seed of its pictures, part, and number of pictures in it."""
TIMES = 20
"""How often each picture is looked at, for its processor time."""


class Measured(NamedTuple):
    """A picture. yaw, pitch, beside: errors, degrees; None: no face was found. distance: share of the true one.

    sure: errors of yaw and pitch as shares of the stated deviations. told, true: angles of the head from the line to
    the camera, and deviations that are stated, degrees. look, behind: processor milliseconds.
    """

    person: int
    look: float
    behind: float = 0.0
    yaw: float | None = None
    pitch: float | None = None
    beside: float = 0.0
    distance: float = 0.0
    sure: tuple[float, float] = (0.0, 0.0)
    told: Angles = (0.0, 0.0)
    true: Angles = (0.0, 0.0)
    stated: Angles = (0.0, 0.0)


def measured(chunk: Chunk) -> list[Measured]:
    person, looks, seed, number, count = chunk
    found = []
    for case in cases(looks, seed, number, count):
        finder = FaceFinder(MODELS, 4)
        begin = time.process_time()
        for _ in range(TIMES):
            faces = finder.find(case.picture)
        look = 1000 * (time.process_time() - begin) / TIMES
        seen = head(faces[0][0], CAMERA.width, CAMERA.height, CAMERA.focal) if faces else None
        if seen is None:
            found.append(Measured(person, look))
            continue
        told = FaceLandmarks(at=Stamp("", 0), width=CAMERA.width, height=CAMERA.height, faces=(packed(faces[0][0]),))
        seeing = Seeing(EyesConfig())
        begin = time.process_time()
        for k in range(TIMES):
            seeing.feed(told, k / 15)
        behind = 1000 * (time.process_time() - begin) / TIMES
        wrong = np.array(yaw_pitch(seen.ahead)) - yaw_pitch(case.pose.ahead)
        beside = np.arccos(np.clip(seen.ahead @ case.pose.ahead, -1, 1))
        yaw, pitch = np.degrees(wrong).tolist()
        back = yaw_pitch(-np.array(case.pose.at))
        told_at, true_at = (np.degrees(np.subtract(yaw_pitch(way), back)) for way in (seen.ahead, case.pose.ahead))
        found.append(
            Measured(
                person, look, behind, yaw, pitch, float(np.degrees(beside)),
                float(seen.distance / np.linalg.norm(case.pose.at)),
                (abs(wrong[0]) / seen.yaw_spread, abs(wrong[1]) / seen.pitch_spread),
                (told_at[0], told_at[1]), (true_at[0], true_at[1]),
                (math.degrees(seen.yaw_spread), math.degrees(seen.pitch_spread)),
            )
        )  # fmt: skip
    return found


def summary(rows: Sequence[Measured]) -> dict[str, float]:
    seen = [row for row in rows if row.yaw is not None]
    beside = np.array([row.beside for row in seen])
    angles = np.array([(row.yaw, row.pitch) for row in seen], float)
    people = np.array([row.person for row in seen])
    biases = np.array([angles[people == person].mean(0) for person in sorted(set(people.tolist()))])
    sure = np.array([row.sure for row in seen])
    distance = np.array([row.distance for row in seen])
    figures = {
        "pictures": len(rows),
        "faces found, %": 100 * len(seen) / len(rows),
        "head beside the truth, degrees, mean": beside.mean(),
        "... median": np.median(beside),
        "... of nine in ten at most": np.percentile(beside, 90),
        "yaw, bias": angles[:, 0].mean(),
        "yaw, scatter": angles[:, 0].std(),
        "yaw, largest bias of a person": biases[np.abs(biases[:, 0]).argmax(), 0],
        "pitch, bias": angles[:, 1].mean(),
        "pitch, scatter": angles[:, 1].std(),
        "pitch, largest bias of a person": biases[np.abs(biases[:, 1]).argmax(), 1],
        "yaw within the stated deviation, % (68 is right)": 100 * (sure[:, 0] < 1).mean(),
        "pitch within the stated deviation, %": 100 * (sure[:, 1] < 1).mean(),
        "distance, bias, %": 100 * (distance.mean() - 1),
        "distance, scatter, %": 100 * distance.std(),
        "processor of a picture, ms, median": np.median([row.look for row in rows]),
        "... behind the landmarks": np.median([row.behind for row in seen]),
    }
    return {name: round(float(value), 2) for name, value in figures.items()}


def after_sure_looks(rows: Sequence[Measured]) -> dict[str, float]:
    """Figures of the other pictures when the first ones of each person were looks of which it is known at what.

    Of heads: each points at what is looked at. Of what is looked at: each head goes its own share of the way there
    from the robot, as people's do (`film_of_looks`), and what a head is off counts up to twice.
    """
    figures: dict[str, float] = {}
    for what in ("head", "what is looked at"):
        before, after = list[Angles](), list[Angles]()
        for person in sorted({row.person for row in rows}):
            chance = np.random.default_rng([37, person])
            share, strays = (np.ones(2), 0.0) if what == "head" else (np.array(habit(chance)), 1.0)
            seen = [row for row in rows if row.person == person and row.yaw is not None]
            aims = [(np.array(row.true) - strays * np.array(stray(chance)[:2])) / share for row in seen]
            own, looks = [*zip(seen, aims, strict=True)], SureLooks()
            looks.remember(
                SureLook(head=row.told, aim=(float(aim[0]), float(aim[1])), spread=row.stated)
                for row, aim in own[:SURE]
            )
            for known, wrong in ((SureLooks(), before), (looks, after)):
                for row, aim in own[SURE:]:
                    (yaw, pitch), _ = known.aim(row.told, row.stated)
                    wrong.append((yaw - aim[0], pitch - aim[1]))
        for name, wrong in (("no sure look", before), ("six sure looks", after)):
            aside, above = np.array(wrong).T
            figures |= {
                f"{what} after {name}, beside, mean": np.hypot(aside, above).mean(),
                f"... median, {what}, {name}": np.median(np.hypot(aside, above)),
                f"... yaw, bias, {what}, {name}": aside.mean(),
                f"... pitch, bias, {what}, {name}": above.mean(),
            }
    return {name: round(float(value), 2) for name, value in figures.items()}


def in_a_page(chunks: Sequence[Chunk]) -> dict[str, float]:
    """Compare what a page finds with what LiteRT does."""
    pictures = [case.picture for chunk in chunks for case in cases(*chunk[1:])]
    apart, missed = [], 0
    for by_page, picture in zip(asyncio.run(found_by_page(pictures)), pictures, strict=True):
        here = FaceFinder(MODELS, 4).find(picture)
        missed += len(by_page) != len(here)
        for (points, _), (others, _) in zip(by_page, here, strict=False):
            one, other = (head(each, CAMERA.width, CAMERA.height, CAMERA.focal) for each in (points, others))
            if one is not None and other is not None:
                apart.append(np.degrees(np.arccos(np.clip(one.ahead @ other.ahead, -1, 1))))
    figures = {
        "page: pictures with another number of faces": missed,
        "page: heads more than a degree beside those of LiteRT": sum(each > 1 for each in apart),
        "page: head beside that of LiteRT, degrees, mean": np.mean(apart),
        "... most": np.max(apart),
    }
    return {name: round(float(value), 3) for name, value in figures.items()}


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--pictures", type=int, default=24)
    parser.add_argument("--first", type=int, default=FIRST)
    parser.add_argument("--people", type=int)
    parser.add_argument("--page", action="store_true")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    people = JUDGED if options.people is None else crowd(range(options.people, options.people + len(JUDGED)))
    count = options.pictures // CHUNKS
    chunks = [
        (who, looks, options.first + who, part, count) for who, looks in enumerate(people) for part in range(CHUNKS)
    ]
    with Pool(2) as pool:
        rows = [row for found in pool.map(measured, chunks, 1) for row in found]
    figures = summary(rows) | after_sure_looks(rows) | (in_a_page(chunks) if options.page else {})
    if options.json:
        print(json.dumps(figures))
        return
    for name, value in figures.items():
        print(f"{name:58s} {value:8.2f}")


if __name__ == "__main__":
    main()
