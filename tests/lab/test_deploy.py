"""The recipes of docs/deploy.md: by hand on three machines, as systemd units, in containers."""

import asyncio
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path
from typing import NamedTuple

import jsonschema  # type: ignore[import-untyped]
import pytest
import yaml  # type: ignore[import-untyped]

from engage_hri.services.bus.certificates import initialize
from tests.bus.places import free_endpoint
from tests.cli.command import FRAGMENT
from tests.lab.lab import laboratory, missing
from tests.lab.test_reach import LONG, engage, until
from tests.test_wheel import HOLDS

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
    (tmp_path / "greeting.xml").write_text(FRAGMENT)
    async with laboratory(tmp_path, seed=1) as lab:
        played = 0
        for number, words in by_hand():
            arguments = [str(tmp_path / each) if each.endswith(".xml") else each for each in words]
            process = await engage(lab.machines[number], *arguments)
            if words[0] == "play":
                told, _ = await asyncio.wait_for(process.communicate(), LONG)
                assert process.returncode == 0, told.decode()
                assert "Answered by " in told.decode(), told.decode()
                played += 1
            elif READY[words[0]]:
                await until(process, READY[words[0]])
        assert played == 1


def test_the_image_gets_what_the_package_is_made_of_and_nothing_else() -> None:
    lines = [line for line in (DOCS.parent / ".dockerignore").read_text().splitlines() if not line.startswith("#")]

    assert lines[0] == "*"
    assert {line.removeprefix("!") for line in lines if line.startswith("!")} == set(HOLDS)
    assert [line for line in lines[1:] if not line.startswith("!")] == ["**/__pycache__"]
    assert yaml.safe_load((FILES / "compose.yaml").read_text())["x-service"]["build"]["context"] == "../.."


def test_every_service_has_its_place_in_every_recipe() -> None:
    hand = {words[1] for _, words in by_hand() if words[0] == "run"}
    for file in ("compose.yaml", "compose.open.yaml"):
        compose = yaml.safe_load((FILES / file).read_text())["services"]
        assert hand == {name for name in compose if name != "router"}
        assert all(each["command"][:2] == ["run", name] for name, each in compose.items() if name != "router")


def test_containers_have_keys_unless_the_file_is_called_open_and_that_one_listens_on_loopback_only() -> None:
    with_keys, without = (
        yaml.safe_load((FILES / file).read_text())["services"] for file in ("compose.yaml", "compose.open.yaml")
    )

    for name, each in with_keys.items():
        assert each["environment"]["ENGAGE_BUS_CONNECT"].startswith("tls/"), name
        (mounted,) = each["volumes"]
        assert mounted.endswith(f"/{name}:/keys:ro")
    assert with_keys["router"]["command"][2].startswith("tls/")
    assert [each["ports"] for each in without.values() if "ports" in each] == [["127.0.0.1:7447:7447"]]
    assert not any("volumes" in each for each in without.values())


def test_the_image_runs_on_the_quick_loop_as_a_user_of_its_own() -> None:
    lines = [line.split(" ", 1) for line in (FILES / "Dockerfile").read_text().splitlines() if line[0] != "#"]

    users = [rest for word, rest in lines if word == "USER"]
    made = next(rest for word, rest in lines if word == "RUN" and rest.startswith("useradd"))
    installed = next(rest for word, rest in lines if word == "RUN" and "pip install" in rest)
    kept = next(rest for word, rest in lines if word == "RUN" and rest.startswith("install"))
    assert users == ["10001"]
    assert f"--owner {users[0]} " in kept
    for file in ("compose.yaml", "compose.open.yaml"):
        command = yaml.safe_load((FILES / file).read_text())["services"]["recognition"]["command"]
        assert command[-1] == f"recognition.memory={kept.split()[-1]}/recognition"
    assert f"--uid {users[0]}" in made
    assert '"/source[speed]"' in installed
    assert lines.index(["USER", "10001"]) > lines.index(["RUN", installed])
    keyed = yaml.safe_load((FILES / "compose.yaml").read_text())["services"]
    given = re.search(rf"cd keys && chown -R {users[0]} ([a-z ]+)\)", (DOCS / "deploy.md").read_text())
    assert given is not None
    assert sorted(given[1].split()) == sorted(keyed)  # and neither the authority's key nor those of people


@pytest.mark.parametrize("file", ["compose.yaml", "compose.open.yaml"])
def test_the_compose_files_keep_to_the_specification(file: str) -> None:
    checker = jsonschema.Draft7Validator(json.loads(SCHEMA.read_text()))
    compose = yaml.safe_load((FILES / file).read_text())

    checker.validate(compose)
    compose["services"]["router"]["comand"] = ["router"]
    with pytest.raises(jsonschema.ValidationError, match="comand"):
        checker.validate(compose)


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="needs systemd-analyze")
@pytest.mark.parametrize(
    ("unit", "more"),
    [
        ("engage-router.service", ""),
        ("engage-router.service", "router-keys.conf"),
        ("engage@.service", ""),
        ("engage@.service", "keys.conf"),
    ],
)
def test_systemd_finds_nothing_wrong_with_the_units(unit: str, more: str, tmp_path: Path) -> None:
    """more: the file that is put beside the unit, for keys."""
    files = {unit: tmp_path / unit, more: tmp_path / f"{unit}.d" / "keys.conf"} if more else {unit: tmp_path / unit}
    command = ["systemd-analyze", "verify", str(tmp_path / unit)]
    for name, there in files.items():
        there.parent.mkdir(exist_ok=True)
        there.write_text((FILES / name).read_text().replace("/usr/local/bin/engage", sys.executable))
    checked = subprocess.run(command, capture_output=True, text=True)
    assert (checked.returncode, checked.stderr) == (0, "")
    for name, there in files.items():
        there.write_text((FILES / name).read_text() + "Usr=nobody\n")
        wrong = subprocess.run(command, capture_output=True, text=True)
        assert wrong.returncode != 0 or "Usr" in wrong.stderr, name


def test_the_units_and_containers_name_variables_that_are_read() -> None:
    from engage_hri.services.bus.config import PREFIX, BusConfig, environment

    texts = [(FILES / each).read_text() for each in ("bus.env", "bus-keys.env", "compose.yaml", "compose.open.yaml")]
    names = {name for text in texts for name in re.findall(r"\b(ENGAGE_BUS_\w+)", text)}

    assert names == {"ENGAGE_BUS_ROBOT", "ENGAGE_BUS_CONNECT", "ENGAGE_BUS_KEYS"}
    assert {PREFIX + each.upper() for each in BusConfig.__struct_fields__} >= names
    tables = [
        environment(dict(line.split("=", 1) for line in text.splitlines() if "=" in line and line[0] != "#"))
        for text in texts[:2]
    ]
    assert tables == [
        {"bus": {"robot": "melvin", "connect": ["tcp/10.77.0.1:7447"]}},
        {"bus": {"robot": "melvin", "connect": ["tls/10.77.0.1:7447"], "keys": "/etc/engage/keys"}},
    ]


class Container(NamedTuple):
    """A service of a compose file, as a process of this machine can be started for it."""

    command: list[str]
    environment: dict[str, str]


def containers(file: str, variables: dict[str, str]) -> dict[str, Container]:
    """The containers of a compose file. A folder that is mounted stands for the place where it is.

    variables: those that the file takes from its environment.
    """

    def filled(match: re.Match[str]) -> str:
        return variables.get(match["name"]) or match["default"] or ""

    found: dict[str, Container] = {}
    text = re.sub(r"\$\{(?P<name>\w+)(?::[-?](?P<default>[^}]*))?\}", filled, (FILES / file).read_text())
    for name, its in yaml.safe_load(text)["services"].items():
        mounted = {there: here for here, there, *_ in (each.split(":") for each in its.get("volumes", ()))}
        environment = {key: mounted.get(value, value) for key, value in its["environment"].items()}
        command = [word for word in its["command"] if not word.startswith("recognition.memory=")]
        if len(command) < len(its["command"]):
            command.remove("--set")  # its folder is the image's
        found[name] = Container(command, environment)
    return found


@pytest.mark.real_time
async def test_what_the_containers_of_a_robot_with_keys_run_is_a_robot_with_keys(tmp_path: Path) -> None:
    """Without the containers: the same commands and variables, each with the keys that its container sees."""
    endpoint = free_endpoint()
    host, port = endpoint.removeprefix("tcp/").split(":")
    ring, block = tmp_path / "keys", tmp_path / "greeting.xml"
    initialize(ring, "robot", [("manager", "alice")], [host], 2)
    block.write_text(FRAGMENT)
    variables = {"ENGAGE_KEYS": str(ring), "ENGAGE_ROUTER": host}
    async with AsyncExitStack() as stack:
        for name, container in containers("compose.yaml", variables).items():
            words = [each.replace("0.0.0.0:7447", f"{host}:{port}") for each in container.command]
            itself = {key: value.replace(":7447", f":{port}") for key, value in container.environment.items()}
            process = await stack.enter_async_context(started(*words, **itself))
            await until(process, "router is ready" if name == "router" else "is ready")
        where = ("--connect", f"tls/{host}:{port}", "--keys", str(ring / "alice"))
        player = await stack.enter_async_context(started("play", str(block), *where))
        told, _ = await asyncio.wait_for(player.communicate(), LONG)

    assert player.returncode == 0, told.decode()
    assert "Answered by " in told.decode().splitlines()[-1]


@asynccontextmanager
async def started(*arguments: str, **environment: str) -> AsyncIterator[asyncio.subprocess.Process]:
    """A command of ours, with these variables of the environment; it ends with the context."""
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "engage_hri", *arguments, env={**os.environ, **environment},
        stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.STDOUT,
    )  # fmt: skip
    try:
        yield process
    finally:
        if process.returncode is None:
            process.terminate()
        await process.communicate()
