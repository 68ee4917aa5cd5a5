"""Holding, continuing and stopping through the client."""

import pytest
from msgspec.structs import replace

from engage_hri.schemas.blocks import PerformanceSteered, SteerPerformance, SteerRobot
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.robot import connect
from engage_hri.services.requests.ends import RequestDesk
from engage_hri.services.runtime.service import Ready, running


async def test_what_the_robot_performs_is_held_goes_on_and_is_stopped(hub: MemoryHub) -> None:
    asked = []

    async def realizer(bus: Bus, ready: Ready) -> None:
        desk = RequestDesk(bus, "realizer", lambda cancel: None)
        with bus.subscribe(*RequestDesk.patterns("realizer")) as inbox:
            ready()
            async for received in inbox:
                match desk.take(received):
                    case SteerPerformance(id=id, block="nod"):
                        desk.refuse(id, Fault(reason="it is not being performed", where="nod"))
                    case SteerPerformance(id=id, to="continue", behavior="speech-1"):
                        desk.end(PerformanceSteered(id=id, held_with="block"))
                    case SteerPerformance(id=id, to="continue", block="shake"):
                        desk.end(PerformanceSteered(id=id, held_with="robot"))
                    case SteerRobot(id=id) | SteerPerformance(id=id) as request:
                        asked.append(replace(request, id="", requester="", life="", lease=0.0))
                        desk.end(PerformanceSteered(id=id, blocks=("wave",)))

    async with running(hub, {"realizer": realizer}), connect(hub=hub) as robot:
        blocks = [await robot.hold(), await robot.resume("wave"), await robot.stop("wave", "speech-1")]
        with pytest.raises(InputRefused, match="nod: it is not being performed"):
            await robot.hold("nod")
        with pytest.raises(InputRefused, match="speech-1: a behavior without its block"):
            await robot.hold("", "speech-1")
        with pytest.raises(InputRefused, match=r"wave: speech-1: still held, because all of block wave is .*wave"):
            await robot.resume("wave", "speech-1")
        with pytest.raises(InputRefused, match=r"shake: still held, because the whole robot is"):
            await robot.resume("shake")

    assert blocks == [("wave",)] * 3
    assert asked == [
        SteerRobot(id="", to="hold"),
        SteerPerformance(id="", to="continue", block="wave"),
        SteerPerformance(id="", to="stop", block="wave", behavior="speech-1"),
    ]
