"""Realtime speech APIs: events of the form of OpenAI's come in, and the robot says their words with its own voice.

    async with session.ws_connect(url, headers=headers) as socket:
        speech = RealtimeSpeech(robot, socket.send_json)
        async for message in socket:
            await speech.take(message.json())

What is said is the text of a response, or the transcript of its audio, which itself is not played. `[id]` in it
refers to an object. Where the robot is cut, the conversation is told: a response that still goes on is cancelled, an
audio item is truncated where the robot stopped, and an item of text is put anew with the words that were said, as the
API truncates audio only. Where words end in the audio it does not tell: audio is taken to be spread evenly over them.
Another service that speaks these events needs another way to send them, and no more.
"""

import asyncio
from collections.abc import Awaitable, Callable, Mapping
from typing import Any

from engage_hri.schemas.summary import Summary
from engage_hri.schemas.tool import ToolInput
from engage_hri.services.client.language_models import PLAIN_TURN
from engage_hri.services.client.robot import Robot
from engage_hri.services.frameworks.written_turn import WrittenTurn

TEXT = ("response.output_text.delta", "response.text.delta")
"""Events with text that is all of an answer; the second is that of the API's first version."""
TRANSCRIPT = ("response.output_audio_transcript.delta", "response.audio_transcript.delta")
"""Events with the words of audio."""
AUDIO = ("response.output_audio.delta", "response.audio.delta")
PCM = 48
"""Bytes of a millisecond of audio as the API sends it where nothing else was asked for: 16 bit, 24 kHz."""
Send = Callable[[dict[str, Any]], Awaitable[object]]


class RealtimeItem:
    """A message of a response, which becomes a turn. text: its words so far. audio: bytes of its sound so far."""

    def __init__(self, id: str, part: int, response: str, is_audio: bool) -> None:
        self.id, self.part, self.response, self.is_audio = id, part, response, is_audio
        self.text = ""
        self.audio = 0
        self.is_written = False


class RealtimeSpeech:
    """Speaks the responses of a realtime API through a robot.

    robot: as `connect` gives it. send: sends an event to the API. turn: what concerns each turn. on_turn_over: called
    with what became of each: looks, answer, what was cut. rate: bytes of a millisecond of the API's audio.
    """

    def __init__(
        self,
        robot: Robot,
        send: Send,
        *,
        turn: ToolInput = PLAIN_TURN,
        on_turn_over: Callable[[Summary], None] = lambda told: None,
        rate: int = PCM,
    ) -> None:
        self._robot = robot
        self._send = send
        self._options = turn
        self._on_turn_over = on_turn_over
        self._rate = rate
        self._items: dict[str, RealtimeItem] = {}
        """Items that are not said yet, in order; the first is being said."""
        self._open: set[str] = set()
        """Responses that are being written."""
        self._cut: set[str] = set()
        """Those of them of which no more is said."""
        self._turn: WrittenTurn | None = None
        self._speaking: asyncio.Task[None] | None = None

    async def take(self, event: Mapping[str, Any]) -> None:
        """Take an event of the API. Those that say nothing about speech are passed over."""
        kind = event.get("type", "")
        if kind in TEXT or kind in TRANSCRIPT:
            if (item := self._item(event, kind in TRANSCRIPT)) is not None:
                item.text += event["delta"]
                if self._is_first(item) and self._turn is not None:
                    self._turn.write(event["delta"])
                self._go_on()
        elif kind in AUDIO:
            if (item := self._item(event, True)) is not None:
                item.audio += len(event["delta"]) * 3 // 4  # it is base64
        elif kind == "response.created":
            self._open.add(event["response"]["id"])
        elif kind == "response.output_item.done":
            self._written(event["item"].get("id", ""))
        elif kind == "response.done":
            self._done(event["response"])
        elif kind == "input_audio_buffer.speech_started":
            self.stop()

    def stop(self) -> None:
        """End what is being said at the next word, and all that was to be said after it."""
        if self._turn is not None:
            self._turn.stop()

    async def aclose(self) -> None:
        """Stop the robot, tell the API, and wait for both."""
        self.stop()
        if self._speaking is not None:
            await asyncio.wait([self._speaking])

    def _item(self, event: Mapping[str, Any], is_audio: bool) -> RealtimeItem | None:
        """The item of an event; None: it has been cut, and what still comes of it is not said."""
        if event["response_id"] in self._cut:
            return None
        self._open.add(event["response_id"])
        made = RealtimeItem(event["item_id"], event["content_index"], event["response_id"], is_audio)
        return self._items.setdefault(made.id, made)

    def _is_first(self, item: RealtimeItem) -> bool:
        return next(iter(self._items.values())) is item

    def _written(self, id: str) -> None:
        if (item := self._items.get(id)) is not None:
            item.is_written = True
            if self._is_first(item) and self._turn is not None:
                self._turn.end()

    def _done(self, response: Mapping[str, Any]) -> None:
        """Take note that a response is written. One that was cancelled, as a person spoke, is not said to its end."""
        self._open.discard(response["id"])
        self._cut.discard(response["id"])
        own = [each for each in self._items.values() if each.response == response["id"]]
        if response.get("status") == "cancelled" and any(map(self._is_first, own)):
            self.stop()
        for item in own:
            self._written(item.id)

    def _go_on(self) -> None:
        """Begin with the next item, if the one before is over."""
        item = next(iter(self._items.values()), None)
        if self._turn is None and item is not None and item.text:
            self._turn = WrittenTurn(self._robot, f"realtime-{self._robot.id}-{item.id}", turn=self._options)
            self._turn.write(item.text)
            if item.is_written:
                self._turn.end()
            self._speaking = asyncio.create_task(self._follow(self._turn, item), name=f"robot says {item.id}")

    async def _follow(self, turn: WrittenTurn, item: RealtimeItem) -> None:
        told = await turn.over()
        self._on_turn_over(told)
        if told.status == "done":
            del self._items[item.id]
        else:
            unsaid, self._items = [*self._items.values()], {}
            responses = self._open & {each.response for each in unsaid}
            self._cut |= responses
            for response in sorted(responses):
                await self._send({"type": "response.cancel", "response_id": response})
            for each in unsaid:
                await self._take_back(each, told.said if each is item else "")
        self._turn = self._speaking = None
        self._go_on()

    async def _take_back(self, item: RealtimeItem, said: str) -> None:
        """Leave in the conversation what was said of an item."""
        if item.is_audio:
            heard = min(1.0, len(said) / max(1, len(item.text)))
            ends = int(item.audio / self._rate * heard)
            cut = {"item_id": item.id, "content_index": item.part, "audio_end_ms": ends}
            await self._send({"type": "conversation.item.truncate", **cut})
            return
        if said:
            words = [{"type": "output_text", "text": said}]
            message = {"type": "message", "role": "assistant", "content": words}
            await self._send({"type": "conversation.item.create", "previous_item_id": item.id, "item": message})
        await self._send({"type": "conversation.item.delete", "item_id": item.id})
