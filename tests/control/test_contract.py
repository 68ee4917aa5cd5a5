"""Every body we ship, held to the contract."""

from engage_hri.services.control.body import Body
from engage_hri.services.control.torso.body import SimulatedBody
from tests.control.contract import BodyContract


class TestSimulatedBody(BodyContract):
    def make(self) -> Body:
        return SimulatedBody()
