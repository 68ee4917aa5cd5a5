"""The driver of Reachy Mini, held to the contract of bodies on a daemon that lags as the real one does."""

import asyncio
import math
from collections.abc import Callable, Mapping

from engage_hri.services.control.contract.body import Body
from engage_hri.services.control.reachy_mini.body import ReachyMini
from engage_hri.services.control.testing import BodyContract
from tests.control.reachy_mini.fake import FakeDaemon
from tests.random_cases import share_of


class TestReachyMini(BodyContract):
    tolerance = 0.06
    seeds = share_of(6, 6)

    def make(self) -> Body:
        return ReachyMini(connect=FakeDaemon())

    def faults(self) -> Mapping[str, Callable[[], Body]]:
        return {
            "a stuck motor": lambda: faulty(lambda daemon: daemon.stuck.add("pitch")),
            "a head that sags": lambda: faulty(lambda daemon: setattr(daemon, "sag", math.radians(2.0))),
            "slow motors": lambda: faulty(lambda daemon: setattr(daemon, "slow", math.radians(30.0))),
            "motors off": lambda: faulty(lambda daemon: setattr(daemon, "mode", "disabled")),
            "a frozen daemon": lambda: faulty(FakeDaemon.freeze),
            "a killed daemon": lambda: faulty(FakeDaemon.kill),
        }


class TestLivingReachyMini(TestReachyMini):
    """It breathes and sways all the while."""

    seeds = share_of(3)

    def make(self) -> Body:
        return ReachyMini(connect=FakeDaemon(), alive=True)


class TestNoisyReachyMini(BodyContract):
    tolerance = 0.06
    noise = math.radians(0.3)
    seeds = share_of(3)

    def make(self) -> Body:
        daemon = FakeDaemon()
        daemon.noise = self.noise
        return ReachyMini(connect=daemon)


def faulty(suffer: Callable[[FakeDaemon], None]) -> Body:
    """A body whose daemon suffers something once it is at home, and just as something is under way."""
    daemon = FakeDaemon()
    asyncio.get_running_loop().call_later(3.2, suffer, daemon)
    return ReachyMini(connect=daemon)
