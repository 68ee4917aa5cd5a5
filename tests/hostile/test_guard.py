"""The hostile peer runs in memory and in virtual time, and nowhere else."""

import pytest

from engage_hri.schemas.faults import InputRefused
from tests.rigs.hostile.attacks import whole_robot
from tests.rigs.hostile.trial import Attack, trial


@pytest.mark.real_time
async def test_it_refuses_real_time() -> None:
    with pytest.raises(InputRefused, match="virtual time only"):
        await trial(Attack(), whole_robot())
