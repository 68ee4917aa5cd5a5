"""Worlds from files, and a world that stands still."""

import json
import re
from functools import partial
from pathlib import Path

import msgspec
import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.faults import InputRefused
from engage_hri.schemas.units import Stamp
from engage_hri.schemas.world import World
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.robot import connect
from engage_hri.services.runtime.service import running
from engage_hri.services.simulation.still import EXAMPLE, load_world, show_world, table_world

COMMANDS = (Path(__file__).parents[2] / "docs/commands.md").read_text()
CUP = '{"id": "cup", "kind": "object", "position": [0.5, 0.1, 0.8]}'


def test_a_world_is_a_list_of_entities(tmp_path: Path) -> None:
    file = tmp_path / "world.json"
    file.write_text(f'{{"entities": [{CUP}, {{"id": "anna", "kind": "person", "position": [1.3, 0, 1.2]}}]}}')

    world = load_world(file)

    assert [entity.id for entity in world.objects] == ["cup"]
    assert [entity.position for entity in world.people] == [(1.3, 0.0, 1.2)]


def test_a_world_of_the_bus_can_be_kept_in_a_file(tmp_path: Path) -> None:
    world = msgspec.structs.replace(table_world(), at=Stamp(clock="loop", seconds=3.0))
    file = tmp_path / "world.json"
    file.write_bytes(msgspec.json.encode(world))

    assert load_world(file).entities == world.entities


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "truncated"),
        ("{", "truncated"),
        ('{"things": []}', r"unknown field `things`"),
        ('{"entities": [{"id": "cup", "kind": "mug", "position": [0, 0, 0]}]}', r"\$\.entities\[0?\.*\]?.*kind"),
        ('{"entities": [{"id": "cup", "kind": "object", "position": [0, 0]}]}', r"position"),
        ('{"entities": [{"id": "cup", "kind": "object"}]}', r"position"),
        (f'{{"entities": [{CUP}, {CUP}]}}', r"\$\.entities\[1\]\.id: duplicate id 'cup'"),
        (
            '{"entities": [{"id": "", "kind": "object", "position": [0, 0, 0]}]}',
            r"length >= 1 - at `\$\.entities\[0\]\.id`",
        ),
        ('{"entities": [{"id": "caf\xe9", "kind": "object", "position": [0, 0, 0]}]}', r"not UTF-8"),
    ],
)
def test_a_bad_world_is_refused_with_file_and_place(tmp_path: Path, text: str, reason: str) -> None:
    file = tmp_path / "world.json"
    file.write_text(text, encoding="latin-1")

    with pytest.raises(InputRefused, match=reason) as refusal:
        load_world(file)

    assert refusal.value.fault.where.startswith(str(file))


@pytest.mark.parametrize(
    ("about", "place"),
    [
        ({"position": [1e308, 0, 0]}, "position[0]"),
        ({"position": [0, 0, -2e6]}, "position[2]"),
        ({"yaw": 1e300}, "yaw"),
        ({"radius": -0.1}, "radius"),
        ({"footprint": [[0, 0], [1, 1e9]]}, "footprint[1][1]"),
        ({"velocity": [0, 1e308, 0]}, "velocity[1]"),
    ],
)
def test_what_is_no_place_is_refused_with_its_json_path(tmp_path: Path, about: dict[str, object], place: str) -> None:
    file = tmp_path / "world.json"
    cup = {"id": "cup", "kind": "object", "position": [0.5, 0.1, 0.8], **about}
    file.write_text(json.dumps({"entities": [cup]}))

    with pytest.raises(InputRefused) as refusal:
        load_world(file)

    fault = refusal.value.fault
    assert f"at `$.entities[0].{place}`" in fault.reason
    assert fault.where == str(file)
    assert "in metres" in fault.advice


@pytest.mark.parametrize("id", ["a/b", "@anna", "who?", "all"])
def test_a_person_whose_id_cannot_be_in_a_key_is_refused(tmp_path: Path, id: str) -> None:
    file = tmp_path / "world.json"
    file.write_text(json.dumps({"entities": [{"id": id, "kind": "person", "position": [1, 0, 1]}]}))

    with pytest.raises(InputRefused, match=r"\$\.entities\[0\]\.id: .* can't be a person's id"):
        load_world(file)


def test_a_world_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputRefused, match=r"nowhere\.json: No such file"):
        load_world(tmp_path / "nowhere.json")


def test_without_a_file_there_is_the_tangram_table_and_a_person() -> None:
    world = table_world()

    assert len(world.objects) == 10
    assert [person.id for person in world.people] == ["human"]
    assert world.entity("table") is not None


async def test_a_still_world_is_there_for_whoever_comes_later(hub: MemoryHub) -> None:
    async with running(hub, {"simulation": partial(show_world, world=table_world())}):
        with hub.join("late").subscribe(keys.PERCEIVED_ACTION) as found:
            async with connect(hub=hub) as robot:
                world = await robot.world()
            assert len(found) == 1

    assert isinstance(world, World)
    assert world.entities == table_world().entities


@pytest.mark.parametrize("source", [EXAMPLE, re.search(r"\{\"entities\".*?\]\}\n", COMMANDS, re.DOTALL)])
def test_an_example_of_a_world_says_what_its_objects_are(source: str | re.Match[str], tmp_path: Path) -> None:
    file = tmp_path / "world.json"
    file.write_text(source if isinstance(source, str) else source.group())

    assert all(thing.category for thing in load_world(file).objects)
