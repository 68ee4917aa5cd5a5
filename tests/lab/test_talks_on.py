"""A link that is gone for a moment, or for seconds, ends nothing of what robot and people do."""

import asyncio
import json
from pathlib import Path

import pytest

from tests.lab.lab import laboratory, missing
from tests.lab.test_reach import LONG, SPREAD, engage, until

pytestmark = [pytest.mark.real_time, pytest.mark.skipif(bool(missing()), reason=missing())]
WORDS = " ".join(f"word number {number}" for number in range(9))
FRAGMENT = f"""<ebml:ebml xmlns="org.mindmakers.bml" xmlns:ebml="edu.wpi.ebml" id="ask" turnStatus="full"
  addressee="human"><speech id="s"><text>{WORDS}</text></speech></ebml:ebml>"""
PATIENCE = 2.0
SETTINGS = (
    "--set",
    f"recognition.turn_patience={PATIENCE}",
    "--set",
    "simulation.human=attentive",
    "--set",
    "simulation.entrance=0",
)


@pytest.mark.parametrize("fault", ["router", "cut"])
async def test_it(tmp_path: Path, fault: str) -> None:
    fragment = tmp_path / "ask.xml"
    fragment.write_text(FRAGMENT)
    async with laboratory(tmp_path, seed=1) as lab:
        address = f"tcp/{lab.machines[1].ip}:7447"
        router = await engage(lab.machines[1], "router", "--listen", address)
        await until(router, "router is ready")
        for number, names in SPREAD.items():
            for name in names:
                more = SETTINGS if name in ("simulation", "recognition") else ()
                await until(
                    await engage(lab.machines[number], "run", name, "--connect", address, *more), f"{name} is ready"
                )
        events = tmp_path / "events.jsonl"
        await asyncio.sleep(1.0)
        options = ("--events", str(events), "--connect", address)
        play = await engage(lab.machines[1], "play", str(fragment), *options)
        await until(play, "adjacency pair, robot → human (turn): waiting")
        await asyncio.sleep(1.0)
        if fault == "router":
            await lab.machines[1].kill(router)
            await asyncio.sleep(0.05)
            router = await engage(lab.machines[1], "router", "--listen", address)
        else:
            await lab.cut_for(3.0, 1, 2)
        told, _ = await asyncio.wait_for(play.communicate(), LONG)
        lives = [json.loads(line) for line in events.read_text().splitlines()]
        decided = next(each for each in lives if each["kind"] == "adjacency_pair" and each["state"] != "started")
        assert decided["state"] == "succeeded", told.decode()
        assert 0 <= decided["delay"] < 1.5
