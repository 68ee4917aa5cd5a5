"""A conversation over real sockets: the example of ten lines, and servers that refuse, cut off, or offer tools."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import pytest
from aiohttp import web

from engage_hri import InputRefused, RunFailed, embedded, perceive
from engage_hri import connect as connected
from engage_hri.services.client.conversation.dialects import Finished, ModelFailed, TextBit
from engage_hri.services.client.conversation.models import model_of
from engage_hri.services.client.conversation.tools import McpServer, opened
from tests.client.conversation.servers import STREAMS, Script
from tests.test_examples import example

pytestmark = pytest.mark.real_time
PATHS = {"openai": "/v1/chat/completions", "anthropic": "/v1/messages", "ollama": "/api/chat"}
BASES = {"openai": "/v1", "anthropic": "", "ollama": ""}


class Server:
    """A server of models. asked, headers: of the requests. answers: what each gets: a script, or a status."""

    def __init__(self, form: str, *answers: Script | int) -> None:
        self.asked: list[dict[str, Any]] = []
        self.headers: list[dict[str, str]] = []
        self._form = form
        self._answers = iter(answers)

    async def _answer(self, request: web.Request) -> web.StreamResponse:
        self.asked.append(await request.json())
        self.headers.append(dict(request.headers))
        answer = next(self._answers)
        if isinstance(answer, int):
            return web.Response(status=answer, text=f"no, {request.headers.get('Authorization')}")
        response = web.StreamResponse()
        await response.prepare(request)
        for chunk in STREAMS[self._form](answer):
            await response.write(chunk)
        return response

    @asynccontextmanager
    async def runs(self) -> AsyncIterator[str]:
        app = web.Application()
        app.router.add_post(PATHS[self._form], self._answer)
        runner = web.AppRunner(app)
        await runner.setup()
        try:
            site = web.TCPSite(runner, "127.0.0.1", 0)
            await site.start()
            (_, port), *_ = runner.addresses
            yield f"{self._form}:m@http://127.0.0.1:{port}{BASES[self._form]}"
        finally:
            await runner.cleanup()


@pytest.mark.parametrize("form", STREAMS)
async def test_the_example_of_ten_lines_talks_with_a_tool_of_its_own(
    form: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    manager = example("conversation")
    parts = [{"say": "It is warm."}, {"refer": "red-square"}]
    ours = ("perform_turn_fragment", {"turn_status": "full", "parts": parts})
    server = Server(form, (("weather", {"city": "Ulm"}),), (ours,))
    async with (
        server.runs() as model,
        embedded(human="none") as robot,
        perceive("ann", hub=robot.hub) as ann,
    ):
        monkeypatch.setattr(manager, "connect", lambda connect: connected(hub=robot.hub))
        talking = asyncio.create_task(manager.main(model))
        with robot.turns() as turns:
            await ann.look_at(robot.id)
            await ann.say("Is it warm in Ulm?", delay=0.1)
            async with asyncio.timeout(30):
                await turns.next()
        talking.cancel()
        await asyncio.wait([talking])

    printed = capsys.readouterr().out
    assert "PersonSaid(who='ann', text='Is it warm in Ulm?'" in printed
    assert "Sun in Ulm, 21 degrees." in printed
    assert "said='It is warm. the red square'" in printed
    assert len(server.asked) == 2


async def test_a_server_that_is_busy_is_asked_again_and_one_that_refuses_is_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("engage_hri.services.client.conversation.models.PAUSES", (0.01, 0.01))
    monkeypatch.setenv("ENGAGE_MODEL_KEY", "sk-secret")
    busy, refusing = Server("openai", 503, 429, ("Hello.",)), Server("openai", 401)
    async with busy.runs() as one, refusing.runs() as other:
        async with model_of(one) as model:
            bits = [bit async for bit in model.reply("", (), ())]
        async with model_of(other) as model:
            with pytest.raises(ModelFailed, match=r"401: no, Bearer \*\*\*") as refused:
                _ = [bit async for bit in model.reply("", (), ())]

    assert "".join(bit.text for bit in bits if isinstance(bit, TextBit)) == "Hello."
    assert isinstance(bits[-1], Finished)
    assert (len(busy.asked), len(refusing.asked)) == (3, 1)
    assert busy.headers[0]["Authorization"] == "Bearer sk-secret"
    assert "sk-secret" not in str(refused.value)


async def test_a_server_that_is_not_there_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("engage_hri.services.client.conversation.models.PAUSES", ())
    async with model_of("http://127.0.0.1:9/v1#m") as model:
        with pytest.raises(ModelFailed, match="cannot be reached"):
            _ = [bit async for bit in model.reply("", (), ())]


async def test_tools_of_an_mcp_server_stand_beside_functions() -> None:
    mcp = pytest.importorskip("mcp.server.mcpserver", reason="needs the extra `mcp`")
    server = mcp.MCPServer("numbers")

    @server.tool()
    def add(a: int, b: int) -> int:
        """Add two numbers."""
        if a < 0:
            raise ValueError("too small")
        return a + b

    def twice(text: str, times: int = 2) -> list[str]:
        """Say it twice."""
        return [text] * times

    async with opened([McpServer(server), twice]) as tools:
        assert sorted(tools) == ["add", "twice"]
        assert tools["add"].form.description == "Add two numbers."
        assert sorted(tools["add"].form.schema["properties"]) == ["a", "b"]
        assert await tools["add"].call({"a": 2, "b": 3}) == "5"
        assert (await tools["add"].call({"a": -1, "b": 3})).startswith("error: ")
        assert tools["twice"].form.schema["required"] == ["text"]
        assert await tools["twice"].call({"text": "x"}) == '["x","x"]'
    with pytest.raises(InputRefused, match="two tools have this name"):
        async with opened([twice, twice]):
            pass
    with pytest.raises(InputRefused, match="no tool"):
        async with opened([lambda x: x]):
            pass
    with pytest.raises(RunFailed, match="cannot be reached"):
        async with opened([McpServer(("no-such-program",))]):
            pass
