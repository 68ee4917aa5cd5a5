"""The contract suite, for the tests of a driver: `BodyContract`. Needs the extra `check`, and the plugin.

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
    from engage_hri.services.control.testing.contract import BodyContract as BodyContract

# Before any of them is imported, so that a plain `assert` in them tells what it has compared.
pytest.register_assert_rewrite(*(f"{__name__}.{module.name}" for module in iter_modules(__path__)))

__all__ = ["BodyContract"]


def __getattr__(name: str) -> Any:
    if name != "BodyContract":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return import_module(f"{__name__}.contract").BodyContract
