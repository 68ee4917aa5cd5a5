"""The contract suite, for the tests of a driver, and what it is made of. Needs the extra `check`, and the plugin.

pytest_plugins = ["engage_hri.services.control.testing.plugin"]      # in conftest.py

class TestMyRobot(BodyContract):                                     # in any test file
    def make(self):
        return MyRobot(simulated=True)
"""

from importlib import import_module
from pkgutil import iter_modules
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from engage_hri.services.control.testing.asked import BEHAVIORS as BEHAVIORS
    from engage_hri.services.control.testing.asked import WORLD as WORLD
    from engage_hri.services.control.testing.contract import BodyContract as BodyContract
    from engage_hri.services.control.testing.laws import LawBroken as LawBroken
    from engage_hri.services.control.testing.laws import broken as broken
    from engage_hri.services.control.testing.laws import poses_agree as poses_agree
    from engage_hri.services.control.testing.motions import STEP as STEP
    from engage_hri.services.control.testing.motions import Recording as Recording
    from engage_hri.services.control.testing.motions import recorded as recorded
    from engage_hri.services.control.testing.motions import stops as stops
    from engage_hri.services.control.testing.motions import violations as violations
    from engage_hri.services.control.testing.playing import played as played
    from engage_hri.services.control.testing.rays import aside as aside
    from engage_hri.services.control.testing.rays import beside as beside
    from engage_hri.services.control.testing.stage import Stage as Stage
    from engage_hri.services.control.testing.stage import default as default
    from engage_hri.services.control.testing.stage import performed as performed
    from engage_hri.services.control.testing.stage import times as times
    from engage_hri.services.control.testing.suite import ON_AXIS as ON_AXIS
    from engage_hri.services.control.testing.witness import CROWDS as CROWDS
    from engage_hri.services.control.testing.witness import WatchedStage as WatchedStage
    from engage_hri.services.control.testing.witness import arms as arms
    from engage_hri.services.control.testing.witness import witnessed as witnessed

# Before any of them is imported, so that a plain `assert` in them tells what it has compared.
pytest.register_assert_rewrite(*(f"{__name__}.{module.name}" for module in iter_modules(__path__)))

_PLACES = {
    "asked": ("BEHAVIORS", "WORLD"),
    "contract": ("BodyContract",),
    "laws": ("LawBroken", "broken", "poses_agree"),
    "motions": ("STEP", "Recording", "recorded", "stops", "violations"),
    "playing": ("played",),
    "rays": ("aside", "beside"),
    "stage": ("Stage", "default", "performed", "times"),
    "suite": ("ON_AXIS",),
    "witness": ("CROWDS", "WatchedStage", "arms", "witnessed"),
}
_MODULES = {name: module for module, names in _PLACES.items() for name in names}


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = globals()[name] = getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
    return value
