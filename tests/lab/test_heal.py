"""Paths between machines that are cut, and what comes of it. Real namespaces, processes and sockets."""

import asyncio
from pathlib import Path

import pytest

from tests.lab.lab import laboratory, missing
from tests.lab.test_reach import BML, LONG, engage, start, until

pytestmark = [pytest.mark.real_time, pytest.mark.skipif(bool(missing()), reason=missing())]


@pytest.mark.parametrize("cut", ["a path", "a machine", "the router"])
async def test_after_a_cut_everything_is_back_unaided(tmp_path: Path, cut: str) -> None:
    block = tmp_path / "block.xml"
    block.write_text(BML)
    async with laboratory(tmp_path, seed=1) as lab:
        address = f"tcp/{lab.machines[1].ip}:7447"
        router = await engage(lab.machines[1], "router", "--listen", address)
        await until(router, "router is ready")
        await start(lab, "--connect", address)
        match cut:
            case "a path":
                await lab.cut_for(6.0, 2, 3)
            case "a machine":
                await lab.cut_for(6.0, 2)
            case _:
                await lab.machines[1].kill(router)
                await until(await engage(lab.machines[1], "router", "--listen", address), "realizer is here")
        play = await engage(lab.machines[3], "play", str(block), "--connect", address)
        told, _ = await asyncio.wait_for(play.communicate(), LONG)
        assert play.returncode == 0, told.decode()
