"""Stand-ins for servers of models: what they stream, as the documentation of each API has it."""

import asyncio
import json
import random
from collections.abc import AsyncGenerator, Sequence
from itertools import pairwise
from typing import Any

from engage_hri.services.client.conversation.dialects import DIALECTS, Dialect
from engage_hri.services.client.conversation.models import EndpointModel

Script = Sequence[str | tuple[str, dict[str, Any]]]
"""An answer: texts, and calls of tools by name and arguments."""
TOKEN = 4
"""Letters of a token."""


def tokens(text: str) -> list[str]:
    return [text[at : at + TOKEN] for at in range(0, len(text), TOKEN)]


def _data(told: object, name: str = "") -> bytes:
    event = f"event: {name}\n" if name else ""
    return f"{event}data: {json.dumps(told, ensure_ascii=False)}\n\n".encode()


def openai(script: Script) -> list[bytes]:
    def chunk(delta: dict[str, Any], finish: str | None = None) -> bytes:
        choice = {"index": 0, "delta": delta, "finish_reason": finish}
        return _data({"id": "c-1", "object": "chat.completion.chunk", "model": "m", "choices": [choice]})

    told, calls = [chunk({"role": "assistant", "content": ""})], 0
    for each in script:
        if isinstance(each, str):
            told += [chunk({"content": token}) for token in tokens(each)]
            continue
        name, given = each
        call = {
            "index": calls,
            "id": f"call-{calls}",
            "type": "function",
            "function": {"name": name, "arguments": ""},
        }
        told.append(chunk({"tool_calls": [call]}))
        for token in tokens(json.dumps(given, ensure_ascii=False)):
            told.append(chunk({"tool_calls": [{"index": calls, "function": {"arguments": token}}]}))
        calls += 1
    usage = _data({"id": "c-1", "object": "chat.completion.chunk", "model": "m", "choices": [], "usage": {}})
    return [*told, chunk({}, "tool_calls" if calls else "stop"), usage, b"data: [DONE]\n\n"]


def anthropic(script: Script) -> list[bytes]:
    def event(**told: Any) -> bytes:
        return _data(told, told["type"])

    told = [event(type="message_start", message={"id": "m", "role": "assistant", "content": []}), event(type="ping")]
    for number, each in enumerate(script):
        if isinstance(each, str):
            block, deltas = {"type": "text", "text": ""}, [{"type": "text_delta", "text": it} for it in tokens(each)]
        else:
            name, given = each
            block = {"type": "tool_use", "id": f"toolu-{number}", "name": name, "input": {}}
            written = ["", *tokens(json.dumps(given, ensure_ascii=False))]
            deltas = [{"type": "input_json_delta", "partial_json": it} for it in written]
        told.append(event(type="content_block_start", index=number, content_block=block))
        told += [event(type="content_block_delta", index=number, delta=delta) for delta in deltas]
        told.append(event(type="content_block_stop", index=number))
    stop = "tool_use" if any(not isinstance(each, str) for each in script) else "end_turn"
    return [*told, event(type="message_delta", delta={"stop_reason": stop}, usage={}), event(type="message_stop")]


def ollama(script: Script) -> list[bytes]:
    def line(message: dict[str, Any], *, done: bool = False) -> bytes:
        told = {"model": "m", "created_at": "now", "message": {"role": "assistant", **message}, "done": done}
        return f"{json.dumps(told, ensure_ascii=False)}\n".encode()

    told = []
    for each in script:
        if isinstance(each, str):
            told += [line({"content": token}) for token in tokens(each)]
        else:
            call = {"function": {"name": each[0], "arguments": each[1]}}
            told.append(line({"content": "", "tool_calls": [call]}))
    return [*told, line({"content": ""}, done=True)]


STREAMS = {"openai": openai, "anthropic": anthropic, "ollama": ollama}


class Written(EndpointModel):
    """A model whose server is a script: the bytes of an answer, one token after the other, cut anywhere.

    asked: the bodies of the requests. seconds: that a token takes. Each answer is the next of the script.
    """

    def __init__(
        self,
        scripts: Sequence[Script],
        form: str = "openai",
        seconds: float = 0.04,
        chance: random.Random | None = None,
    ) -> None:
        super().__init__(DIALECTS[form], "m")
        self.asked: list[dict[str, Any]] = []
        self.first_at = 0.0
        self.sent: list[bytes] = []
        self._scripts = iter(scripts)
        self._form = form
        self._seconds = seconds
        self._chance = chance

    async def _bytes(self, body: dict[str, Any]) -> AsyncGenerator[bytes, None]:
        self.asked.append(body)
        chunks = STREAMS[self._form](next(self._scripts, ("I have nothing more to say.",)))
        if self._chance is not None:
            chunks = cut(b"".join(chunks), self._chance)
        self.sent = chunks
        self.first_at = asyncio.get_running_loop().time() + self._seconds
        for chunk in chunks:
            await asyncio.sleep(self._seconds)
            yield chunk


def cut(data: bytes, chance: random.Random) -> list[bytes]:
    """The same bytes in pieces of random length."""
    places = sorted({0, len(data), *(chance.randrange(len(data) + 1) for _ in range(chance.choice((0, 3, 40, 400))))})
    return [data[begin:end] for begin, end in pairwise(places)]


def dialect(form: str) -> Dialect:
    return DIALECTS[form]()
