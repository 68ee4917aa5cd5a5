"""Take the pictures of docs/console.md: `python -m tests.console.pictures`, on a machine with Chromium. A minute."""

import asyncio
import tempfile
from pathlib import Path

from tests.bus.places import free_endpoint
from tests.console import browser
from tests.console.browser import waited
from tests.console.windows import URL, engage

FOLDER = Path(__file__).parents[2] / "docs" / "console"
PLACE = 27.5
"""Place in the recording, in seconds: the robot points."""
STAGES = (
    ("phone", (390, 844), False, 1.0), ("tablet", (820, 1180), False, 0.5), ("laptop", (1366, 768), False, 1.0),
    ("wall", (1920, 1080), False, 0.5), ("dark", (390, 844), True, 1.0),
)  # fmt: skip
"""Name, size, whether it is dark, and how large the picture is of what is seen."""
SIZES = ((1920, 1200), (1280, 1000), (400, 1400))


async def take_recording(url: str, port: int) -> None:
    """Go to a place in a recording, and take a picture there."""
    async with browser.at_port(port) as running, running.page() as page:
        await page.look(1280, 800, calm=True)
        await page.go(url)
        await page.until("window.engage?.state.place?.at > 0.5", 60)
        await page.value(f"window.engage.send({{ do: 'play', on: false, at: {PLACE} }})")
        await page.until(f"window.engage.state.place.at === {PLACE}")
        await page.value("new Promise((done) => setTimeout(done, 1500))")
        (FOLDER / "recording.png").write_bytes(await page.picture(whole=False))


async def take(url: str, port: int) -> None:
    """Watch the tangram until the robot has asked for two pieces, then write a picture for each size and colour."""
    async with browser.at_port(port) as running, running.page() as page:
        await page.look(1920, 1200, calm=True)
        await page.go(url)
        await page.until("window.engage?.state.references?.length > 3", 120)
        await page.until("document.querySelector('#above .pointed')", 60)
        for width, height in SIZES:
            for dark in (False, True):
                await page.look(width, height, dark=dark, calm=True)
                await page.until(f"document.documentElement.clientWidth === {width}")
                await page.until("document.querySelector('#above .looked')", 60)
                await page.value("new Promise((done) => setTimeout(done, 1000))")
                name = f"{width}-{'dark' if dark else 'light'}.png"
                (FOLDER / name).write_bytes(await page.picture(whole=False))
        await page.look(1280, 800, calm=True)
        await page.value("document.querySelector('#net').scrollIntoView()")
        await page.until("document.querySelectorAll('.net svg:not(.over) .fired').length > 4", 60)
        (FOLDER / "net.png").write_bytes(await page.picture(whole=False))


async def take_stage(url: str, port: int) -> None:
    """Sit down at the stage, and take pictures while the robot speaks: a phone, a laptop, and a phone in the dark."""
    async with browser.at_port(port) as running, running.page() as page:
        await page.look(390, 844, calm=True)
        await page.go(url)
        await page.until("window.stage?.state.scene?.body && window.stage.shown.isStill", 60)
        (FOLDER / "stage-welcome.png").write_bytes(await page.picture(whole=False))
        await page.value("document.querySelector('.sit').click()")
        for name, (width, height), dark, scale in STAGES:
            await page.look(width, height, dark=dark, calm=True)
            await page.until("document.querySelectorAll('.bubble.robot.on span').length > 4", 60)
            await page.value("new Promise((done) => setTimeout(done, 1500))")
            (FOLDER / f"stage-{name}.png").write_bytes(await page.picture(whole=False, scale=scale))


def main() -> None:
    """Run a robot, its window and a browser, and take the pictures."""
    FOLDER.mkdir(exist_ok=True)
    endpoint = free_endpoint()
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name:  # a browser that ends still writes
        folder = Path(name)
        up = ("up", "--task", "--in-one", "--listen", endpoint)
        console = ("console", "--connect", endpoint, "--port", "0", "--role", "wizard")
        file = folder / "session.mcap"
        with browser.running(folder) as port:
            with engage(folder / "console", *console) as window, engage(folder / "up", *up):
                url = waited(window, folder / "console", URL)
                with engage(folder / "record", "record", str(file), "--connect", endpoint):
                    asyncio.run(take(url, port))
            with engage(folder / "demo", "demo", "--you", BROWSER="true %s") as demo:
                asyncio.run(take_stage(waited(demo, folder / "demo", rb"the stage: (http://[^\s]+)"), port))
            with engage(folder / "recorded", "console", "--recording", str(file), "--port", "0") as window:
                asyncio.run(take_recording(waited(window, folder / "recorded", URL), port))


if __name__ == "__main__":
    main()
