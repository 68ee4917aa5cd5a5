import asyncio

import pytest

from services.virtual_time import Deadlock, run_virtual


async def test_time_is_exact_and_starts_at_zero():
    loop = asyncio.get_running_loop()

    await asyncio.sleep(0.1)
    await asyncio.sleep(0.2)

    assert loop.time() == 0.1 + 0.2


def test_waiting_for_nothing_is_a_named_failure():
    async def main() -> None:
        await asyncio.get_running_loop().create_future()

    with pytest.raises(Deadlock, match="Task-"):
        run_virtual(main())
