"""Tools that a model may call: functions of this program, and what MCP servers offer."""

import inspect
import logging
import shlex
from collections.abc import AsyncIterator, Awaitable, Callable, Iterable, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass
from time import monotonic
from typing import Any, get_type_hints

import msgspec

from engage_hri.schemas.faults import Fault, InputRefused, RunFailed
from engage_hri.schemas.units import Seconds
from engage_hri.services.client.conversation.dialects import ToolForm
from engage_hri.services.runtime.installation import extra_command

HELD: Seconds = 0.5
"""Time of one call of a tool from which on it is told: meanwhile the robot hears and says nothing."""
ADVICE = "make it `async def` with a library that awaits, or call it by `await asyncio.to_thread(...)`"
_log = logging.getLogger("engage.client")


@dataclass(frozen=True)
class ConversationTool:
    """A tool. form: as a model is told of it. call: takes decoded arguments, and returns what the model is told."""

    form: ToolForm
    call: Callable[[dict[str, Any]], Awaitable[str]]


@dataclass(frozen=True)
class McpServer:
    """A server of the Model Context Protocol, whose tools a model may call. Needs the extra `mcp`.

    server: its address, `http://127.0.0.1:8000/mcp`; or a command that starts it and is spoken to by its input and
    output, as `("python", "server.py")`; or a server object of the library `mcp`, in this process.
    """

    server: Any

    @asynccontextmanager
    async def tools(self) -> AsyncIterator[Sequence[ConversationTool]]:
        """Connect until the end of `async with`; yields the tools that it offers.

        Raises:
            InputRefused: the library `mcp` is not installed.
            RunFailed: it cannot be reached.
        """
        try:
            from mcp import Client, StdioServerParameters
        except ImportError as error:
            fault = Fault(reason="the library `mcp` is not installed", advice=extra_command("mcp"))
            raise InputRefused(fault) from error
        server = self.server
        if isinstance(server, tuple | list):
            server = StdioServerParameters(command=server[0], args=list(server[1:]))
        async with AsyncExitStack() as stack:
            try:
                client = await stack.enter_async_context(Client(server))
                listed = (await client.list_tools()).tools
            except Exception as error:
                fault = Fault(reason=f"the MCP server {self.server!r} cannot be reached: {error!r}")
                raise RunFailed(fault) from error
            yield [_offered(client, each) for each in listed]


def _offered(client: Any, tool: Any) -> ConversationTool:
    async def call(arguments: dict[str, Any]) -> str:
        result = await client.call_tool(tool.name, arguments)
        texts = [each.text for each in result.content if getattr(each, "type", "") == "text"]
        told = "\n".join(texts) or msgspec.json.encode(result.structured_content).decode()
        return f"error: {told}" if result.is_error else told

    form = ToolForm(name=tool.name, description=tool.description or "", schema=tool.input_schema)
    return ConversationTool(form, call)


def function_tool(function: Callable[..., Any]) -> ConversationTool:
    """Make a tool of a function: its name, its docstring, and its parameters with their types.

    function: `async`, or one that returns at once: all of the program waits for it.

    Raises:
        InputRefused: a parameter has no type, or one that JSON does not have.
    """
    name = getattr(function, "__name__", type(function).__name__)
    try:
        hints = get_type_hints(function, include_extras=True)
        fields = [
            (each.name, hints[each.name])
            if each.default is each.empty
            else (each.name, hints[each.name], each.default)
            for each in inspect.signature(function).parameters.values()
        ]
        struct = msgspec.defstruct(name, fields, kw_only=True, forbid_unknown_fields=True)
        (_,), components = msgspec.json.schema_components((struct,), ref_template="#/$defs/{name}")
    except (KeyError, TypeError, NameError, ValueError) as error:
        advice = "`async def weather(city: str) -> str`, each parameter with a type that JSON has"
        raise InputRefused(Fault(reason=f"no tool: {error!r}", where=name, advice=advice)) from error
    own = components.pop(name)
    schema = {key: own[key] for key in ("type", "properties", "required") if key in own}
    if components:
        schema["$defs"] = components

    async def call(arguments: dict[str, Any]) -> str:
        given = msgspec.convert(arguments, struct)
        since = monotonic()
        told = function(**{each: getattr(given, each) for each in struct.__struct_fields__})
        if (held := monotonic() - since) > HELD:
            _log.warning("the tool %s has held up the whole program for %.1f s: %s", name, held, ADVICE)
        told = await told if inspect.isawaitable(told) else told
        return told if isinstance(told, str) else msgspec.json.encode(told).decode()

    return ConversationTool(ToolForm(name=name, description=inspect.getdoc(function) or "", schema=schema), call)


ToolSource = Callable[..., Any] | ConversationTool | McpServer


@asynccontextmanager
async def opened(sources: Iterable[ToolSource]) -> AsyncIterator[dict[str, ConversationTool]]:
    """Open tools, until the end of `async with`; yields them by name.

    Raises InputRefused: two have one name, or one is no tool; RunFailed: a server cannot be reached.
    """
    async with AsyncExitStack() as stack:
        tools: dict[str, ConversationTool] = {}
        for source in sources:
            found: Sequence[ConversationTool]
            if isinstance(source, McpServer):
                found = await stack.enter_async_context(source.tools())
            else:
                found = [source if isinstance(source, ConversationTool) else function_tool(source)]
            for tool in found:
                if tool.form.name in tools:
                    raise InputRefused(Fault(reason="two tools have this name", where=tool.form.name))
                tools[tool.form.name] = tool
        yield tools


def server_of(text: str) -> McpServer:
    """Make a server of what stands on a command line: an address, or a command."""
    return McpServer(text if text.startswith(("http://", "https://")) else tuple(shlex.split(text)))
