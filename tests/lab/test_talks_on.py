"""A link that is gone for a moment, or for seconds, ends nothing of what the robot and people do."""

import asyncio
import json
from pathlib import Path

import pytest

from tests.lab.lab import laboratory, missing
from tests.lab.test_reach import LONG, engage, until

pytestmark = [pytest.mark.real_time, pytest.mark.skipif(bool(missing()), reason=missing())]
SPREAD = {1: ("control", "realizer", "generation"), 2: ("recognition",), 3: ("simulation",)}
WORDS = " ".join(f"word number {number}" for number in range(16))
"""Fourteen seconds of speech: more than the 12 s after a word for which a turn without an end counts."""
FRAGMENT = f"""<ebml:ebml xmlns="org.mindmakers.bml" xmlns:ebml="edu.wpi.ebml" id="ask" turnStatus="full"
  addressee="human"><speech id="s"><text>{WORDS}</text></speech></ebml:ebml>"""
SETTINGS = {"simulation": ("--set", "simulation.human=attentive", "--set", "simulation.entrance=0")}


@pytest.mark.parametrize("fault", ["router", "cut"])
async def test_a_turn_is_answered_though_a_link_was_gone_in_the_midst_of_it(tmp_path: Path, fault: str) -> None:
    """The router dies and is started again, or recognition is cut off for less than a server waits for requesters."""
    fragment, events = tmp_path / "ask.xml", tmp_path / "events.jsonl"
    fragment.write_text(FRAGMENT)
    async with laboratory(tmp_path, seed=1) as lab:
        address = f"tcp/{lab.machines[1].ip}:7447"
        router = await engage(lab.machines[1], "router", "--listen", address)
        await until(router, "router is ready")
        started = {
            name: await engage(lab.machines[number], "run", name, "--connect", address, *SETTINGS.get(name, ()))
            for number, names in SPREAD.items()
            for name in names
        }
        await asyncio.gather(*(until(process, f"{name} is ready") for name, process in started.items()))
        await until(await engage(lab.machines[3], "watch", "--connect", address), "human looks at")
        options = ("--events", str(events), "--connect", address)
        play = await engage(lab.machines[1], "play", "--verbose", str(fragment), *options)
        await until(play, "ask:s:start")
        if fault == "router":
            await lab.machines[1].kill(router)
            await engage(lab.machines[1], "router", "--listen", address)
        else:
            await lab.cut_for(1.2, 1, 2)  # and up to half a second until it is linked again: a server waits for 2 s
        told, _ = await asyncio.wait_for(play.communicate(), LONG)
    changes = [json.loads(line) for line in events.read_text().splitlines()]
    decided = next(each for each in changes if each["kind"] == "adjacency_pair" and each["state"] != "started")
    assert (decided["state"], decided["response"]) == ("succeeded", "nod"), told.decode()
    assert 0 <= decided["delay"] < 1.5
