"""The contract suite: what every body must do. A driver subclasses `BodyContract` and says how to make its body.

    class TestMyRobot(BodyContract):
        tolerance = 0.15
        def make(self):
            return MyRobot(simulated=True)

Each test is a law. Its docstring says what holds, and, after that, what it usually is if it does not.
"""

from engage_hri.services.control.testing.endings import EndingLaws
from engage_hri.services.control.testing.estimates import ClaimLaws, PredictionLaws
from engage_hri.services.control.testing.freedom import FreedomLaws
from engage_hri.services.control.testing.holding import HoldingLaws
from engage_hri.services.control.testing.looking import LookingLaws, TakeoverLaws
from engage_hri.services.control.testing.points import PointsLaws
from engage_hri.services.control.testing.truth import TruthLaws


class BodyContract(
    PointsLaws, HoldingLaws, EndingLaws, TakeoverLaws, PredictionLaws, ClaimLaws, TruthLaws, LookingLaws, FreedomLaws
):
    """All laws of the contract. Subclass it in a test file; `Suite` has what a subclass may set."""
