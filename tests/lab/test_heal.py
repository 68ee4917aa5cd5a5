"""Paths between machines that are cut, and what comes of it. Real namespaces, processes and sockets."""

import asyncio
from pathlib import Path

import pytest

from tests.lab.lab import laboratory, missing
from tests.lab.test_reach import BML, LONG, engage, start, until

pytestmark = [pytest.mark.real_time, pytest.mark.skipif(bool(missing()), reason=missing())]
BACK = 3.0
"""Seconds after healing in which all must be back."""


@pytest.mark.parametrize("cut", ["2-3", "2", "router"])
async def test_after_a_cut_everything_is_back_unaided(tmp_path: Path, cut: str) -> None:
    block = tmp_path / "block.xml"
    block.write_text(BML)
    async with laboratory(tmp_path, seed=1) as lab:
        address = f"tcp/{lab.machines[1].ip}:7447"
        router = await engage(lab.machines[1], "router", "--listen", address)
        await until(router, "router is ready")
        await start(lab, "--connect", address)
        if cut == "2-3":
            await lab.cut(2, 3)
            await asyncio.sleep(6.0)
            await lab.heal(2, 3)
        elif cut == "2":
            await lab.isolate(2)
            await asyncio.sleep(6.0)
            await lab.isolate(2, is_cut=False)
        else:
            router.kill()
            await asyncio.sleep(3.0)
            await engage(lab.machines[1], "router", "--listen", address)
        await asyncio.sleep(BACK)
        play = await engage(lab.machines[3], "play", str(block), "--connect", address)
        told, _ = await asyncio.wait_for(play.communicate(), LONG)
        print(told.decode())
        assert play.returncode == 0, told.decode()
