"""Learns the average face from rendered people, and how wrong it is of people of whom it knows nothing.

    python -m tests.perception.eyes.learning

writes services/perception/eyes/average_face.npz. Each point of the face is where it lies in the heads of ten people
on average, found from fifty pictures of each with a known head (`people.FITTED`); it weighs as much as it is the same
in all of them. The errors are those of each person by a face that was learned from the other nine.
"""

from collections.abc import Sequence
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

COUNT = 50
"""Pictures of each person."""
MOVABLE = 0.055
"""Metres below the eyes from which on a point moves with the mouth."""
FILE = Path(head_pose.__file__).parent / "average_face.npz"


class Sample(NamedTuple):
    """The points of a face whose head is known."""

    person: int
    pose: Pose
    points: Floats


def learned(samples: Sequence[Sample]) -> AverageFace:
    """Learn a face, without its errors: the place of each point that all pictures agree on best."""
    rows = [_equations(each) for each in samples]
    left = sum(sides.transpose(0, 2, 1) @ sides for sides, _ in rows)
    right = sum(np.einsum("nij,ni->nj", sides, values) for sides, values in rows)
    points = np.linalg.solve(left, right[..., None])[..., 0]
    missed = np.array([np.einsum("nij,nj->ni", sides, points) - values for sides, values in rows])
    wrong = np.sqrt((missed**2).mean((0, 2)))
    weights = np.where(points[:, 1] > MOVABLE, 0.0, np.median(wrong) / wrong)
    weights[1::2] = 0.0  # half of the points are as good as all, and faster
    return AverageFace(points, np.clip(weights, 0, 2.5), np.zeros((2, 12)), np.zeros((2, 2)))


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
    ways: Floats
    features: Floats


def rows(face: AverageFace, samples: Sequence[Sample]) -> list[Row]:
    """Measure samples as `head` does, without what mends it."""
    found = []
    for each in samples:
        raw = solved(each.points, CAMERA.width, CAMERA.height, CAMERA.focal, face)
        if raw is not None:
            truth = np.array(yaw_pitch(each.pose.ahead))
            found.append(Row(each.person, raw.angles, truth, raw.ways, raw.features))
    return found


def mended(known: Sequence[Row]) -> Floats:
    """Coefficients of what is to be added to yaw and pitch."""
    wrong = np.array([each.truth - each.angles for each in known])
    return np.linalg.lstsq(np.array([each.ways for each in known]), wrong, rcond=None)[0].T


def whole(samples: Sequence[Sample]) -> AverageFace:
    """Learn a face, what mends it, and its errors: those of each person by the others."""
    people = sorted({each.person for each in samples})
    known = []
    for person in people:
        others = learned([each for each in samples if each.person != person])
        known += rows(others, [each for each in samples if each.person == person])
    left = np.zeros((len(known), 2))
    for person in people:
        mends = mended([each for each in known if each.person != person])
        for number, each in enumerate(known):
            if each.person == person:
                left[number] = each.angles + mends @ each.ways - each.truth
    # The mean size of an error is 0.8 of its deviation, if it is normal.
    what, sizes = np.array([each.features for each in known]), np.abs(left) / np.sqrt(2 / np.pi)
    errors = np.linalg.lstsq(what, sizes, rcond=None)[0].T
    print("left over, degrees, yaw and pitch:", np.degrees(left.mean(0)).round(2), np.degrees(left.std(0)).round(2))
    return learned(samples)._replace(mends=mended(known), errors=errors)


def measured(chunk: tuple[int, int]) -> list[Sample]:
    """Draw a chunk of the cases of one person, and find the points."""
    person, number = chunk
    found = []
    for case in cases(FITTED[person], person, number, COUNT // CHUNKS):
        finder = FaceFinder(MODELS, 1)
        if finder.find(case.picture) and (seen := finder.find(case.picture)):
            found.append(Sample(person, case.pose, seen[0][0]))
    return found


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
    with Pool() as pool:
        chunks = [(person, chunk) for person in range(len(FITTED)) for chunk in range(CHUNKS)]
        samples = [each for found in pool.map(measured, chunks, 1) for each in found]
    face = whole(samples)
    save(face, FILE)
    print(f"{len(samples)} of {len(FITTED) * COUNT} faces; errors {np.round(face.errors, 3).tolist()}")


if __name__ == "__main__":
    main()
