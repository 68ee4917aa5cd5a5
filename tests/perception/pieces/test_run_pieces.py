"""`engage run pieces --from film:FOLDER`: a process that sees a drawn table, tells it on Zenoh, and ends."""

from pathlib import Path

import cv2
import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.world import World
from engage_hri.services.bus.zenoh.hub import open_hub
from engage_hri.services.runtime.service import running
from tests.bus.places import free_endpoint
from tests.cli.command import engage, start
from tests.perception.pieces.tables import GOALS, drawn
from tests.perception.pieces.test_pieces import colors
from tests.perception.test_hearing import idle

pytestmark = pytest.mark.real_time


async def test_a_film_is_seen_by_a_process_that_ends_with_it(tmp_path: Path):
    film, endpoint = tmp_path / "film", free_endpoint()
    film.mkdir()
    for number in range(5):
        cv2.imwrite(str(film / f"{number}.png"), drawn(GOALS, seed=1, take=number)[:, :, ::-1])
    hub = await open_hub("seen", listen=(endpoint,))
    async with hub, running(hub, {"recognition": idle}):
        with hub.join("watcher", role="observer").subscribe(keys.WORLD) as inbox:
            process = await start(
                "run", "pieces", "--from", f"film:{film}", "--task", "tangram", "--robot", "seen",
                "--connect", endpoint, "--set", f"pieces.colors={colors(tmp_path)}",
            )  # fmt: skip
            most = 0
            async for received in inbox:
                if isinstance(received.message, World):
                    most = max(most, len(received.message.objects))
                    if most == len(GOALS):
                        break
            _, errors = await process.communicate()

    assert process.returncode == 0, errors.decode()


def test_a_task_is_for_pieces(capsys: pytest.CaptureFixture[str]):
    told = engage(capsys)("run", "eyes", "--task", "tangram")

    assert (told.code, "--task is for pieces" in told.err) == (2, True)
