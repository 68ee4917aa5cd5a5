"""Forms in which models are asked and answer: OpenAI's Chat Completions, Anthropic's Messages, Ollama's chat. Pure.

Each turns a history into the body of a request, and what is streamed back into bits: text, and bits of the JSON of
tool calls. What a model thinks before it speaks is left out.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, ClassVar

import msgspec
from msgspec import Struct

from engage_hri.schemas.faults import EngageError, Fault
from engage_hri.services.client.conversation.history import Spoken, ToolCall
from engage_hri.services.client.conversation.wire import Framing


class ToolForm(Struct, frozen=True, kw_only=True):
    """A tool as a model is told of it.

    name: by which it is called. description: of what it does. schema: of its arguments, JSON Schema.
    """

    name: str
    description: str
    schema: dict[str, Any]


class TextBit(Struct, frozen=True):
    """A bit of the text of an answer.

    text: however short.
    """

    text: str


class CallBit(Struct, frozen=True):
    """A bit of a tool call.

    number: of the call, to count from 0 in this answer. id, name: with its first bit, else empty.
    json: more of its arguments.
    """

    number: int
    id: str = ""
    name: str = ""
    json: str = ""


class Finished(Struct, frozen=True):
    """The answer is complete: nothing of it is missing."""


Bit = TextBit | CallBit | Finished


class ModelFailed(EngageError):
    """A model has given no answer, or not all of it. may_retry: another try may have one."""

    def __init__(self, fault: Fault, *, may_retry: bool = True) -> None:
        super().__init__(fault)
        self.may_retry = may_retry


class Dialect(ABC):
    """A form, as it reads one answer.

    address: of the servers of who has made it. path: of requests. key: variable that holds the key of those.
    """

    name: ClassVar[str]
    address: ClassVar[str]
    path: ClassVar[str]
    key: ClassVar[str] = ""
    framing: ClassVar[Framing] = "events"

    def headers(self, key: str) -> dict[str, str]:
        """Headers of a request. key: empty: there is none."""
        return {"Authorization": f"Bearer {key}"} if key else {}

    @abstractmethod
    def body(self, model: str, prompt: str, history: Sequence[Spoken], tools: Sequence[ToolForm]) -> dict[str, Any]:
        """Body of a request for a streamed answer."""

    def read(self, event: str) -> Iterator[Bit]:
        """Read one event. Raises ModelFailed: it tells of an error, or cannot be read."""
        if event.strip() == "[DONE]":
            yield Finished()
            return
        try:
            told = msgspec.json.decode(event)
            if error := told.get("error"):
                what = error.get("message", error) if isinstance(error, dict) else error
                raise ModelFailed(Fault(reason=f"the model's server says: {what}"))
            yield from self._bits(told)
        except (msgspec.DecodeError, AttributeError, KeyError, TypeError, IndexError) as error:
            raise ModelFailed(Fault(reason=f"what the model's server says is not read: {event[:80]!r}")) from error

    @abstractmethod
    def _bits(self, told: dict[str, Any]) -> Iterable[Bit]: ...


class OpenAi(Dialect):
    """Chat Completions, which most other servers speak as well."""

    name = "openai"
    address = "https://api.openai.com/v1"
    path = "/chat/completions"
    key = "OPENAI_API_KEY"

    def body(self, model: str, prompt: str, history: Sequence[Spoken], tools: Sequence[ToolForm]) -> dict[str, Any]:
        """Body of a request for a streamed answer."""
        body = {"model": model, "stream": True, "messages": [*_system(prompt), *_chat(history, self._call)]}
        return {**body, "tools": [_function(each) for each in tools]} if tools else body

    def _call(self, call: ToolCall) -> dict[str, Any]:
        return {
            "id": call.id, "type": "function", "function": {"name": call.name, "arguments": call.arguments or "{}"},
        }  # fmt: skip

    def _bits(self, told: dict[str, Any]) -> Iterable[Bit]:
        for choice in told.get("choices") or ():
            delta = choice.get("delta") or {}
            if text := delta.get("content"):
                yield TextBit(text)
            for place, call in enumerate(delta.get("tool_calls") or ()):
                made = call.get("function") or {}
                number = call.get("index", place)
                yield CallBit(number, call.get("id") or "", made.get("name") or "", made.get("arguments") or "")
            if choice.get("finish_reason"):
                yield Finished()


class Anthropic(Dialect):
    """Messages."""

    name = "anthropic"
    address = "https://api.anthropic.com"
    path = "/v1/messages"
    key = "ANTHROPIC_API_KEY"
    MOST_TOKENS: ClassVar[int] = 1024
    """Length of one answer: five minutes of speech."""

    def headers(self, key: str) -> dict[str, str]:
        """Headers of a request. key: empty: there is none."""
        return {"anthropic-version": "2023-06-01"} | ({"x-api-key": key} if key else {})

    def body(self, model: str, prompt: str, history: Sequence[Spoken], tools: Sequence[ToolForm]) -> dict[str, Any]:
        """Body of a request for a streamed answer."""
        told: list[dict[str, Any]] = []
        for each in history:
            content: list[dict[str, Any]] = []
            if each.role == "results":
                content += [
                    {"type": "tool_result", "tool_use_id": call.id, "content": call.result} for call in each.calls
                ]
            elif each.text.strip():
                content.append({"type": "text", "text": each.text})
            if each.role == "assistant":
                for call in each.calls:
                    given = read_arguments(call.arguments)
                    content.append({"type": "tool_use", "id": call.id, "name": call.name, "input": given})
            role = "assistant" if each.role == "assistant" else "user"
            if told and told[-1]["role"] == role:
                told[-1]["content"] += content
            elif content:
                told.append({"role": role, "content": content})
        body: dict[str, Any] = {
            "model": model, "max_tokens": self.MOST_TOKENS, "stream": True, "messages": told,
        }  # fmt: skip
        if prompt:
            body["system"] = prompt
        if tools:
            body["tools"] = [
                {"name": each.name, "description": each.description, "input_schema": each.schema} for each in tools
            ]
        return body

    def _bits(self, told: dict[str, Any]) -> Iterable[Bit]:
        match told:
            case {"type": "content_block_start", "index": number, "content_block": {"type": "tool_use"} as block}:
                yield CallBit(number, block.get("id", ""), block.get("name", ""))
            case {"type": "content_block_start", "content_block": {"type": "text", "text": str(text)}} if text:
                yield TextBit(text)
            case {"type": "content_block_delta", "delta": {"type": "text_delta", "text": str(text)}}:
                yield TextBit(text)
            case {
                "type": "content_block_delta",
                "index": number,
                "delta": {"type": "input_json_delta", "partial_json": str(json)},
            }:
                yield CallBit(number, json=json)
            case {"type": "message_stop"}:
                yield Finished()


class Ollama(Dialect):
    """Chat of Ollama itself, a JSON object a line. Tool calls come whole."""

    name = "ollama"
    address = "http://127.0.0.1:11434"
    path = "/api/chat"
    framing = "lines"

    def __init__(self) -> None:
        self._calls = 0
        """Number of calls so far: each message of an answer counts its own from 0."""

    def body(self, model: str, prompt: str, history: Sequence[Spoken], tools: Sequence[ToolForm]) -> dict[str, Any]:
        """Body of a request for a streamed answer."""
        told = [*_system(prompt), *_chat(history, self._call)]
        body = {"model": model, "stream": True, "messages": told}
        return {**body, "tools": [_function(each) for each in tools]} if tools else body

    def _call(self, call: ToolCall) -> dict[str, Any]:
        return {"function": {"name": call.name, "arguments": read_arguments(call.arguments)}}

    def _bits(self, told: dict[str, Any]) -> Iterable[Bit]:
        message = told.get("message") or {}
        if text := message.get("content"):
            yield TextBit(text)
        for call in message.get("tool_calls") or ():
            made = call["function"]
            given = msgspec.json.encode(made.get("arguments") or {}).decode()
            yield CallBit(self._calls, call.get("id") or "", made["name"], given)
            self._calls += 1
        if told.get("done"):
            yield Finished()


DIALECTS: dict[str, type[Dialect]] = {each.name: each for each in (OpenAi, Anthropic, Ollama)}


def read_arguments(json: str) -> dict[str, Any]:
    """The arguments of a call as an object; of what is none, nothing."""
    try:
        given = msgspec.json.decode(json or "{}")
    except msgspec.DecodeError:
        return {}
    return given if isinstance(given, dict) else {}


def _system(prompt: str) -> list[dict[str, Any]]:
    return [{"role": "system", "content": prompt}] if prompt else []


def _chat(history: Sequence[Spoken], call: Any) -> Iterator[dict[str, Any]]:
    for each in history:
        if each.role == "results":
            for made in each.calls:
                yield {"role": "tool", "tool_call_id": made.id, "tool_name": made.name, "content": made.result}
        else:
            calls = {"tool_calls": [call(made) for made in each.calls]} if each.calls else {}
            yield {"role": each.role, "content": each.text, **calls}


def _function(tool: ToolForm) -> dict[str, Any]:
    return {
        "type": "function",
        "function": {"name": tool.name, "description": tool.description, "parameters": tool.schema},
    }
