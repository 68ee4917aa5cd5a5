# ruff: noqa: E402
"""Pictures and films, where this machine can draw without a screen."""

import asyncio
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="needs the extra `mujoco`")
image = pytest.importorskip("PIL.Image", reason="needs the extra `mujoco`")

from engage_hri.schemas.behaviors import FaceLexeme, Gaze, Pointing
from engage_hri.schemas.faults import InputRefused, RunFailed
from engage_hri.services.control.mujoco.body import MujocoBody
from engage_hri.services.control.mujoco.film import check, show_face
from engage_hri.services.control.mujoco.pictures import Beam, Camera, Cone, Picture
from engage_hri.services.control.mujoco.settings import MujocoSettings
from engage_hri.services.control.testing import WORLD, Stage, performed


@pytest.fixture
async def body() -> MujocoBody:
    body = MujocoBody()
    body.see(WORLD)
    await asyncio.sleep(0.2)
    return body


@pytest.fixture
def camera(body: MujocoBody) -> Camera:
    try:
        return Camera(body.bench.model, 160, 120)
    except RunFailed as failed:
        pytest.skip(str(failed.fault.reason))


def colors(picture: Picture) -> int:
    return len(np.unique(picture.reshape(-1, 3) // 32, axis=0))


async def test_a_picture_shows_the_scene_and_what_is_drawn_over_it(body: MujocoBody, camera: Camera):
    state, data = body.state(), body.bench.physics.data
    assert state.gaze is not None
    assert state.right_arm is not None
    plain = camera.picture(data)
    drawn = camera.picture(data, [Cone(state.gaze, 0.9), Beam(state.right_arm, 0.3)])

    assert plain.shape == (120, 160, 3)
    assert colors(plain) > 20
    assert np.any(plain != drawn)


async def test_the_robot_in_the_picture_is_where_its_joints_are(body: MujocoBody, camera: Camera):
    before = camera.picture(body.bench.physics.data)
    stage = Stage(body, Pointing(id="p", target="far-left", mode="LEFT_HAND"), "stroke")
    await asyncio.sleep(3.0)
    pointing = camera.picture(body.bench.physics.data)
    stage.authority.extend("end")
    await stage.over()
    await asyncio.sleep(2.0)
    after = camera.picture(body.bench.physics.data)

    assert np.mean(np.abs(pointing.astype(int) - before)) > 4 * np.mean(np.abs(after.astype(int) - before))


async def test_a_face_is_seen(body: MujocoBody):
    stage = Stage(body, FaceLexeme(id="f", lexeme="SMILE"), "stroke")
    await asyncio.sleep(2.0)
    model = body.bench.model
    before = model.geom("left_mouth").quat.copy()
    show_face(model, body._plan())

    assert model.geom("left_mouth").quat[1] > before[1]
    stage.task.cancel()


@pytest.mark.parametrize("ending", [".webp", ".gif", ".png"])
async def test_a_film_is_as_long_as_what_it_shows(camera: Camera, tmp_path: Path, ending: str):
    camera.close()
    file = tmp_path / f"film{ending}"
    body = MujocoBody(settings=MujocoSettings(film=str(file), rate=2.0, size=(160, 120)))
    body.see(WORLD)
    async with body.connected():
        began = asyncio.get_running_loop().time()
        await performed(body, Gaze(id="g", target="near-right"))
        lasted = asyncio.get_running_loop().time() - began

    with image.open(file) as film:
        if ending == ".png":
            assert film.size[0] % 80 == 0
            return
        seconds = 0.0
        for number in range(film.n_frames):
            film.seek(number)
            film.load()
            seconds += film.info["duration"] / 1000
    assert seconds == pytest.approx(lasted, abs=0.6)


def test_a_film_of_an_unknown_kind_is_refused():
    with pytest.raises(InputRefused, match="film"):
        check(Path("film.avi"))
