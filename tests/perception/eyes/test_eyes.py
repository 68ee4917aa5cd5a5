"""The service of eyes on a robot, in virtual time, by landmarks that were recorded."""

import asyncio
from collections.abc import AsyncIterator, Iterable
from contextlib import asynccontextmanager
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pytest

from engage_hri import embedded
from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, ActorLost, FaceLandmarks, HeadPose
from engage_hri.schemas.world import World
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.perception.eyes import service
from engage_hri.services.perception.eyes.config import EyesConfig
from engage_hri.services.perception.eyes.service import LOOK_AROUND, see
from engage_hri.services.perception.eyes.watching import SourceLost
from engage_hri.services.runtime.service import Service, running
from tests.perception.eyes.faces import Heads, landmarks, recorded
from tests.perception.eyes.people import Pose
from tests.perception.test_hearing import idle
from tests.recording.files import sample, saved

pytestmark = pytest.mark.usefixtures("exact_face")
Kind = TypeVar("Kind")
SEAT = (0.0, 0.0, 1.2)


class Told:
    """What eyes have told. over: set when they have ended. begin: loop time of the first picture."""

    def __init__(self, over: asyncio.Event, begin: float) -> None:
        self.over, self.begin = over, begin
        self.messages: list[Any] = []

    def of(self, kind: type[Kind], **fields: Any) -> list[Kind]:
        return [
            each for each in self.messages
            if isinstance(each, kind) and all(getattr(each, name) == value for name, value in fields.items())
        ]  # fmt: skip

    def seconds(self, message: Any) -> float:
        return float(message.at.seconds - self.begin)


@asynccontextmanager
async def eyes(hub: MemoryHub, **settings: Any) -> AsyncIterator[Told]:
    """Eyes before a recognition that does nothing."""
    patterns = (
        keys.PERCEIVED_ACTION, keys.WORLD, keys.ANY_HEAD_POSE, keys.ANY_LANDMARKS, keys.fault("eyes"),
    )  # fmt: skip
    with hub.join("listener", role="observer").subscribe(*patterns) as inbox:
        async with running(hub, {"recognition": idle}):
            own: dict[str, Service] = {"eyes": partial(see, config=EyesConfig(**settings))}
            async with running(hub, own) as over:
                told = Told(over, asyncio.get_running_loop().time() + LOOK_AROUND)

                async def listen() -> None:
                    async for received in inbox:
                        told.messages.append(received.message)

                listening = asyncio.create_task(listen())
                yield told
            await asyncio.sleep(0.01)
            listening.cancel()
            await asyncio.wait([listening])


def sitting(yaw: float = 0.0, pitch: float = 0.0) -> Heads:
    return lambda at: [Pose(SEAT, yaw, pitch)]


async def test_who_sits_there_is_told_with_head_place_and_doubt(hub: MemoryHub, tmp_path: Path):
    path = recorded(tmp_path / "a.mcap", sitting(yaw=20, pitch=-10), 2.0)

    async with eyes(hub, source=f"landmarks:{path}", place=(0.0, 0.0, 1.2)) as told:
        await told.over.wait()

    poses = told.of(HeadPose)
    assert [type(each) for each in told.messages if isinstance(each, ActorFound | ActorLost)] == [
        ActorFound,
        ActorLost,
    ]
    assert {each.actor for each in poses} == {"face_1"}
    assert len(poses) == 30 - 4
    assert poses[-1].position == pytest.approx((1.2, 0.0, 1.2), abs=0.02)
    assert np.degrees(np.arctan2(poses[-1].direction[1], -poses[-1].direction[0])) == pytest.approx(-20, abs=1.5)
    assert all(each.yaw_spread and 0.01 < each.yaw_spread < 0.2 and each.mouth is not None for each in poses)
    assert [entity.id for entity in told.of(World)[0].entities] == ["face_1"]
    assert told.of(World)[-1].entities == ()
    assert len(told.of(FaceLandmarks)) == 30


async def test_a_pose_has_the_instant_of_its_picture(hub: MemoryHub, tmp_path: Path):
    path = recorded(tmp_path / "a.mcap", sitting(), 1.0)

    async with eyes(hub, source=f"landmarks:{path}") as told:
        await told.over.wait()

    instants = [told.seconds(each) for each in told.of(HeadPose)]
    assert instants == pytest.approx([k / 15 for k in range(4, 15)], abs=1e-6)
    [found] = told.of(ActorFound)
    assert told.seconds(found) == pytest.approx(0.0, abs=1e-6)


async def test_a_nod_is_told_as_an_action(hub: MemoryHub, tmp_path: Path):
    def nods(at: float) -> list[Pose]:
        return [Pose(SEAT, 0, -9 * float(np.sin(2 * np.pi * 1.8 * (at - 1))) if 1 < at < 1 + 2 / 1.8 else 0.0)]

    path = recorded(tmp_path / "a.mcap", nods, 4.0)
    async with eyes(hub, source=f"landmarks:{path}") as told:
        await told.over.wait()

    [began], [ended] = told.of(ActionBegan), told.of(ActionEnded)
    assert (began.action, ended.action, began.actor) == ("nod", "nod", "face_1")
    assert told.seconds(began) == pytest.approx(1.0, abs=0.15)
    assert told.seconds(ended) == pytest.approx(1 + 2 / 1.8, abs=0.3)


async def test_a_face_that_is_recorded_becomes_looks_at_the_robot_and_away(tmp_path: Path):
    """Through recognition of a whole robot: somebody sits opposite, looks at it, down at the table, and at it."""

    def looking(at: float) -> list[Pose]:
        down = float(np.clip((at - 4) / 0.3, 0, 1)) - float(np.clip((at - 7) / 0.3, 0, 1))
        return [Pose(SEAT, 0.0, -40.0 * down)]

    path = recorded(tmp_path / "a.mcap", looking, 10.0)
    config = EyesConfig(source=f"landmarks:{path}")
    async with embedded(human="none") as robot:
        begin = asyncio.get_running_loop().time() + LOOK_AROUND
        with robot.hub.join("listener", role="observer").subscribe(keys.RECOGNIZED_ACTION) as inbox:
            async with running(robot.hub, {"eyes": partial(see, config=config)}) as over:
                await over.wait()
            looks = []
            while (received := inbox.take()) is not None:
                looks.append(received.message)
        name = robot.hub.robot

    began = [each for each in looks if isinstance(each, ActionBegan) and each.action == "look"]
    assert [name in each.targets for each in began[:3]] == [True, False, True]
    assert began[0].at.seconds - begin < 0.4
    assert began[1].at.seconds - begin == pytest.approx(4.15, abs=0.25)
    assert began[2].at.seconds - begin == pytest.approx(7.15, abs=0.25)


# -- devices -------------------------------------------------------------------------------------------------------


class Script:
    """A source that a test plays: heads at instants, or the fault by which a camera is lost."""

    def __init__(self, lives: Iterable[Iterable[float | Fault]]) -> None:
        self._lives = iter(lives)

    def __call__(self, order: object) -> "Script":
        return self

    async def watch(self) -> AsyncIterator[FaceLandmarks | None]:
        yield None
        for each in next(self._lives):
            if isinstance(each, Fault):
                raise SourceLost(each)
            loop = asyncio.get_running_loop()
            await asyncio.sleep(each - loop.time())
            yield landmarks([Pose(SEAT)], loop.time())


def steady(since: float, until: float) -> list[float]:
    return [since + k / 15 for k in range(round((until - since) * 15))]


UNPLUGGED = Fault(reason="the camera gives no picture any more", where="eyes.source")


async def test_a_camera_that_is_unplugged_is_told_once_and_seen_with_again(
    hub: MemoryHub, monkeypatch: pytest.MonkeyPatch
):
    lives = [[*steady(1, 3), UNPLUGGED], [UNPLUGGED], [*steady(8, 10)]]
    monkeypatch.setattr(service, "InsideWatching", Script(lives))

    async with eyes(hub, source="camera") as told:
        await told.over.wait()

    [fault] = told.of(Fault)
    assert fault.reason == UNPLUGGED.reason
    assert fault.service == "eyes"
    [found] = told.of(ActorFound)
    [lost] = told.of(ActorLost)
    assert (found.actor, lost.actor) == ("face_1", "face_1")
    assert lost.at.seconds == pytest.approx(10, abs=0.1)


@pytest.mark.parametrize("stall", [0.3, 1.0, 3.0])
async def test_a_stall_is_no_departure(hub: MemoryHub, monkeypatch: pytest.MonkeyPatch, stall: float):
    monkeypatch.setattr(service, "InsideWatching", Script([[*steady(1, 3), *steady(3 + stall, 5 + stall)]]))

    async with eyes(hub, source="camera") as told:
        await told.over.wait()

    assert len(told.of(ActorFound)) == len(told.of(ActorLost)) == 1
    assert told.of(ActorLost)[0].at.seconds > 4.9 + stall
    assert told.of(Fault) == []


async def refusal(hub: MemoryHub, source: str) -> str:
    """What eyes say that cannot see with this source, before they are ready."""
    with pytest.raises((InputRefused, ExceptionGroup)) as refused:
        async with eyes(hub, source=source):
            pytest.fail("they have said that they are ready")
    raised: BaseException = refused.value
    while isinstance(raised, ExceptionGroup):
        [raised] = raised.exceptions
    return str(raised)


@pytest.mark.parametrize(
    ("source", "reason"),
    [("camara", "no source 'camara'"), ("landmarks:nowhere.mcap", "nowhere.mcap: cannot read: No such file")],
)
async def test_what_is_no_source_is_refused_in_words(hub: MemoryHub, source: str, reason: str):
    assert reason in await refusal(hub, source)


async def test_a_recording_without_landmarks_is_refused(hub: MemoryHub, tmp_path: Path):
    path = saved(tmp_path / "a.mcap", [sample(keys.WORLD, World(entities=()), 0.0)])

    assert "it has no landmarks" in await refusal(hub, f"landmarks:{path}")
