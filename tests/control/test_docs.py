"""The driver in docs/control.md, as it stands there, held to the contract on a simulated SDK."""

import re
import sys
import types
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

from engage_hri.schemas.behavior_types import TYPES
from engage_hri.services.control.config import Stall, Variability
from engage_hri.services.control.testing import BodyContract
from engage_hri.services.runtime.virtual_time import run_virtual
from tests.control.liars_by_deed import Noisy

PAGE = Path(__file__).parents[2] / "docs" / "control.md"
CONTRACT = PAGE.with_name("contract.md")


CODE, SDK, SET_POINTS, TEST, VOICE, *_ = re.findall(
    r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL
)
"""A driver, a simulated SDK for it, part of another driver, a test, and a voice."""


@contextmanager
def importable(name: str, module: Any) -> Iterator[None]:
    """Let a module be imported meanwhile. `patch.dict` would forget all else that is imported meanwhile, too."""
    sys.modules[name] = module
    try:
        yield
    finally:
        del sys.modules[name]


@cache
def driver() -> types.ModuleType:
    """The driver of the page, as a module, on its simulated SDK."""
    sdk, module = types.ModuleType("pan_tilt_sdk"), types.ModuleType("pan_tilt")
    exec(compile(SDK, str(PAGE), "exec"), sdk.__dict__)
    with importable("pan_tilt_sdk", sdk):
        exec(compile(CODE, str(PAGE), "exec"), module.__dict__)
    return module


@cache
def suite() -> type[BodyContract]:
    """The test on the page, as it stands there."""
    module = types.ModuleType("test_pan_tilt")
    with importable("pan_tilt", driver()):
        exec(compile(TEST, str(PAGE), "exec"), module.__dict__)
    found = module.TestPanTilt
    assert isinstance(found, type)
    assert issubclass(found, BodyContract)
    return found


TestPanTilt = suite()


class Robot(Noisy):
    """What the page on the contract calls MyRobot."""

    def __init__(self, *, simulated: bool, stalled: str = "") -> None:
        assert simulated
        super().__init__(deviations=Variability(stall=(Stall(part="head", before="stroke"),) if stalled else ()))


def test_the_suite_on_the_page_is_one():
    (code,) = re.findall(r"```python\n(.*?)```", CONTRACT.read_text(encoding="utf-8"), re.DOTALL)
    theirs, module = types.ModuleType("my_robot"), types.ModuleType("test_my_robot")
    theirs.MyRobot = Robot  # type: ignore[attr-defined]
    with importable("my_robot", theirs):
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
