"""A realtime speech API on this machine: the events of OpenAI's documentation, and what it says becomes of each.

It keeps a conversation as the API does: text, or audio with its transcript, which goes when the audio is truncated.
"""

import asyncio
import base64
import json
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from itertools import count
from typing import Any

from aiohttp import WSMsgType, web

MS_OF_A_LETTER = 60


class StandIn:
    """An API that answers each `response.create` with the next reply.

    replies: the bits in which it writes each. is_audio: as audio with a transcript. pause: seconds between two bits.
    """

    def __init__(self, replies: Sequence[Sequence[str]], *, is_audio: bool = False, pause: float = 0.05) -> None:
        self.replies = [*replies]
        self.is_audio = is_audio
        self.pause = pause
        self.items: list[dict[str, Any]] = []
        """The conversation."""
        self.got: list[dict[str, Any]] = []
        self.told: list[dict[str, Any]] = []
        self._numbers = count(1)
        self._events: asyncio.Queue[dict[str, Any] | None] = asyncio.Queue()
        self._writing: asyncio.Task[None] | None = None

    async def send(self, event: dict[str, Any]) -> None:
        """Take an event of a client."""
        self.got.append(event)
        match event:
            case {"type": "response.create"}:
                self._writing = asyncio.create_task(self._respond(self.replies.pop(0)), name="a response")
            case {"type": "response.cancel"}:
                if self._writing is None or self._writing.done():
                    self._error("there is no response to cancel")
                else:
                    self._writing.cancel()
            case {"type": "conversation.item.truncate", "item_id": id, "audio_end_ms": ms}:
                item = self._find(id)
                if item is None or "ms" not in item or ms > item["ms"]:
                    self._error("no audio that is so long")
                else:
                    item["ms"], item["content"][0]["transcript"] = ms, ""
                    self._tell("conversation.item.truncated", item_id=id, content_index=0, audio_end_ms=ms)
            case {"type": "conversation.item.delete", "item_id": id}:
                if (item := self._find(id)) is None:
                    self._error("no such item")
                else:
                    self.items.remove(item)
                    self._tell("conversation.item.deleted", item_id=id)
            case {"type": "conversation.item.create", "previous_item_id": before, "item": item}:
                if (place := self._find(before)) is None:
                    self._error("no such item")
                else:
                    made = {"id": f"item_{next(self._numbers)}", **item}
                    self.items.insert(self.items.index(place) + 1, made)
                    self._tell("conversation.item.added", item=made, previous_item_id=before)

    def speech_started(self) -> None:
        """Hear somebody: what is being written is cancelled, as with `interrupt_response`."""
        self._tell("input_audio_buffer.speech_started", audio_start_ms=0, item_id="item_of_a_person")
        if self._writing is not None and not self._writing.done():
            self._writing.cancel("turn_detected")

    async def events(self) -> AsyncIterator[dict[str, Any]]:
        """What a client reads."""
        while (event := await self._events.get()) is not None:
            yield event

    async def close(self) -> None:
        if self._writing is not None:
            self._writing.cancel()
            await asyncio.wait([self._writing])
        self._events.put_nowait(None)

    @property
    def kept(self) -> list[Any]:
        """Text of each message of the conversation; of audio its milliseconds."""
        return [each.get("ms", each["content"][0].get("text")) for each in self.items]

    async def _respond(self, bits: Sequence[str]) -> None:
        response, id = f"resp_{next(self._numbers)}", f"item_{next(self._numbers)}"
        kind = "output_audio" if self.is_audio else "output_text"
        item: dict[str, Any] = {"id": id, "type": "message", "role": "assistant", "content": [{"type": kind}]}
        about = {"response_id": response, "item_id": id, "output_index": 0, "content_index": 0}
        field = "transcript" if self.is_audio else "text"
        item["content"][0][field] = ""
        if self.is_audio:
            item["ms"] = 0
        self._tell("response.created", response={"id": response, "status": "in_progress"})
        self._tell("response.output_item.added", response_id=response, output_index=0, item={"id": id})
        self.items.append(item)
        status = "completed"
        try:
            for bit in bits:
                item["content"][0][field] += bit
                if self.is_audio:
                    item["ms"] += MS_OF_A_LETTER * len(bit)
                    sound = base64.b64encode(bytes(48 * MS_OF_A_LETTER * len(bit))).decode()
                    self._tell("response.output_audio.delta", **about, delta=sound)
                delta = "response.output_audio_transcript.delta" if self.is_audio else "response.output_text.delta"
                self._tell(delta, **about, delta=bit)
                await asyncio.sleep(self.pause)
        except asyncio.CancelledError:
            status = "cancelled"
        self._tell("response.output_item.done", response_id=response, output_index=0, item={"id": id})
        self._tell("response.done", response={"id": response, "status": status})

    def _find(self, id: str) -> dict[str, Any] | None:
        return next((each for each in self.items if each["id"] == id), None)

    def _error(self, message: str) -> None:
        self._tell("error", error={"type": "invalid_request_error", "message": message})

    def _tell(self, type: str, **fields: Any) -> None:
        event = {"type": type, "event_id": f"event_{next(self._numbers)}", **fields}
        self.told.append(event)
        self._events.put_nowait(event)


@asynccontextmanager
async def over_a_socket(api: StandIn) -> AsyncIterator[str]:
    """Serve it at an address of this machine."""

    async def serve(request: web.Request) -> web.WebSocketResponse:
        socket = web.WebSocketResponse()
        await socket.prepare(request)

        async def tell() -> None:
            async for event in api.events():
                await socket.send_str(json.dumps(event))

        telling = asyncio.create_task(tell(), name="events of the stand-in")
        async for message in socket:
            if message.type is WSMsgType.TEXT:
                await api.send(json.loads(message.data))
        telling.cancel()
        await asyncio.wait([telling])
        return socket

    app = web.Application()
    app.router.add_get("/v1/realtime", serve)
    runner = web.AppRunner(app)
    await runner.setup()
    site = web.TCPSite(runner, "127.0.0.1", 0)
    await site.start()
    try:
        yield f"ws://127.0.0.1:{runner.addresses[0][1]}/v1/realtime"
    finally:
        await api.close()
        await runner.cleanup()
