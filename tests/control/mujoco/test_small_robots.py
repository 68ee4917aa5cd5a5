"""Robots with few parts, by descriptions: they take part with what they have."""

import math
from pathlib import Path

import pytest

pytest.importorskip("mujoco", reason="needs the extra `mujoco`")

from engage_hri.schemas.faults import InputRefused
from engage_hri.services.control.contract.body import Body
from engage_hri.services.control.mujoco.described import DescribedBody
from engage_hri.services.control.testing import BodyContract
from tests.random_cases import trials

PAN_TILT = """
<mujoco>
  <worldbody>
    <body name="base" pos="0 0 1">
      <joint name="pan" axis="0 0 1" range="-90 90"/>
      <geom type="cylinder" size="0.05 0.02" mass="0.3"/>
      <body name="camera" pos="0 0 0.05">
        <joint name="tilt" axis="0 -1 0" range="-70 40"/>
        <geom type="box" size="0.04 0.06 0.04" mass="0.4" rgba="0.2 0.2 0.3 1"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
DESCRIPTION = """
name = "pan-tilt"
model = "pan-tilt.xml"

[head]
joints = ["pan", "tilt"]
eyes = { body = "camera", at = [0.04, 0.0, 0.0] }
"""
BY_THE_DOOR = """
name = "post"
model = "pan-tilt.xml"
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "pan-tilt.xml").write_text(PAN_TILT, encoding="utf-8")
    (tmp_path / "robot.toml").write_text(DESCRIPTION, encoding="utf-8")
    return tmp_path


class TestPanTiltInPhysics(BodyContract):
    """A head without arms, trunk or face."""

    tolerance = 0.1
    seeds = trials()

    @pytest.fixture(autouse=True)
    def _here(self, folder: Path) -> None:
        self.folder = folder

    def make(self) -> Body:
        return DescribedBody(self.folder / "robot.toml")


async def test_what_it_lacks_it_does_not_offer(folder: Path):
    body = DescribedBody(folder / "robot.toml")

    assert body.capabilities.types == ("gaze", "gazeShift", "headDirectionShift", "head", "wait")
    assert body.capabilities.parts == ("head",)
    assert (body.state().left_arm, body.state().right_arm) == (None, None)


async def test_a_robot_without_head_or_arms_is_there_all_the_same(folder: Path):
    (folder / "post.toml").write_text(BY_THE_DOOR, encoding="utf-8")
    body = DescribedBody(folder / "post.toml")

    assert body.capabilities.types == ("wait",)
    assert body.state().gaze is None
    await body.home()


async def test_what_a_model_does_not_have_is_said_with_what_it_has(folder: Path):
    (folder / "wrong.toml").write_text(DESCRIPTION.replace('"tilt"', '"tlit"'), encoding="utf-8")

    with pytest.raises(InputRefused, match="no joint 'tlit'") as refused:
        DescribedBody(folder / "wrong.toml")
    assert "pan, tilt" in refused.value.fault.advice
    assert str(refused.value).startswith(f"{folder}/wrong.toml: head.joints: ")
    (folder / "wrong.toml").write_text(DESCRIPTION.replace('"camera"', '"camra"'), encoding="utf-8")
    with pytest.raises(InputRefused, match=r"wrong\.toml: head\.eyes: the model has no body 'camra'"):
        DescribedBody(folder / "wrong.toml")


@pytest.mark.parametrize(
    ("home", "range", "said"),
    [
        ("tilt = 800", "-70 40", r"home\.tilt is 800 degrees: expected -70\.0\.\.40\.0"),
        ("", "13 107", r"home\.tilt is not given, and so 0 degrees: expected 13\.0\.\.107\.0"),
        ("tilt = 13", "13 107", ""),
    ],
)
async def test_a_safe_pose_is_one_that_the_joints_can_have(folder: Path, home: str, range: str, said: str):
    (folder / "pan-tilt.xml").write_text(PAN_TILT.replace("-70 40", range), encoding="utf-8")
    (folder / "robot.toml").write_text(f"{DESCRIPTION}\n[home]\n{home}\n", encoding="utf-8")

    if not said:
        assert DescribedBody(folder / "robot.toml").state().pose.joints[-1].angle == pytest.approx(math.radians(13))
        return
    with pytest.raises(InputRefused, match=rf"robot\.toml: {said}"):
        DescribedBody(folder / "robot.toml")
