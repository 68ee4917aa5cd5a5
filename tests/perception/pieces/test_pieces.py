"""The service of pieces, in virtual time: from pictures of a table to the world."""

import asyncio
import math
from collections.abc import AsyncIterator, Iterable, Sequence
from contextlib import asynccontextmanager
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.units import Stamp
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.perception.eyes.watching import SourceLost
from engage_hri.services.perception.pieces import service
from engage_hri.services.perception.pieces.colors import read_palette, task_table, written_palette
from engage_hri.services.perception.pieces.config import PiecesConfig
from engage_hri.services.perception.pieces.finding import learned
from engage_hri.services.perception.pieces.keeping import COVERED
from engage_hri.services.perception.pieces.service import keep_an_eye
from engage_hri.services.perception.pieces.spotting import SpottedPiece, SpottedPieces
from engage_hri.services.runtime.service import Service, running
from engage_hri.services.tangram.collaboration.task import Goal
from tests.perception.pieces.appendix_a import poses_told
from tests.perception.pieces.tables import EYE, GOALS, STARTS, TABLE, Hand, Picture, Pose, drawn
from tests.perception.pieces.test_finding import flat

RATE = 5.0
CAMERA = {"field_of_view": EYE.field, "place": EYE.at, "tilt": -EYE.down}


def film(folder: Path, pictures: Iterable[Picture]) -> Path:
    folder.mkdir()
    for number, picture in enumerate(pictures):
        cv2.imwrite(str(folder / f"{number:02}.png"), picture[:, :, ::-1])
    return folder


def colors(folder: Path) -> str:
    path = folder / "colors.toml"
    path.write_text(written_palette(learned(drawn(STARTS, seed=99), TABLE, flat())))
    return str(path)


class Heard:
    def __init__(self) -> None:
        self.worlds: list[World] = []
        self.faults: list[Fault] = []

    def pieces(self, number: int = -1) -> dict[str, Entity]:
        return {each.id: each for each in self.worlds[number].objects}


@asynccontextmanager
async def looking(hub: MemoryHub, **settings: Any) -> AsyncIterator[tuple[Heard, asyncio.Event]]:
    heard = Heard()
    with hub.join("listener", role="observer").subscribe(keys.WORLD, keys.fault("pieces")) as inbox:
        own: dict[str, Service] = {"pieces": partial(keep_an_eye, config=PiecesConfig(**settings))}
        async with running(hub, own) as over:

            async def listen() -> None:
                async for received in inbox:
                    match received.message:
                        case World():
                            heard.worlds.append(received.message)
                        case Fault():
                            heard.faults.append(received.message)

            listening = asyncio.create_task(listen())
            yield heard, over
        await asyncio.sleep(0.01)
        listening.cancel()
        await asyncio.wait([listening])


async def test_a_film_of_a_table_becomes_the_world(hub: MemoryHub, tmp_path: Path):
    """The figure, complete; a hand comes over it; at the end what was told is taken away."""
    hand = Hand((0.52, 0.0), 0.2, 1)
    pictures = [drawn(GOALS, hands=each, seed=1, take=k) for k, each in enumerate([(), (), (), *[(hand,)] * 4])]
    path = film(tmp_path / "film", pictures)

    async with looking(hub, source=f"film:{path}", colors=colors(tmp_path), **CAMERA) as (heard, over):
        await over.wait()

    whole, hidden = heard.pieces(1), heard.pieces(-2)
    assert {*whole} == {*hidden} == {*GOALS}
    assert {each.confidence for each in whole.values()} == {1.0}
    assert [each.id for each in heard.worlds[0].entities if each.kind == "surface"] == ["table"]
    assert Goal(TABLE).placed(whole.values()) == {*GOALS}
    assert Goal(TABLE).placed(hidden.values()) == {*GOALS}
    assert hidden["rectangle"].confidence == COVERED
    assert hidden["green-square"].confidence > COVERED
    away = [math.dist(pose[:2], GOALS[id][:2]) for id, pose in poses_told(heard.worlds[-2].entities).items()]
    assert max(away) < 0.003
    assert heard.worlds[-1].entities == ()


async def test_a_figure_with_a_piece_that_lies_wrong_is_wrong(hub: MemoryHub, tmp_path: Path):
    x, y, turn = GOALS["trapezoid"]
    wrong = GOALS | {"trapezoid": (x - 0.03, y + 0.02, turn + 0.4)}
    path = film(tmp_path / "film", [drawn(wrong, seed=1, take=k) for k in range(2)])

    async with looking(hub, source=f"film:{path}", colors=colors(tmp_path), **CAMERA) as (heard, over):
        await over.wait()

    assert Goal(TABLE).placed(heard.pieces(1).values()) == {*GOALS} - {"trapezoid"}


# -- devices -------------------------------------------------------------------------------------------------------


class Script:
    """A source that a test plays: tables at instants, or the fault by which a camera is lost."""

    def __init__(self, lives: Iterable[Sequence[dict[str, Pose] | Fault]]) -> None:
        self._lives = iter(lives)

    def __call__(self, order: object, kind: object) -> "Script":
        return self

    async def watch(self) -> AsyncIterator[SpottedPieces | None]:
        yield None
        for each in next(self._lives):
            if isinstance(each, Fault):
                raise SourceLost(each)
            await asyncio.sleep(1 / RATE)
            pieces = tuple(SpottedPiece(id, *pose) for id, pose in each.items())
            yield SpottedPieces(at=Stamp("", asyncio.get_running_loop().time()), pieces=pieces)


UNPLUGGED = Fault(reason="the camera gives no picture any more", where="pieces.source")


async def test_a_camera_that_is_unplugged_is_told_once_and_takes_nothing_away(
    hub: MemoryHub, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    lives = [[STARTS, STARTS, STARTS, UNPLUGGED], [UNPLUGGED], [STARTS, STARTS]]
    monkeypatch.setattr(service, "InsideWatching", Script(lives))

    async with looking(hub, source="camera", colors=colors(tmp_path)) as (heard, over):
        await over.wait()

    assert [fault.reason for fault in heard.faults] == [UNPLUGGED.reason]
    assert {each.service for each in heard.faults} == {"pieces"}
    told = [len(each.objects) for each in heard.worlds]
    assert told[-2:] == [len(STARTS), 0]
    assert 0 not in told[told.index(len(STARTS)) : -1]


async def test_people_of_others_stay_in_the_world(hub: MemoryHub, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(service, "InsideWatching", Script([[STARTS] * 10]))
    ann = Entity(id="ann", kind="person", position=(1.3, 0.0, 1.2))
    hub.join("eyes").publish(keys.WORLD, World(entities=(ann,)))

    async with looking(hub, source="camera", colors=colors(tmp_path)) as (heard, over):
        await over.wait()

    assert all(each.entity("ann") for each in heard.worlds[1:])


async def test_a_film_that_is_not_there_is_refused_in_words(hub: MemoryHub, tmp_path: Path):
    with pytest.raises((InputRefused, ExceptionGroup)) as refused:
        async with looking(hub, source="film:nowhere", colors=colors(tmp_path)):
            pytest.fail("it has said that it is ready")
    raised: BaseException = refused.value
    while isinstance(raised, ExceptionGroup):
        [raised] = raised.exceptions

    assert "nowhere: there is no such file" in str(raised)


def test_what_is_missing_is_told_in_words(tmp_path: Path):
    few, bad = tmp_path / "few.toml", tmp_path / "bad.toml"
    few.write_text("table = [1, 2, 3]\nblue = [1, 2, 3]\n")
    bad.write_text('[surface]\nid = "table"\n')

    with pytest.raises(InputRefused, match=r"none\.toml") as refused:
        read_palette(str(tmp_path / "none.toml"), TABLE)
    assert "engage calibrate colors" in refused.value.fault.advice
    with pytest.raises(InputRefused, match="it has no color green, orange"):
        read_palette(str(few), TABLE)
    with pytest.raises(InputRefused, match="chess") as refused:
        task_table("chess")
    assert "tangram" in refused.value.fault.advice
    with pytest.raises(InputRefused, match=r"bad\.toml"):
        task_table(str(bad))


def test_a_task_has_a_file_of_its_own(tmp_path: Path):
    file = tmp_path / "cups.toml"
    file.write_text(CUPS)
    table = task_table(str(file))

    assert [form.id for form in table.pieces] == ["saucer"]
    assert table.pieces[0].turns_alike == 4
    assert task_table("tangram") == TABLE


CUPS = """
thickness = 0.005

[surface]
id = "desk"
center = [0.6, 0.0, 0.7]
footprint = [[0.3, 0.4], [-0.3, 0.4], [-0.3, -0.4], [0.3, -0.4]]

[[pieces]]
id = "saucer"
color = "blue"
shape = "square"
footprint = [[0.05, 0.05], [-0.05, 0.05], [-0.05, -0.05], [0.05, -0.05]]
start = [0.5, 0.1, 20]
"""
