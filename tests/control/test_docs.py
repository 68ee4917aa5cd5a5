"""The driver in docs/control.md, as it stands there, held to the contract on a simulated SDK."""

import asyncio
import re
import sys
import types
from functools import cache
from pathlib import Path
from unittest.mock import patch

from engage_hri.schemas.behavior_types import TYPES
from engage_hri.services.control.body import Body
from engage_hri.services.control.config import Stall, Variability
from engage_hri.services.control.testing import BodyContract
from engage_hri.services.control.torso.motion import Motion
from engage_hri.services.control.torso.path import JointMotion, Leg, resting
from engage_hri.services.control.torso.path import Path as Way
from engage_hri.services.runtime.virtual_time import run_virtual
from tests.control.liars_by_deed import Noisy

PAGE = Path(__file__).parents[2] / "docs" / "control.md"
CONTRACT = PAGE.with_name("contract.md")


CODE = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)[0]


class Motors:
    """SDK of two motors that go where they are told in the time they are told, and lag by `LAG`."""

    def __init__(self) -> None:
        self.motions: list[tuple[float, Motion]] = []
        self.is_connected = False

    def connect(self) -> None:
        self.is_connected = True

    def move(self, goal: dict[str, float], seconds: float) -> None:
        assert self.is_connected
        now = asyncio.get_running_loop().time()
        leg = Leg(goal=(goal["pan"], goal["tilt"]), seconds=seconds)
        self.motions.append((now, Motion(Way(self._at(now), [leg], driver().PanTilt.joints), now)))

    def measured(self) -> dict[str, float]:
        assert self.is_connected
        pan, tilt = self._at(asyncio.get_running_loop().time() - LAG).q
        return {"pan": float(pan), "tilt": float(tilt)}

    def _at(self, time: float) -> JointMotion:
        motion = next((motion for start, motion in reversed(self.motions) if start <= time), None)
        return motion.at(time) if motion else resting((0.0, 0.0))


LAG = 0.02


@cache
def driver() -> types.ModuleType:
    """The first Python block of the page, as a module, on a simulated SDK."""
    sdk = types.ModuleType("pan_tilt_sdk")
    sdk.Motors = Motors  # type: ignore[attr-defined]
    module = types.ModuleType("pan_tilt")
    with patch.dict(sys.modules, {"pan_tilt_sdk": sdk}):
        exec(compile(CODE, str(PAGE), "exec"), module.__dict__)
    return module


class TestPanTilt(BodyContract):
    tolerance = 0.15

    def make(self) -> Body:
        body = driver().PanTilt()
        assert isinstance(body, Body)
        return body


class Robot(Noisy):
    """What the page on the contract calls MyRobot."""

    def __init__(self, *, simulated: bool, stalled: str = "") -> None:
        assert simulated
        super().__init__(deviations=Variability(stall=(Stall(part="head", before="stroke"),) if stalled else ()))


def test_the_suite_on_the_page_is_one():
    (code,) = re.findall(r"```python\n(.*?)```", CONTRACT.read_text(encoding="utf-8"), re.DOTALL)
    theirs, module = types.ModuleType("my_robot"), types.ModuleType("test_my_robot")
    theirs.MyRobot = Robot  # type: ignore[attr-defined]
    with patch.dict(sys.modules, {"my_robot": theirs}):
        exec(compile(code, str(CONTRACT), "exec"), module.__dict__)
    suite = module.TestMyRobot()

    async def judge() -> None:
        async with suite.connected(suite.make) as body:
            await suite.test_measures_all_its_joints_within_their_noise(body)
        await suite.test_with_a_fault_it_passes_or_names_the_fault(*suite.faults())

    assert isinstance(suite, BodyContract)
    run_virtual(judge())


def test_a_newcomers_driver_is_short():
    assert len([line for line in CODE.splitlines() if line.strip()]) <= 40


def test_the_table_of_types_is_as_the_rows_have_it() -> None:
    told: dict[str, tuple[str, ...]] = {}
    for line in PAGE.read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if line.startswith("|") and all(name in TYPES for name in cells[0].split(", ")):
            told |= {name: tuple(filter(None, cells[2].split(", "))) for name in cells[0].split(", ")}
    by_bodies = {name: row.holds for name, row in TYPES.items() if row.performer == "body" and row.name != "speech"}

    assert {name: told.get(name) for name in (*by_bodies, "wait")} == {
        name: TYPES[name].holds for name in (*by_bodies, "wait")
    }
