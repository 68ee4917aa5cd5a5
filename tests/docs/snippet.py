"""Run the Python of a page, as it stands there: `.venv/bin/python snippet.py FILE [NAME...]`, until Ctrl-C.

`await` may stand at the top level. NAME: what the page leaves to its reader, made here.
"""

import ast
import asyncio
import sys
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, suppress
from inspect import CO_COROUTINE
from pathlib import Path
from types import CodeType, SimpleNamespace
from typing import Any

from engage_hri.services.client.robot import connect

CALL = {"turn_status": "full", "parts": [{"say": "Do you see"}, {"refer": "blue-square"}]}


class Model:
    """Stands in for the client of a language model: it makes one call of the tool, and is content."""

    def __init__(self) -> None:
        self.messages = self
        self.results: list[Any] = []

    async def create(self, *, tools: list[Any], messages: list[Any], **_: Any) -> SimpleNamespace:
        assert [tool["name"] for tool in tools] == ["perform_turn_fragment"]
        if messages and messages[-1]["role"] == "user":
            print(messages[-1]["content"][0]["content"], flush=True)
            return SimpleNamespace(content=[SimpleNamespace(type="text", text="Good.")])
        return SimpleNamespace(content=[SimpleNamespace(type="tool_use", id="call-1", input=CALL)])


async def text_deltas() -> AsyncIterator[str]:
    for bit in ("Hello! Do", " you see", " [blue-sq", "uare]?"):
        await asyncio.sleep(0)
        yield bit


async def given(name: str, stack: AsyncExitStack) -> Any:
    match name:
        case "robot":
            return await stack.enter_async_context(connect())
        case "text_deltas":
            return text_deltas()
        case "client":
            return Model()
        case "MODEL":
            return "a-model"
        case "messages":
            return []
    raise NameError(f"the page does not say what {name!r} is")


async def main(code: CodeType, names: list[str]) -> None:
    async with AsyncExitStack() as stack:
        await eval(code, {name: await given(name, stack) for name in names})


if __name__ == "__main__":
    with suppress(KeyboardInterrupt):
        path, *names = sys.argv[1:]
        snippet = compile(Path(path).read_text(), path, "exec", flags=ast.PyCF_ALLOW_TOP_LEVEL_AWAIT)
        if snippet.co_flags & CO_COROUTINE:
            asyncio.run(main(snippet, names))
        else:
            exec(snippet, {})
