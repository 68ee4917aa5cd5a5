"""The table in the way of a path: many poses at once against each by itself, as the forearms are."""

import random

import pytest

from engage_hri.services.control.figure import kinematics
from engage_hri.services.control.figure.tracks import ALONG, FINELY, limits_of, meets_table
from engage_hri.services.control.motion.path import Leg, Path, resting

PARTS = [
    ("left_arm",), ("right_arm",), ("left_arm", "right_arm"), ("torso", "right_arm"),
    ("torso", "left_arm", "right_arm"),
]  # fmt: skip


def path(chance: random.Random, parts: tuple[str, ...]) -> Path:
    """From near home to near home, often: there the table is."""
    limits = limits_of(parts)

    def angles() -> tuple[float, ...]:
        return tuple(
            home + chance.uniform(0.0, 0.6) * (chance.uniform(limit.low, limit.high) - home)
            for limit, home in ((limit, kinematics.HOME[limit.joint]) for limit in limits)
        )

    legs = [Leg(goal=angles(), seconds=chance.choice((0.0, 0.3, 1.0))) for _ in range(chance.randint(0, 4))]
    return Path(resting(angles()), legs, limits)


@pytest.mark.parametrize("parts", PARTS, ids="+".join)
def test_many_poses_at_once_meet_the_table_where_one_of_them_does(parts: tuple[str, ...]) -> None:
    chance, hits = random.Random("+".join(parts)), 0
    joints = tuple(joint for part in parts for joint in kinematics.joints_of(part))
    shares = FINELY if "torso" in parts else ALONG
    sides = [side for side in kinematics.SHOULDER if f"{side}_arm" in parts]
    for _ in range(150):
        made = path(chance, parts)
        poses = [dict(zip(joints, made.at(made.length * share).q.tolist(), strict=True)) for share in shares]
        meets = any(kinematics.touches_table({**kinematics.HOME, **pose}, sides) for pose in poses)
        assert meets_table(made, joints) == (meets and made.length > 0.0)
        hits += meets
    assert 10 < hits < 140


def test_positions_along_a_path_are_those_of_each_instant() -> None:
    chance = random.Random(2)
    for _ in range(50):
        made = path(chance, ("left_arm",))
        at_once = made.positions(ALONG)
        for share, position in zip(ALONG.tolist(), at_once.tolist(), strict=True):
            assert position == pytest.approx(made.at(share * made.length).q.tolist(), abs=1e-12)
