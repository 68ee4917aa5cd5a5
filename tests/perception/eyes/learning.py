"""Learns the average face from rendered people, and how wrong it is of people of whom it knows nothing.

    python -m tests.perception.eyes.learning FOLDER

writes services/perception/eyes/average_face.npz. Each point of the face is where it lies in the heads of all people
on average, found from twenty pictures of each with a known head (`people.FITTED`); it weighs as much as it is the
same in all of them. What mends a head that was laid on its points, and the errors that are left, are of each tenth of
the people by a face that was learned from the others. FOLDER keeps the points that were found: who is there already
is not drawn again.
"""

import sys
from collections.abc import Sequence
from functools import partial
from multiprocessing import Pool
from pathlib import Path
from typing import NamedTuple

import numpy as np

from engage_hri.schemas.perception import FACE_POINTS
from engage_hri.services.perception.eyes import head_pose
from engage_hri.services.perception.eyes.head_pose import AverageFace, solved, yaw_pitch
from engage_hri.services.perception.eyes.looking import Floats
from engage_hri.services.perception.eyes.sources.litert import FaceFinder
from tests.perception.eyes.cases import CHUNKS, cases
from tests.perception.eyes.fetched import MODELS
from tests.perception.eyes.people import CAMERA, FITTED, Pose

COUNT = 20
"""Pictures of each person."""
FOLLOWED = 4
"""Pictures for which a face is followed: the square around it has settled then."""
ANGLES = 6
"""Signs that are no points: of them nothing is doubted."""
PARTS = 10
"""Parts of the people: each is tried with what was learned of the others."""
DOUBTED = 0.5
"""Millimetres by which each point may be off by chance, more than in these pictures, without harm (ridge regression).

The less, the better for people who are left out: their pitch scatters by 3.3 degrees with 1, by 3.0 with 0.1. But
points that shake by a millimetre then shake pitch by eight degrees, and now by 1.7.
"""
MOVABLE = 0.055
"""Metres below the eyes from which on a point moves with the mouth."""
FILE = Path(head_pose.__file__).parent / "average_face.npz"


class Sample(NamedTuple):
    """The points of a face whose head is known."""

    person: int
    pose: Pose
    points: Floats


def learned(samples: Sequence[Sample]) -> AverageFace:
    """Learn a face, without what mends it and its errors: the place of each point that all pictures agree on best."""
    rows = [_equations(each) for each in samples]
    left = sum(sides.transpose(0, 2, 1) @ sides for sides, _ in rows)
    right = sum(np.einsum("nij,ni->nj", sides, values) for sides, values in rows)
    points = np.linalg.solve(left, right[..., None])[..., 0]
    missed = np.array([np.einsum("nij,nj->ni", sides, points) - values for sides, values in rows])
    wrong = np.sqrt((missed**2).mean((0, 2)))
    weights = np.where(points[:, 1] > MOVABLE, 0.0, np.median(wrong) / wrong)
    weights[1::2] = 0.0  # half of the points are as good as all, and faster
    return AverageFace(points, np.clip(weights, 0, 2.5), np.zeros((2, 0)), np.zeros((2, 0)))


def _equations(sample: Sample) -> tuple[Floats, Floats]:
    """What a picture says of where each point is: two equations, in metres beside the line of sight."""
    rotation, place = sample.pose.rotation, np.array(sample.pose.at)
    rays = (sample.points[:, :2] - CAMERA.middle) / CAMERA.focal
    across = np.zeros((FACE_POINTS, 2, 3))
    across[:, 0, 0] = across[:, 1, 1] = 1.0
    across[:, :, 2] = -rays
    return across @ rotation, -across @ place


class Row(NamedTuple):
    """What was measured of a sample by a face that knows nothing of the person. angles, truth: yaw and pitch."""

    person: int
    angles: Floats
    truth: Floats
    signs: Floats
    features: Floats


def rows(face: AverageFace, samples: Sequence[Sample]) -> list[Row]:
    """Measure samples as `head` does, without what mends it."""
    found = []
    for each in samples:
        raw = solved(each.points, CAMERA.width, CAMERA.height, CAMERA.focal, face)
        if raw is not None:
            truth = np.array(yaw_pitch(each.pose.ahead))
            found.append(Row(each.person, raw.angles, truth, raw.signs, raw.features))
    return found


def mended(known: Sequence[Row]) -> Floats:
    """Coefficients of what is to be added to yaw and pitch."""
    signs, wrong = np.array([each.signs for each in known]), np.array([each.truth - each.angles for each in known])
    doubt = np.full(signs.shape[1], len(known) * DOUBTED**2)
    doubt[:ANGLES] = 0.0
    return np.linalg.solve(signs.T @ signs + np.diag(doubt), signs.T @ wrong).T


def whole(samples: Sequence[Sample]) -> AverageFace:
    """Learn a face, what mends it, and its errors: those of each part of the people by the others."""
    known, face = list[Row](), learned(samples)
    for part in range(PARTS):
        others = learned([each for each in samples if each.person % PARTS != part])._replace(weights=face.weights)
        known += rows(others, [each for each in samples if each.person % PARTS == part])
    left = np.zeros((len(known), 2))
    for part in range(PARTS):
        mends = mended([each for each in known if each.person % PARTS != part])
        for number, each in enumerate(known):
            if each.person % PARTS == part:
                left[number] = each.angles + mends @ each.signs - each.truth
    # The mean size of an error is 0.8 of its deviation, if it is normal.
    what, sizes = np.array([each.features for each in known]), np.abs(left) / np.sqrt(2 / np.pi)
    errors = np.linalg.lstsq(what, sizes, rcond=None)[0].T
    print("left over, degrees, yaw and pitch:", np.degrees(left.mean(0)).round(2), np.degrees(left.std(0)).round(2))
    return face._replace(mends=mended(known), errors=errors)


def measured(folder: Path, person: int) -> list[Sample]:
    """Points of one person, of a face that has been followed; drawn, if they are not kept in the folder."""
    file = folder / f"{person}.npz"
    if not file.exists():
        points, poses = list[Floats](), list[list[float]]()
        for case in (
            case for part in range(CHUNKS) for case in cases(FITTED[person], person, part, COUNT // CHUNKS, 1)
        ):
            finder = FaceFinder(MODELS, 1)
            found = [finder.find(case.picture) for _ in range(FOLLOWED)]
            if all(found):
                points.append(found[-1][0][0])
                poses.append([*case.pose.at, case.pose.yaw, case.pose.pitch, case.pose.roll])
        np.savez(file, points=np.array(points, np.float32), poses=poses)
    with np.load(file) as kept:
        pairs = zip(kept["poses"].tolist(), kept["points"].astype(float), strict=True)
        return [Sample(person, Pose((x, y, z), *angles), points) for (x, y, z, *angles), points in pairs]


def save(face: AverageFace, path: Path) -> None:
    """Write a face: points in hundredths of a millimetre, weights in hundredths."""
    np.savez_compressed(
        path,
        points=np.rint(face.points * 1e5).astype(np.int16),
        weights=np.rint(face.weights * 100).astype(np.uint8),
        mends=face.mends.astype(np.float32),
        errors=face.errors.astype(np.float32),
    )


def main() -> None:
    """Learn, write, and tell what is left over."""
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    with Pool(1) as pool:
        people = pool.map(partial(measured, folder), range(len(FITTED)), 1)
    samples = [each for found in people for each in found]
    face = whole(samples)
    save(face, FILE)
    print(f"{len(samples)} of {len(FITTED) * COUNT} faces; errors {np.round(face.errors, 3).tolist()}")


if __name__ == "__main__":
    main()
