"""Every body we ship, held to the contract."""

from engage_hri.services.control.body import Body
from engage_hri.services.control.testing import BodyContract
from engage_hri.services.control.torso.body import SimulatedBody


class TestSimulatedBody(BodyContract):
    def make(self) -> Body:
        return SimulatedBody()
