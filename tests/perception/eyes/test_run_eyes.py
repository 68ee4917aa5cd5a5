"""`engage run eyes --from film:FOLDER`: a process that sees rendered people, tells them on Zenoh, and ends."""

from pathlib import Path

import numpy as np
import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.perception import ActorLost, FaceLandmarks, HeadPose
from engage_hri.services.bus.zenoh.hub import open_hub
from engage_hri.services.runtime.service import running
from tests.bus.places import free_endpoint
from tests.cli.command import engage, start
from tests.perception.eyes.fetched import MODELS, needs_eyes

needs_eyes()

import cv2  # noqa: E402

from tests.perception.eyes.people import JUDGED, Person, Pose, drawn  # noqa: E402
from tests.perception.test_hearing import idle  # noqa: E402

pytestmark = pytest.mark.real_time


async def test_a_film_is_seen_by_a_process_that_ends_with_it(tmp_path: Path):
    (tmp_path / "eyes").symlink_to(MODELS)
    film, endpoint = tmp_path / "film", free_endpoint()
    film.mkdir()
    image = drawn([(Person(JUDGED[3]), Pose((0.0, 0.0, 0.8), 15, -10))])
    for number in range(12):
        cv2.imwrite(str(film / f"{number:02}.png"), image[:, :, ::-1])
    hub = await open_hub("seen", listen=(endpoint,))
    async with hub, running(hub, {"recognition": idle}):
        patterns = (keys.PERCEIVED_ACTION, keys.ANY_HEAD_POSE, keys.ANY_LANDMARKS)
        with hub.join("watcher", role="observer").subscribe(*patterns) as inbox:
            process = await start(
                "run", "eyes", "--from", f"film:{film}", "--robot", "seen", "--connect", endpoint,
                "--set", "eyes.field_of_view=53.13", ENGAGE_DATA=str(tmp_path),
            )  # fmt: skip
            told = []
            async for received in inbox:
                told.append(received.message)
                if isinstance(received.message, ActorLost):
                    break
            _, errors = await process.communicate()

    assert process.returncode == 0, errors.decode()
    poses = [each for each in told if isinstance(each, HeadPose)]
    seen = [len(each.faces) for each in told if isinstance(each, FaceLandmarks)]
    assert set(seen) == {1}
    assert 6 < len(seen) <= 12  # of a stream a busy bus drops some
    assert poses[-1].position == pytest.approx((0.85, 0.0, 1.17), abs=0.12)
    x, y, _ = poses[-1].direction
    assert np.degrees(np.arctan2(y, -x)) == pytest.approx(-15, abs=8)


async def test_without_models_the_command_says_how_to_have_them(tmp_path: Path):
    (tmp_path / "a.png").write_bytes(b"")
    process = await start(
        "run", "eyes", "--from", f"film:{tmp_path}", "--listen", free_endpoint(),
        ENGAGE_DATA=str(tmp_path / "none"),
    )  # fmt: skip
    _, errors = await process.communicate()

    assert process.returncode == 2
    assert b"engage eyes install" in errors


def test_a_source_is_for_one_of_the_senses(capsys: pytest.CaptureFixture[str]):
    told = engage(capsys)("run", "realizer", "--from", "film:x")
    assert (told.code, "--from is for hearing, eyes or pieces" in told.err) == (2, True)
