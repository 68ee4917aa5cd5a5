"""Every body we ship, held to the contract."""

from services.control.body import Body
from services.control.simulated import SimulatedBody
from tests.control.contract import BodyContract


class TestSimulatedBody(BodyContract):
    def make(self) -> Body:
        return SimulatedBody()
