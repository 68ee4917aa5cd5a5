"""The hostile peer runs in memory and in virtual time, and nowhere else."""

import pytest

from engage_hri.schemas.faults import InputRefused
from engage_hri.services.bus.interface import Bus, Hub
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.commandline.hostile import whole_robot
from engage_hri.services.hostile.trial import Attack, insist_on_memory, trial


class Wire(Hub):
    robot = "robot"

    def join(self, name: str, role: str = "manager") -> Bus:
        raise NotImplementedError

    async def wait_until_free(self, *names: str) -> None: ...

    async def close(self) -> None: ...


@pytest.mark.real_time
async def test_it_refuses_real_time() -> None:
    with pytest.raises(InputRefused, match="virtual time only"):
        await trial(Attack(), whole_robot())


async def test_it_refuses_a_bus_that_reaches_further_than_this_process(hub: MemoryHub) -> None:
    insist_on_memory(hub)

    with pytest.raises(InputRefused, match="MemoryHub only, not on a Wire"):
        insist_on_memory(Wire())
