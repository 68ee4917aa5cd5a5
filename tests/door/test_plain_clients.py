"""Programs at the door that have nothing of ours: aiohttp, and Python's own `http.client`, over real sockets."""

import asyncio
import importlib.util
import json
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from io import BytesIO
from pathlib import Path
from typing import NamedTuple

import aiohttp
import pytest

from engage_hri.schemas.faults import InputRefused, RunFailed
from engage_hri.services.commandline import embedding
from engage_hri.services.commandline.shell import roster
from engage_hri.services.runtime.configuration import read
from tests.bus.places import free_endpoint

pytestmark = [
    pytest.mark.real_time,
    pytest.mark.skipif(importlib.util.find_spec("starlette") is None, reason="the extra `door` is not installed"),
]
EXAMPLE = Path(__file__).parents[2] / "examples" / "door_in_plain_python.py"


class OpenDoor(NamedTuple):
    port: int
    tokens: Path

    def headers(self, role: str = "manager") -> dict[str, str]:
        return {"authorization": f"Bearer {(self.tokens / role).read_text().strip()}"}

    def session(self, role: str = "manager") -> aiohttp.ClientSession:
        return aiohttp.ClientSession(f"http://127.0.0.1:{self.port}", headers=self.headers(role))


@asynccontextmanager
async def open_door(folder: Path, *settings: str) -> AsyncIterator[OpenDoor]:
    port = int(free_endpoint().rpartition(":")[2])
    given = (f"door.port={port}", f"door.folder={json.dumps(str(folder / 'tokens'))}", *settings)
    config = read(roster.complete(), settings=given, defaults=("simulation.human=attentive",))
    names = (*roster.ROBOT, "simulation", "door")
    async with embedding.in_memory(config, embedding.services(config, *names)):
        yield OpenDoor(port, folder / "tokens")


async def test_pythons_own_http_client_drives_the_robot_and_hears_its_words(tmp_path: Path) -> None:
    async with open_door(tmp_path) as door:
        arguments = ("127.0.0.1", str(door.port), str(door.tokens / "manager"))
        piped = asyncio.subprocess.PIPE
        program = await asyncio.create_subprocess_exec(
            sys.executable, "-I", str(EXAMPLE), *arguments, stdout=piped, stderr=piped
        )
        said, wrong = await asyncio.wait_for(program.communicate(), 60)

    first, *words = said.decode().splitlines()
    assert wrong.decode() == ""
    assert json.loads(first)["status"] == "done"
    assert json.loads(first)["said"].startswith("Please take the")
    assert words == ["Thank", "you."]


async def test_a_program_with_websockets_writes_a_turn_stops_it_and_knows_what_was_said(tmp_path: Path) -> None:
    async with open_door(tmp_path) as door, door.session() as session, session.ws_connect("/v1/speak") as link:
        for piece in ("Hello there. ", "Please take [blue-", "square] and put it down, next to the others."):
            await link.send_json({"do": "text", "text": piece})
        words = []
        async for message in link:
            news = json.loads(message.data)
            words += [news["word"]] if news["type"] == "word" else []
            if len(words) == 3 and news["type"] == "word":
                await link.send_json({"do": "stop"})
            if news["type"] == "over":
                break

    assert news["summary"]["status"] == "interrupted"
    assert news["summary"]["cut_short"]
    assert news["summary"]["said"].split() == words
    assert words[:3] == ["Hello", "there.", "Please"]


async def test_a_stranger_gets_nothing_and_what_is_too_large_is_refused(tmp_path: Path) -> None:
    async with open_door(tmp_path) as door, aiohttp.ClientSession(f"http://127.0.0.1:{door.port}") as stranger:
        paths = ("/v1/world", "/v1/openapi.json", "/v1/news", "/v1/world?token=guessed")
        codes = []
        for path in paths:
            async with stranger.get(path) as refused:
                codes.append(refused.status)
        async with stranger.ws_connect("/v1/news") as link:
            closed = await link.receive()
        async with stranger.post("/v1/turn", data=BytesIO(b"x" * 1048577), headers=door.headers()) as large:
            told = await large.json()
        async with stranger.ws_connect("/v1/speak", headers=door.headers()) as link:
            await link.send_str("x" * 70000)
            ended = await link.receive()
        async with stranger.options("/v1/turn", headers={
            "origin": "http://page.example", "access-control-request-method": "POST",
            "access-control-request-headers": "authorization,content-type",
        }) as asked:  # fmt: skip
            allowed = asked.headers["access-control-allow-origin"]
        async with stranger.get("/v1/world", headers=door.headers("observer")) as world:
            seen = world.status

    assert codes == [401] * 4
    assert (closed.type, closed.data) == (aiohttp.WSMsgType.CLOSE, 4401)
    assert (large.status, told["fault"]["reason"]) == (413, "1048577 bytes; at most 1048576 are taken")
    assert (ended.type, ended.data) == (aiohttp.WSMsgType.CLOSE, 1009)
    assert (allowed, seen) == ("*", 200)


async def test_tokens_stay_and_a_port_that_is_taken_or_a_folder_that_cannot_be_is_told(tmp_path: Path) -> None:
    async with open_door(tmp_path) as door:
        before = {each.name: each.read_text() for each in door.tokens.iterdir()}
        with pytest.raises(RunFailed, match=f"127.0.0.1:{door.port}: Address already in use"):
            async with open_door(tmp_path, f"door.port={door.port}"):
                pass
    async with open_door(tmp_path) as door:
        assert {each.name: each.read_text() for each in door.tokens.iterdir()} == before
    (tmp_path / "file").write_text("")
    with pytest.raises(InputRefused, match="cannot be made"):
        async with open_door(tmp_path, f"door.folder={json.dumps(str(tmp_path / 'file'))}"):
            pass

    assert {*before} == {"observer", "manager"}
