"""The contract suite, for the tests of a driver. Needs the extra `check`, and the plugin.

pytest_plugins = ["engage_hri.services.control.testing.plugin"]      # in conftest.py

class TestMyRobot(BodyContract):                                     # in any test file
    def make(self):
        return MyRobot(simulated=True)
"""

from engage_hri.services.control.testing.contract import BodyContract as BodyContract
from engage_hri.services.control.testing.findings import LawBroken as LawBroken
from engage_hri.services.control.testing.findings import broken as broken
from engage_hri.services.control.testing.stage import Stage as Stage
from engage_hri.services.control.testing.stage import performed as performed
from engage_hri.services.control.testing.stage import times as times
from engage_hri.services.control.testing.suite import BEHAVIORS as BEHAVIORS
from engage_hri.services.control.testing.suite import WORLD as WORLD
from engage_hri.services.control.testing.truth import played as played
