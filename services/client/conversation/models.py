"""Models that lead a conversation: a server that streams, by its name or address, or a function of this program."""

import asyncio
import os
import re
from abc import ABC, abstractmethod
from collections.abc import AsyncGenerator, AsyncIterator, Awaitable, Callable, Sequence
from contextlib import aclosing
from typing import Any, Self

from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.units import Seconds
from engage_hri.services.client.conversation.dialects import (
    DIALECTS,
    Bit,
    Dialect,
    Finished,
    ModelFailed,
    TextBit,
    ToolForm,
)
from engage_hri.services.client.conversation.history import Entry, messages
from engage_hri.services.client.conversation.wire import Frames
from engage_hri.services.runtime.installation import extra_command

KEY = "ENGAGE_MODEL_KEY"
"""Variable with the key of a server that is not the one of who has made the form."""
PAUSES: tuple[Seconds, ...] = (0.5, 2.0)
"""Pauses before a request is sent again of which no answer has begun. Nobody waits longer for a robot to speak."""
FIRST_BIT: Seconds = 30.0
"""Time for which a server may be silent."""


Bits = AsyncGenerator[Bit, None]


class Model(ABC):
    """Whatever writes the robot's part of a conversation."""

    @abstractmethod
    def reply(self, prompt: str, history: Sequence[Entry], tools: Sequence[ToolForm]) -> Bits:
        """Write the robot's next message, bit by bit. Raises ModelFailed.

        prompt: what it is told of its part. history: so far. tools: that it may call.
        """

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *raised: object) -> None:
        return


Answering = Callable[[Sequence[Entry]], str | Awaitable[str] | AsyncIterator[str]]


class FunctionModel(Model):
    """A function of the history: it returns what the robot says, or yields it. It needs no network."""

    def __init__(self, function: Answering) -> None:
        self._function = function

    async def reply(self, prompt: str, history: Sequence[Entry], tools: Sequence[ToolForm]) -> Bits:
        """Write the robot's next message."""
        try:
            answer = self._function(history)
            if isinstance(answer, AsyncIterator):
                async for text in answer:
                    yield TextBit(text)
            else:
                yield TextBit(answer if isinstance(answer, str) else await answer)
        except Exception as error:  # as with a server: the robot says so, and the talk goes on
            raise ModelFailed(Fault(reason=f"the function of the model has failed: {error!r}")) from error
        yield Finished()


class EndpointModel(Model):
    """A model on a server. Needs the extra `models`.

    dialect: the form that the server speaks. name: of the model there. address: of the server; empty: that of who has
    made the form, whose key is in its own variable. The key of any other server is in `ENGAGE_MODEL_KEY`.
    """

    def __init__(self, dialect: type[Dialect], name: str, address: str = "") -> None:
        self.name = name
        self._dialect = dialect
        self._url = f"{(address or dialect.address).rstrip('/')}{dialect.path}"
        self._key = os.environ.get(KEY, "") if address else os.environ.get(dialect.key, "") if dialect.key else ""
        self._session: Any = None

    async def reply(self, prompt: str, history: Sequence[Entry], tools: Sequence[ToolForm]) -> Bits:
        """Write the robot's next message. A request of which no answer begins is sent again, twice."""
        body = self._dialect().body(self.name, prompt, messages(history), tools)
        for pause in (*PAUSES, None):
            has_begun = False
            try:
                async with aclosing(self._answer(body)) as bits:
                    async for bit in bits:
                        has_begun = True
                        yield bit
                return
            except ModelFailed as failed:
                if has_begun or pause is None or not failed.may_retry:
                    raise
            await asyncio.sleep(pause)

    async def _answer(self, body: dict[str, Any]) -> Bits:
        frames, dialect = Frames(self._dialect.framing), self._dialect()
        is_finished = False
        async with aclosing(self._bytes(body)) as chunks:
            async for data in chunks:
                for event in frames.feed(data):
                    for bit in dialect.read(event):
                        is_finished |= isinstance(bit, Finished)
                        yield bit
        for event in frames.end():
            for bit in dialect.read(event):
                is_finished |= isinstance(bit, Finished)
                yield bit
        if not is_finished:
            raise ModelFailed(Fault(reason="the answer of the model's server was cut off", where=self._url))

    async def _bytes(self, body: dict[str, Any]) -> AsyncGenerator[bytes, None]:
        import aiohttp

        try:
            headers = self._dialect().headers(self._key)
            async with self._session.post(self._url, json=body, headers=headers) as response:
                if response.status >= 400:
                    said = (await response.text(errors="replace"))[:300]
                    reason = self._without_key(f"the model's server says {response.status}: {said}")
                    may_retry = response.status in (408, 409, 425, 429) or response.status >= 500
                    raise ModelFailed(Fault(reason=reason, where=self._url), may_retry=may_retry)
                async for data in response.content.iter_any():
                    yield data
        except (aiohttp.ClientError, OSError, TimeoutError) as error:
            reason = self._without_key(f"the model's server cannot be reached: {str(error) or error!r:.200}")
            raise ModelFailed(Fault(reason=reason, where=self._url)) from None

    def _without_key(self, text: str) -> str:
        return text.replace(self._key, "***") if self._key else text

    async def __aenter__(self) -> Self:
        try:
            import aiohttp
        except ImportError as error:
            fault = Fault(reason="the library `aiohttp` is not installed", advice=extra_command("models"))
            raise InputRefused(fault) from error
        timeout = aiohttp.ClientTimeout(total=None, sock_connect=10.0, sock_read=FIRST_BIT)
        self._session = aiohttp.ClientSession(timeout=timeout, trust_env=True)
        return self

    async def __aexit__(self, *raised: object) -> None:
        await self._session.close()


_NAMED = re.compile(rf"(?P<dialect>{'|'.join(DIALECTS)}):(?P<name>[^@]+)(?:@(?P<address>https?://\S+))?")
_ADDRESS = re.compile(r"(?P<address>https?://[^\s#]+)(?:#(?P<name>.+))?")


def model_of(given: Model | Answering | str) -> Model:
    """Find the model of a name, an address or a function. Raises InputRefused.

    given: `openai:NAME`, `anthropic:NAME`, `ollama:NAME`, each also with `@ADDRESS` of another server that speaks
    so; or an address alone, of one that speaks as OpenAI's does: `http://127.0.0.1:8000/v1#NAME`.
    """
    if isinstance(given, Model):
        return given
    if not isinstance(given, str):
        if callable(given):
            return FunctionModel(given)
        raise InputRefused(Fault(reason=f"{given!r:.60} is no model", advice="a name, an address, or a function"))
    if found := _NAMED.fullmatch(given):
        return EndpointModel(DIALECTS[found["dialect"]], found["name"], found["address"] or "")
    if found := _ADDRESS.fullmatch(given):
        return EndpointModel(DIALECTS["openai"], found["name"] or "default", found["address"])
    advice = (
        "openai:NAME, anthropic:NAME or ollama:NAME, with @ADDRESS of another server; or http://HOST:PORT/v1#NAME"
    )
    raise InputRefused(Fault(reason="this names no model", where=given, advice=advice))
