"""Five browsers at one window while the tangram is played: from a message on the bus to the frame, and the cost.

The browsers are WebSockets that say at once that they have drawn. In the second run one of them takes a second for
each frame. Needs the extra `console`; takes a minute and a half.
"""

import asyncio
import json
import os
import subprocess
import sys
import tempfile
from itertools import count
from pathlib import Path
from time import perf_counter

import aiohttp

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from engage_hri.schemas import keys
from engage_hri.schemas.perception import ActionBegan, ActorFound
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.zenoh.hub import open_hub
from tests.bus.places import free_endpoint
from tests.console.browser import waited
from tests.console.windows import URL, engage

BROWSERS = 5
SECONDS = 30.0
APART = 0.377
"""Seconds between two messages that are timed: no multiple of the time between frames."""


def processor_time(pid: int) -> float:
    """Seconds that a process has worked."""
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


class Watching:
    """The browsers. delays: seconds from each look that was told to its frame, in the quick ones."""

    def __init__(self, slow: int) -> None:
        self.slow = slow
        self.delays: list[float] = []
        self.frames = [0] * BROWSERS
        self.told: dict[str, float] = {}

    async def browse(self, session: aiohttp.ClientSession, url: str, number: int) -> None:
        """Be one browser, until cancelled."""
        seen = set[str]()
        address = url.replace("http", "ws").replace("/?", "/frames?")
        async with session.ws_connect(address, headers={"Origin": url.rpartition("/")[0]}) as socket:
            async for message in socket:
                frame = json.loads(message.data)
                self.frames[number] += 1
                for person in frame.get("sections", {}).get("scene", {}).get("people", []):
                    for target in person["looks"] or ():
                        if number >= self.slow and target in self.told and target not in seen:
                            seen.add(target)
                            self.delays.append(perf_counter() - self.told[target])
                if number < self.slow:
                    await asyncio.sleep(1.0)
                await socket.send_str('{"do": "drawn"}')


async def measure(bus: Bus, url: str, window: "subprocess.Popen[bytes]", slow: int) -> str:
    """One line about a run with so many slow browsers."""
    loop, watching = asyncio.get_running_loop(), Watching(slow)
    async with aiohttp.ClientSession() as session:
        tasks = [asyncio.create_task(watching.browse(session, url, number)) for number in range(BROWSERS)]
        await asyncio.sleep(2.0)
        began, worked, watching.frames = loop.time(), processor_time(window.pid), [0] * BROWSERS
        for number in count():
            if loop.time() > began + SECONDS:
                break
            target = f"spot-{slow}-{number}"
            watching.told[target] = perf_counter()
            look = ActionBegan(actor="probe", action="look", targets=(target,), at=bus.stamp())
            bus.publish(keys.PERCEIVED_ACTION, look)
            await asyncio.sleep(APART)
        lasted = loop.time() - began
        for task in tasks:
            task.cancel()
        await asyncio.wait(tasks)
        for task in tasks:
            if not task.cancelled():
                task.result()
    delays = sorted(watching.delays)
    middle, late = (delays[int(len(delays) * share)] * 1000 for share in (0.5, 0.95))
    rates = " ".join(f"{frames / lasted:.1f}" for frames in watching.frames)
    share = 100 * (processor_time(window.pid) - worked) / lasted
    return (
        f"{slow} slow of {BROWSERS}: to the frame {middle:.0f} ms, 95 % within {late:.0f} ms, of {len(delays)}; "
        f"frames a second {rates}; {share:.1f} % of a core; load {os.getloadavg()[0]:.1f}"
    )


async def run(endpoint: str, url: str, window: "subprocess.Popen[bytes]") -> None:
    async with await open_hub("robot", connect=(endpoint,)) as hub:
        bus = hub.join("probe", "perception")
        bus.declare_alive()
        bus.publish(keys.PERCEIVED_ACTION, ActorFound(actor="probe", at=bus.stamp()))
        for slow in (0, 1):
            print(await measure(bus, url, window, slow), flush=True)


def main() -> None:
    endpoint = free_endpoint()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        shown = ("console", "--connect", endpoint, "--port", "0", "--role", "wizard")
        up = ("up", "--task", "--in-one", "--listen", endpoint)
        with engage(folder / "console", *shown) as window, engage(folder / "up", *up):
            asyncio.run(run(endpoint, waited(window, folder / "console", URL), window))


if __name__ == "__main__":
    main()
