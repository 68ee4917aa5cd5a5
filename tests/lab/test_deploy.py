"""The recipes of docs/deploy.md: by hand on three machines, as systemd units, in containers."""

import asyncio
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import jsonschema  # type: ignore[import-untyped]
import pytest
import yaml  # type: ignore[import-untyped]

from tests.lab.lab import laboratory, missing
from tests.lab.test_reach import BML, LONG, engage, until

DOCS = Path(__file__).parents[2] / "docs"
FILES = DOCS / "deploy"
SCHEMA = Path(__file__).parent / "compose-spec.json"
"""The Compose specification's own schema, github.com/compose-spec/compose-spec (Apache 2.0)."""
READY = {"router": "router is ready", "run": "is ready", "watch": ""}
MACHINES = {"a": 1, "b": 2, "c": 3}


def by_hand() -> list[tuple[int, list[str]]]:
    """The commands of the page, each with the number of the machine that it is for."""
    page = (DOCS / "deploy.md").read_text(encoding="utf-8")
    lines = re.findall(r"^([abc])\$ engage (.*)$", page, re.MULTILINE)
    return [(MACHINES[machine], line.split()) for machine, line in lines]


@pytest.mark.real_time
@pytest.mark.skipif(bool(missing()), reason=missing())
async def test_three_machines_by_hand(tmp_path: Path) -> None:
    (tmp_path / "greeting.xml").write_text(BML)
    async with laboratory(tmp_path, seed=1) as lab:
        played = 0
        for number, words in by_hand():
            arguments = [str(tmp_path / each) if each.endswith(".xml") else each for each in words]
            process = await engage(lab.machines[number], *arguments)
            if words[0] == "play":
                told, _ = await asyncio.wait_for(process.communicate(), LONG)
                assert process.returncode == 0, told.decode()
                played += 1
            elif READY[words[0]]:
                await until(process, READY[words[0]])
        assert played == 1


def test_every_service_has_its_place_in_every_recipe() -> None:
    hand = {words[1] for _, words in by_hand() if words[0] == "run"}
    compose = yaml.safe_load((FILES / "compose.yaml").read_text())["services"]

    assert hand == {name for name in compose if name != "router"}
    assert all(each["command"] == ["run", name] for name, each in compose.items() if name != "router")


def test_the_compose_file_keeps_to_the_specification() -> None:
    checker = jsonschema.Draft7Validator(json.loads(SCHEMA.read_text()))
    compose = yaml.safe_load((FILES / "compose.yaml").read_text())

    checker.validate(compose)
    compose["services"]["router"]["comand"] = ["router"]
    with pytest.raises(jsonschema.ValidationError, match="comand"):
        checker.validate(compose)


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="needs systemd-analyze")
@pytest.mark.parametrize("unit", ["engage-router.service", "engage@.service"])
def test_systemd_finds_nothing_wrong_with_the_units(unit: str, tmp_path: Path) -> None:
    text = (FILES / unit).read_text()
    assert "/usr/local/bin/engage " in text
    there = tmp_path / unit
    there.write_text(text.replace("/usr/local/bin/engage", sys.executable))
    checked = subprocess.run(["systemd-analyze", "verify", str(there)], capture_output=True, text=True)
    assert (checked.returncode, checked.stderr) == (0, "")
    there.write_text(text)  # with a program that is not there
    assert subprocess.run(["systemd-analyze", "verify", str(there)], capture_output=True).returncode != 0


def test_the_units_and_containers_name_variables_that_are_read() -> None:
    from engage_hri.services.bus.config import PREFIX, BusConfig, environment

    texts = [(FILES / each).read_text() for each in ("bus.env", "compose.yaml")]
    names = {name for text in texts for name in re.findall(r"\b(ENGAGE_BUS_\w+)", text)}

    assert names == {"ENGAGE_BUS_ROBOT", "ENGAGE_BUS_CONNECT"}
    assert {PREFIX + each.upper() for each in BusConfig.__struct_fields__} >= names
    variables = dict(line.split("=", 1) for line in texts[0].splitlines() if "=" in line and not line.startswith("#"))
    assert environment(variables) == {"bus": {"robot": "melvin", "connect": ["tcp/10.77.0.1:7447"]}}
