# ruff: noqa: E402
"""Pictures and films, where this machine can draw without a screen."""

import asyncio
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

pytest.importorskip("mujoco", reason="needs the extra `mujoco`")
image = pytest.importorskip("PIL.Image", reason="needs the extra `mujoco`")

from engage_hri.schemas.behaviors import FaceLexeme, Gaze, Pointing, Speech
from engage_hri.schemas.faults import InputRefused, RunFailed
from engage_hri.services.control.bases.composed import Member, composed
from engage_hri.services.control.bases.driver_guard import GuardedBody
from engage_hri.services.control.contract.body import MouthShape
from engage_hri.services.control.mujoco.body import MujocoBody
from engage_hri.services.control.mujoco.film import Film, check, filmed, show_face
from engage_hri.services.control.mujoco.pictures import Beam, Camera, Cone, Picture
from engage_hri.services.control.mujoco.settings import MujocoSettings
from engage_hri.services.control.testing import WORLD, Stage, performed
from engage_hri.services.control.torso.body import SimulatedBody


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
    show_face(model, body.planned())

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


async def test_a_film_as_mp4_is_as_long_as_what_it_shows(body: MujocoBody, camera: Camera, tmp_path: Path):
    """Its own reader counts the pictures: ffmpeg's answer, and no file name."""
    camera.close()
    ffmpeg = pytest.importorskip("imageio_ffmpeg", reason="needs the package imageio-ffmpeg, to read it again")
    film = Film(body.bench.model, rate=4.0)
    for number in (0, 1, 2, 6):
        film.frames.append(replace(body.frame(), at=number / 4))
    film.write(file := tmp_path / "film.mp4", size=(160, 120))
    frames, seconds = ffmpeg.count_frames_and_secs(str(file))

    assert frames == 7
    assert seconds == pytest.approx(7 / 4, abs=0.05)


async def test_lips_are_filmed_while_the_motors_stand(body: MujocoBody):
    film = Film(body.bench.model, rate=20.0)
    await asyncio.sleep(2.0)  # the physics has settled
    async with filmed(film, body.frame):
        await asyncio.sleep(1.0)
        assert len(film.frames) == 1  # nothing moves

        now = asyncio.get_running_loop().time()
        body.move_lips([MouthShape(at=now + 0.1 * step, opening=0.8 * (step % 2)) for step in range(11)])
        await asyncio.sleep(1.2)

    speaking = film.frames[1:]
    assert len(speaking) >= 18
    assert all(frame.qpos.tolist() == film.frames[0].qpos.tolist() for frame in speaking)
    assert max(frame.pose["jaw"] for frame in speaking) > 0.2
    assert speaking[-1].pose["jaw"] == pytest.approx(0.0, abs=0.01)


async def test_a_film_that_ffmpeg_cannot_write_is_told(body: MujocoBody, camera: Camera, tmp_path: Path):
    camera.close()
    pytest.importorskip("imageio_ffmpeg", reason="needs the package imageio-ffmpeg")
    film = Film(body.bench.model)
    film.frames.append(body.frame())
    with pytest.raises(RunFailed, match="ffmpeg could not write"):
        film.write(tmp_path / "nowhere" / "film.mp4", size=(160, 120))


async def test_the_words_of_another_drivers_voice_are_in_the_film():
    body, other = MujocoBody(), SimulatedBody()
    parts = tuple(part for part in body.capabilities.parts if part != "voice")
    whole = composed([Member("mujoco", GuardedBody("mujoco", body), parts), Member("silent", other, ("voice",))])
    assert body.frame().caption == ""
    stage = Stage(whole, Speech(id="s", text="this piece"), "end")
    await asyncio.sleep(0.2)
    assert body.state().speaking == ""
    assert body.frame().caption == "this piece"
    await stage.over()
    assert body.frame().caption == ""


def test_a_film_of_an_unknown_kind_is_refused():
    with pytest.raises(InputRefused, match="film"):
        check(Path("film.avi"))
